"""Where rays first meet triangles: a numba kernel over plain arrays."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from inspect3d.nominal.bvh import STACK

BATCH = 512


@njit(cache=True, parallel=True)
def first_hit(origins, directions, centre, reach, boxes, links, order, facets, distance, triangle):
    """Write how far along its unit direction each ray first meets a triangle, and which.

    Parameters
    ----------
    origins : (n, 3) mm
    directions : (n, 3), unit
    centre : (3,) mm, origin of the facets and boxes
    reach : (n,) mm, hits farther than this do not count
    boxes, links, order : the tree
    facets : (m, 12) corners and normal, in the order of the tree's leaves
    distance, triangle : (n,), written: infinity and -1 where nothing is hit
    """
    for batch in prange((len(origins) + BATCH - 1) // BATCH):
        stack = np.empty(STACK, dtype=np.int64)
        ray = np.empty(9)
        for i in range(batch * BATCH, min((batch + 1) * BATCH, len(origins))):
            ray[:3] = origins[i] - centre
            ray[3:6] = directions[i]
            slot, length = _first(ray, reach[i], boxes, links, order, facets, stack)
            triangle[i] = order[slot] if slot >= 0 else -1
            distance[i] = length if slot >= 0 else np.inf


@njit(cache=True)
def _first(ray, reach, boxes, links, order, facets, stack):
    for axis in range(3):
        along = ray[3 + axis]
        ray[6 + axis] = 1.0 / (along if abs(along) > 1e-150 else 1e-150)
    z = np.argmax(np.abs(ray[3:6]))
    x, y = (z + 1) % 3, (z + 2) % 3
    best, least = -1, reach
    stack[0] = 0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if _entry(ray, boxes, node) > least:
            continue
        first, count = links[node]
        if count == 0:
            near, far = first, first + 1
            if _entry(ray, boxes, far) < _entry(ray, boxes, near):
                near, far = far, near
            stack[waiting], stack[waiting + 1] = far, near
            waiting += 2
            continue
        for slot in range(first, first + count):
            length = _meet(ray, x, y, z, facets, slot)
            if length < least or (length == least and (best < 0 or order[slot] < order[best])):
                best, least = slot, length
    return best, least


@njit(cache=True)
def _entry(ray, boxes, node):
    """Return how far along the ray a box begins, infinity where it is missed."""
    enter, leave = 0.0, np.inf
    for axis in range(3):
        s = (boxes[node, axis] - ray[axis]) * ray[6 + axis]
        t = (boxes[node, 3 + axis] - ray[axis]) * ray[6 + axis]
        enter, leave = max(enter, min(s, t)), min(leave, max(s, t))
    return enter if enter <= leave * (1 + 1e-15) else np.inf


@njit(cache=True)
def _meet(ray, x, y, z, facets, slot):
    """Return how far along the ray a triangle is met, infinity where it is missed.

    S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle intersection", J. Computer Graphics Techniques 2(1), 2013:
    the edge functions of neighbours are exact negatives of each other, so no ray slips between them.
    """
    sx, sy = ray[3 + x] / ray[3 + z], ray[3 + y] / ray[3 + z]
    az, bz, cz = facets[slot, z] - ray[z], facets[slot, 3 + z] - ray[z], facets[slot, 6 + z] - ray[z]
    ax, ay = facets[slot, x] - ray[x] - sx * az, facets[slot, y] - ray[y] - sy * az
    bx, by = facets[slot, 3 + x] - ray[x] - sx * bz, facets[slot, 3 + y] - ray[y] - sy * bz
    cx, cy = facets[slot, 6 + x] - ray[x] - sx * cz, facets[slot, 6 + y] - ray[y] - sy * cz
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    if (u < 0 or v < 0 or w < 0) and (u > 0 or v > 0 or w > 0):
        return np.inf
    total = u + v + w
    if total == 0:
        return np.inf
    length = (u * az + v * bz + w * cz) / (total * ray[3 + z])
    return length if length > 0 else np.inf
