"""The pseudo-normal of a point, gathered from all triangles that touch it: a numba kernel over plain arrays.

The table of pseudo-normals by edge and vertex is wrong next to triangles without area: they separate neighbours that
touch. There, the normal is summed at the foot itself, whatever the indices say. It is rare, so it may be slow.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from inspect3d.arrays import Booleans, Floats
from inspect3d.nominal.bvh import BRANCH, LANES, STACK, Tree
from inspect3d.nominal.features import Features


@njit(cache=True)
def gathered_normal(x: float, y: float, z: float, tree: Tree, features: Features) -> tuple[float, float, float, bool]:
    """Return the unit normal at a point of the surface, zero where it cancels, and whether an open rim passes there.

    Each triangle that touches the point counts by the angle it takes up around it: a full turn where the point lies in
    its face, half a turn on its edge, its own angle at its vertex. Triangles without area count nothing.
    """
    total_x, total_y, total_z, rim = 0.0, 0.0, 0.0, False
    tolerance = features.tolerance
    point = np.array([x, y, z])
    near = np.empty(3, dtype=np.bool_)
    seen = -1
    stack = np.empty(STACK, dtype=np.int64)
    stack[0] = 0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        kind, number = tree.links[stack[waiting]]
        if not _within(point, tree.boxes[stack[waiting]], tolerance):
            continue
        if kind == BRANCH:
            stack[waiting], stack[waiting + 1] = number, number + 1
            waiting += 2
            continue
        for lane in range(LANES):
            record, triangle = tree.packets[number, :, lane], tree.members[number, lane]
            repeated = triangle == seen
            seen = triangle
            if repeated or not _touches(point, record, tolerance, near):
                continue
            for k in range(3):
                rim |= near[k] and features.rims[features.of_triangle[triangle, 1 + k]]
            angle = _angle(record, near)
            total_x += angle * record[9]
            total_y += angle * record[10]
            total_z += angle * record[11]
    length = math.sqrt(total_x**2 + total_y**2 + total_z**2)
    if length < 1e-12:
        return 0.0, 0.0, 0.0, rim
    return total_x / length, total_y / length, total_z / length, rim


@njit(cache=True)
def _within(point: Floats, box: Floats, tolerance: float) -> bool:
    for axis in range(3):
        if point[axis] < box[axis] - tolerance or point[axis] > box[3 + axis] + tolerance:
            return False
    return True


@njit(cache=True)
def _touches(point: Floats, record: Floats, tolerance: float, near: Booleans) -> bool:
    """Tell whether a point lies on a triangle; write which of its edges ab, bc, ca it is near to."""
    normal = record[9:12]
    inside = normal.any() and abs(_dot(point - record[:3], normal)) <= tolerance
    for k in range(3):
        a, b = record[3 * k : 3 * k + 3], record[3 * ((k + 1) % 3) : 3 * ((k + 1) % 3) + 3]
        edge, arm = b - a, point - a
        along = min(max(_dot(edge, arm) * record[12 + k], 0.0), 1.0)
        apart = arm - along * edge
        near[k] = _dot(apart, apart) <= tolerance**2
        inside = inside and _dot(np.cross(edge, arm), normal) > 0
    return inside or bool(near.any())


@njit(cache=True)
def _angle(record: Floats, near: Booleans) -> float:
    """Return the angle a triangle takes up around a point on it that is near to the given edges."""
    count = int(near[0]) + int(near[1]) + int(near[2])
    if count == 3:
        return 0.0
    if count < 2:
        return (2 - count) * math.pi
    k = 0
    while not (near[k] and near[(k + 2) % 3]):
        k += 1
    a, b, c = 3 * k, 3 * ((k + 1) % 3), 3 * ((k + 2) % 3)
    u, v = record[b : b + 3] - record[a : a + 3], record[c : c + 3] - record[a : a + 3]
    w = np.cross(u, v)
    return math.atan2(math.sqrt(_dot(w, w)), _dot(u, v))


@njit(cache=True)
def _dot(u: Floats, v: Floats) -> float:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
