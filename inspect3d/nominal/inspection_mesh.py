"""Quasi-uniform triangles on the part, their nodes exactly on it."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers, unit
from inspect3d.nominal.facing import closest_facing
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.nominal.placement import Placed, placed
from inspect3d.nominal.remeshing import FEATURE_ANGLE, remeshed
from inspect3d.nominal.sharp import corners_of_lines, nearest_nodes, nearest_on_segments, sides_of
from inspect3d.nominal.surface import Surface
from inspect3d.nominal.tessellation import Tessellation

_NEARLY_SHARP = 0.8 * FEATURE_ANGLE
_SLIVER = 1e-3


def mesh_on_brep(tessellation: Tessellation, size: float) -> InspectionMesh:
    """Return an inspection mesh with edges of about `size` mm whose nodes lie on the exact faces."""
    nodes, triangles = remeshed(tessellation.vertices, tessellation.triangles, size)
    feature = _features(nodes, triangles)
    return _finished(placed(tessellation, nodes, _normals(nodes, triangles), feature, size), triangles)


def mesh_on_surface(surface: Surface, size: float) -> InspectionMesh:
    """Return an inspection mesh with edges of about `size` mm whose nodes lie on a triangulated surface."""
    nodes, triangles = remeshed(surface.vertices, surface.triangles, size)
    feature = _features(nodes, triangles)
    sides = sides_of(surface.vertices, surface.triangles)
    points, _ = closest_facing(surface, nodes, _normals(nodes, triangles))
    lines = sides.sharp(FEATURE_ANGLE)
    start, end = surface.vertices[lines[:, 0]], surface.vertices[lines[:, 1]]
    near = nearest_on_segments(nodes, start, end, size / 4)
    on_line = feature & (near.distance < size / 2)
    segment, share = near.segment[on_line], near.share[on_line, None]
    points[on_line] = start[segment] + share * (end - start)[segment]
    corners = np.flatnonzero(corners_of_lines(surface.vertices, lines, FEATURE_ANGLE))
    at_corner, corner = nearest_nodes(nodes, surface.vertices[corners], size / 10)
    points[at_corner] = surface.vertices[corners[corner]]
    folds = sides.ends[sides.angle > FEATURE_ANGLE]
    to_fold = nearest_on_segments(points, surface.vertices[folds[:, 0]], surface.vertices[folds[:, 1]], size / 4)
    crease = to_fold.distance < 1e-9 * surface.diagonal
    none = np.full(len(points), -1)
    return _finished(Placed(points, surface.closest(points).normals, none, crease), triangles)


def _finished(nodes: Placed, triangles: Integers) -> InspectionMesh:
    """Leave out triangles that placing made degenerate, and nodes that no triangle needs."""
    a, b, c = (nodes.points[triangles[:, k]] for k in range(3))
    longest = np.max(
        [np.linalg.norm(b - a, axis=1), np.linalg.norm(c - b, axis=1), np.linalg.norm(a - c, axis=1)], axis=0
    )
    proper = np.linalg.norm(np.cross(b - a, c - a), axis=1) > _SLIVER * longest**2
    used, compact = np.unique(triangles[proper], return_inverse=True)
    points, normals, face, crease = (column[used] for column in nodes)
    return InspectionMesh(points, compact.reshape(-1, 3), normals, crease, face)


def _features(nodes: Floats, triangles: Integers) -> Booleans:
    feature = np.zeros(len(nodes), dtype=bool)
    feature[sides_of(nodes, triangles).sharp(_NEARLY_SHARP).ravel()] = True
    return feature


def _normals(nodes: Floats, triangles: Integers) -> Floats:
    """Return the normals (n, 3) of a mesh's nodes, weighted by area."""
    a, b, c = (nodes[triangles[:, k]] for k in range(3))
    cross = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    at = triangles.ravel()
    return unit(np.stack([np.bincount(at, cross[:, k], minlength=len(nodes)) for k in range(3)], axis=1))
