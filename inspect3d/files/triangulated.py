"""Polygons cut into triangles."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.files.content import Content
from inspect3d.files.found import Found

_FLAT = 1e-12


def triangulated(content: Content, found: Found) -> Integers:
    """Return the triangles (m, 3) of checked polygons, in their order and with their winding.

    A quadrilateral is cut along the diagonal that folds nothing, a larger polygon by cutting off ears: a convex
    corner whose triangle holds no other corner. If every ear turns the way of the polygon and no edge is passed twice
    in one direction, the triangles cover the polygon exactly once, also where it is concave or reaches a hole along a
    bridge.

    Raises
    ------
    InputError
        A polygon refers to a vertex that is not there, has fewer than three corners, passes an edge twice, or crosses
        itself.

    Notes
    -----
    G. H. Meisters, Polygons have ears, American Mathematical Monthly 82 (1975).
    """
    corners, sizes = found.corners, found.sizes
    wrong = np.flatnonzero((corners < 0) | (corners >= len(found.points)))
    if len(wrong):
        face = np.searchsorted(np.cumsum(sizes), wrong[0], side="right") + 1
        raise content.refused(f"refers to vertex {corners[wrong[0]]} in face {face}, and there are {len(found.points)}")
    if (sizes < 3).any():
        face = np.flatnonzero(sizes < 3)[0]
        raise content.refused(f"has a face, number {face + 1}, of {sizes[face]} corners")
    starts = np.cumsum(sizes) - sizes
    pieces = np.zeros((int((sizes - 2).sum()), 3), dtype=np.int64)
    first = np.cumsum(sizes - 2) - (sizes - 2)
    three, four = sizes == 3, sizes == 4
    pieces[first[three]] = corners[starts[three, None] + np.arange(3)]
    if four.any():
        halves = _quadrilaterals(found.points, corners[starts[four, None] + np.arange(4)])
        pieces[first[four]], pieces[first[four] + 1] = halves
    for face in np.flatnonzero(sizes > 4):
        polygon = corners[starts[face] : starts[face] + sizes[face]]
        edges = np.column_stack([polygon, np.roll(polygon, -1)])
        if len(np.unique(edges, axis=0)) < len(edges):
            raise content.refused(f"has a face, number {face + 1}, that passes an edge twice in the same direction")
        ears = _ears(found.points[polygon])
        if ears is None:
            raise content.refused(f"has a face, number {face + 1}, that crosses itself", "Export it as triangles.")
        pieces[first[face] : first[face] + sizes[face] - 2] = polygon[ears]
    return pieces


def _quadrilaterals(points: Floats, corners: Integers) -> tuple[Integers, Integers]:
    """Return both triangles of each: along the diagonal 0-2, or 1-3 where 0-2 folds the face over."""
    a, b, c, d = (points[corners[:, i]] for i in range(4))
    folded = np.einsum("ij,ij->i", np.cross(b - a, c - a), np.cross(c - a, d - a)) < 0
    one = np.where(folded[:, None], corners[:, [0, 1, 3]], corners[:, [0, 1, 2]])
    two = np.where(folded[:, None], corners[:, [1, 2, 3]], corners[:, [0, 2, 3]])
    return one, two


def _ears(points: Floats) -> Integers | None:
    """Return the triangles (n - 2, 3) of one polygon (n, 3), or None where no ear is left."""
    centred = points - points.mean(axis=0)
    area = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0) / 2
    axis = int(np.argmax(np.abs(area)))
    flat = np.delete(centred, axis, axis=1)
    if area[axis] * (-1) ** axis < 0:
        flat = flat[:, ::-1]
    smallest = -_FLAT * float(np.ptp(flat, axis=0).max()) ** 2
    left = list(range(len(points)))
    ears = []
    while len(left) > 3:
        ear = _best_ear(flat[left], smallest)
        if ear is None:
            return None
        ears.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear]
    last = np.array(left)
    if _cross(*flat[last]) < smallest:
        return None
    return np.array([*ears, last.tolist()], dtype=np.int64)


def _best_ear(flat: Floats, smallest: float) -> int | None:
    """Return the ear with the roundest triangle, so that slivers come only where nothing else is left."""
    before, after = np.roll(flat, 1, axis=0), np.roll(flat, -1, axis=0)
    area = _cross(before, flat, after)
    sides = sum(((p - q) ** 2).sum(axis=1) for p, q in ((before, flat), (flat, after), (after, before)))
    for corner in np.argsort(-area / np.maximum(sides, np.finfo(float).tiny)):
        if area[corner] < smallest:
            return None
        a, b, c = before[corner], flat[corner], after[corner]
        inside = (_cross(a, b, flat) >= 0) & (_cross(b, c, flat) >= 0) & (_cross(c, a, flat) >= 0)
        at_corner = (flat == a).all(axis=1) | (flat == b).all(axis=1) | (flat == c).all(axis=1)
        if not (inside & ~at_corner).any():
            return int(corner)
    return None


def _cross(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return twice the signed area of the triangles a b c in the plane."""
    u, v = b - a, c - a
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
