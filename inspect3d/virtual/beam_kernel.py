"""Which triangles rays from one point meet first: a numba kernel over plain arrays.

Neighbouring rays go through the tree together, as a beam that gathers the leaves it touches; each ray then looks only
at those. The kernel holds no lock and uses one thread.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from inspect3d.arrays import Floats, Integers
from inspect3d.nominal.bvh import BRANCH, LANES, STACK, Tree
from inspect3d.nominal.ray_kernel import box_entry, write_lengths

BEAM = 64
NARROW = 0.5  # cosine; a beam wider than this touches everything
SLACK = 1e-9


@njit(cache=True, nogil=True, error_model="numpy")
def first_met(origin: Floats, directions: Floats, tree: Tree, triangle: Integers, distance: Floats) -> None:
    """Write the triangle (n,) that each ray meets first, -1 where there is none, and how far along it, (n,) mm.

    Parameters
    ----------
    origin : (3,) mm
    directions : (n, 3), unit; fast where neighbours in the list are neighbours in space
    """
    leaves, sides = np.empty(len(tree.links), dtype=np.int64), np.empty((4, 3))
    stack, lengths, ray = np.empty(STACK, dtype=np.int64), np.empty(LANES), np.empty((3, 3))
    for axis in range(3):
        ray[0, axis] = origin[axis] - tree.origin[axis]
    for start in range(0, len(directions), BEAM):
        stop = min(start + BEAM, len(directions))
        _write_sides(directions[start:stop], sides)
        touched = _gather(ray[0], sides, tree, stack, leaves)
        for i in range(start, stop):
            for axis in range(3):
                along = directions[i, axis]
                ray[1, axis] = along
                ray[2, axis] = 1.0 / (along if abs(along) > 1e-150 else 1e-150)
            least, first = np.inf, -1
            for k in range(touched):
                leaf = leaves[k]
                entry = box_entry(ray, tree.boxes, leaf)
                if entry > least or entry == np.inf:
                    continue
                packet = tree.links[leaf, 1]
                write_lengths(ray, tree.packets[packet], tree.packets.shape[2], lengths)
                for lane in range(LANES):
                    member, length = tree.members[packet, lane], lengths[lane]
                    if length < least or (length == least and length < np.inf and member < first):
                        least, first = length, member
            triangle[i], distance[i] = first, least


@njit(cache=True, nogil=True, error_model="numpy")
def _write_sides(directions: Floats, sides: Floats) -> None:
    """Write four planes (4, 3) through the origin that enclose a beam; their normals point out of it."""
    along, a, b = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(len(directions)):
        along += directions[i]
    along /= np.sqrt((along * along).sum())
    least = np.argmin(np.abs(along))
    second, third = (least + 1) % 3, (least + 2) % 3
    a[second], a[third] = -along[third], along[second]
    a /= np.sqrt((a * a).sum())
    for axis in range(3):
        after, last = (axis + 1) % 3, (axis + 2) % 3
        b[axis] = along[after] * a[last] - along[last] * a[after]
    low_a = low_b = np.inf
    high_a = high_b = -np.inf
    for i in range(len(directions)):
        ahead = (directions[i] * along).sum()
        if not ahead > NARROW:
            sides[:] = 0.0
            return
        in_a, in_b = (directions[i] * a).sum() / ahead, (directions[i] * b).sum() / ahead
        low_a, high_a, low_b, high_b = min(low_a, in_a), max(high_a, in_a), min(low_b, in_b), max(high_b, in_b)
    sides[0], sides[1] = (low_a - SLACK) * along - a, a - (high_a + SLACK) * along
    sides[2], sides[3] = (low_b - SLACK) * along - b, b - (high_b + SLACK) * along


@njit(cache=True, nogil=True, error_model="numpy")
def _gather(origin: Floats, sides: Floats, tree: Tree, stack: Integers, leaves: Integers) -> int:
    """Write the nodes of the leaves whose boxes a beam may touch; return how many they are."""
    stack[0] = 0
    waiting, touched = 1, 0
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        outside = False
        for side in range(4):
            nearest = 0.0
            for axis in range(3):
                normal = sides[side, axis]
                corner = tree.boxes[node, axis] if normal > 0.0 else tree.boxes[node, 3 + axis]
                nearest += normal * (corner - origin[axis])
            outside = outside or nearest > 0.0
        if outside:
            continue
        if tree.links[node, 0] == BRANCH:
            stack[waiting], stack[waiting + 1] = tree.links[node, 1], tree.links[node, 1] + 1
            waiting += 2
            continue
        leaves[touched] = node
        touched += 1
    return touched
