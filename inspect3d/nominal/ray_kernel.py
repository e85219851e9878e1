"""Where rays first meet triangles: numba kernels over plain arrays."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.nominal.bvh import BRANCH, LANES, STACK, Tree

BATCH = 512
ENDLESS = 1e300


@njit(cache=True, parallel=True)
def first_hit(
    origins: Floats, directions: Floats, reaches: Floats, tree: Tree, distance: Floats, triangle: Integers
) -> None:
    """Write how far along its direction each ray first meets a triangle, and which.

    Parameters
    ----------
    origins : (n, 3) mm
    directions : (n, 3), unit
    reaches : (n,) mm, hits farther away do not count
    tree : the arrays of `Tree`
    distance, triangle : (n,), written: infinity and -1 where nothing is met
    """
    for batch in prange((len(origins) + BATCH - 1) // BATCH):
        stack, bounds, lengths = np.empty(STACK, dtype=np.int64), np.empty(STACK), np.empty(LANES)
        ray = np.empty((3, 3))
        for i in range(batch * BATCH, min((batch + 1) * BATCH, len(origins))):
            for axis in range(3):
                along = directions[i, axis]
                ray[0, axis] = origins[i, axis] - tree.origin[axis]
                ray[1, axis] = along
                ray[2, axis] = 1.0 / (along if abs(along) > 1e-150 else 1e-150)
            distance[i], triangle[i] = _first(ray, reaches[i], tree, stack, bounds, lengths)


@njit(cache=True, parallel=True)
def between(points: Floats, target: Floats, tree: Tree, hidden: Booleans) -> None:
    """Tell whether a triangle lies between each point and the target.

    Parameters
    ----------
    points : (n, 3) mm
    target : (3,) mm
    tree : the arrays of `Tree`
    hidden : (n,), written
    """
    for batch in prange((len(points) + BATCH - 1) // BATCH):
        stack, lengths, ray = np.empty(STACK, dtype=np.int64), np.empty(LANES), np.empty((3, 3))
        for i in range(batch * BATCH, min((batch + 1) * BATCH, len(points))):
            squared = 0.0
            for axis in range(3):
                squared += (target[axis] - points[i, axis]) ** 2
            reach = np.sqrt(squared)
            for axis in range(3):
                along = (target[axis] - points[i, axis]) / reach
                ray[0, axis] = points[i, axis] - tree.origin[axis]
                ray[1, axis] = along
                ray[2, axis] = 1.0 / (along if abs(along) > 1e-150 else 1e-150)
            hidden[i] = _met(ray, reach, tree, stack, lengths)


@njit(cache=True)
def _met(ray: Floats, reach: float, tree: Tree, stack: Integers, lengths: Floats) -> bool:
    """Tell whether a ray meets any triangle within its reach."""
    boxes, links = tree.boxes, tree.links
    stack[0] = 0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if box_entry(ray, boxes, node) > reach:
            continue
        first = links[node, 1]
        if links[node, 0] == BRANCH:
            stack[waiting], stack[waiting + 1] = first, first + 1
            waiting += 2
            continue
        write_lengths(ray, tree.packets[first], tree.packets.shape[2], lengths)
        for lane in range(LANES):
            if lengths[lane] <= reach:
                return True
    return False


@njit(cache=True)
def _first(
    ray: Floats, reach: float, tree: Tree, stack: Integers, bounds: Floats, lengths: Floats
) -> tuple[float, int]:
    """Return length and triangle of the first hit of a ray: its origin, direction, and one over that."""
    boxes, links = tree.boxes, tree.links
    least, triangle = min(reach, ENDLESS), -1
    stack[0], bounds[0] = 0, box_entry(ray, boxes, 0)
    waiting = 1
    while waiting > 0:
        waiting -= 1
        if bounds[waiting] > least:
            continue
        node = stack[waiting]
        while links[node, 0] == BRANCH:
            near, far = links[node, 1], links[node, 1] + 1
            near_bound, far_bound = box_entry(ray, boxes, near), box_entry(ray, boxes, far)
            if far_bound < near_bound:
                near, far, near_bound, far_bound = far, near, far_bound, near_bound
            if near_bound > least:
                break
            if far_bound <= least:
                stack[waiting], bounds[waiting] = far, far_bound
                waiting += 1
            node = near
        else:
            packet = links[node, 1]
            write_lengths(ray, tree.packets[packet], tree.packets.shape[2], lengths)
            for lane in range(LANES):
                member, length = tree.members[packet, lane], lengths[lane]
                if length < least or (length == least and (triangle < 0 or member < triangle)):
                    least, triangle = length, member
    return least if triangle >= 0 else np.inf, triangle


@njit(cache=True)
def box_entry(ray: Floats, boxes: Floats, node: int) -> float:
    """Return how far along a ray a box begins, infinity where it is missed."""
    enter, leave = 0.0, np.inf
    for axis in range(3):
        s = (boxes[node, axis] - ray[0, axis]) * ray[2, axis]
        t = (boxes[node, 3 + axis] - ray[0, axis]) * ray[2, axis]
        enter, leave = max(enter, min(s, t)), min(leave, max(s, t))
    return enter if enter <= leave * (1 + 1e-15) else np.inf


@njit(cache=True)
def write_lengths(ray: Floats, packet: Floats, lanes: int, lengths: Floats) -> None:
    """Write how far along a ray the triangles of a packet are met, infinity where they are missed, all lanes at once.

    Notes
    -----
    S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle intersection", Journal of Computer Graphics Techniques 2(1),
    2013. Neighbours find exactly opposite values for the edge they share, so no ray slips through between them.
    """
    z = 0
    for axis in range(1, 3):
        if abs(ray[1, axis]) > abs(ray[1, z]):
            z = axis
    x, y = (z + 1) % 3, (z + 2) % 3
    ox, oy, oz = ray[0, x], ray[0, y], ray[0, z]
    sx, sy, sz = ray[1, x] / ray[1, z], ray[1, y] / ray[1, z], ray[1, z]
    for k in range(lanes):
        az, bz, cz = packet[z, k] - oz, packet[3 + z, k] - oz, packet[6 + z, k] - oz
        ax, ay = packet[x, k] - ox - sx * az, packet[y, k] - oy - sy * az
        bx, by = packet[3 + x, k] - ox - sx * bz, packet[3 + y, k] - oy - sy * bz
        cx, cy = packet[6 + x, k] - ox - sx * cz, packet[6 + y, k] - oy - sy * cz
        u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
        total = u + v + w
        same = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
        length = (u * az + v * bz + w * cz) / ((total if total != 0 else 1.0) * sz)
        lengths[k] = length if same & (total != 0) & (length > 0) else np.inf
