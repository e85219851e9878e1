"""Quasi-uniform triangles on the part, their nodes exactly on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers, unit
from inspect3d.nominal.bodies import bodies_of
from inspect3d.nominal.facing import closest_facing
from inspect3d.nominal.lines import Placed
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.nominal.placement import SNAP, placed
from inspect3d.nominal.remeshing import FEATURE_ANGLE, remeshed
from inspect3d.nominal.sharp import corners_of_lines, nearest_nodes, nearest_on_segments, sides_of
from inspect3d.nominal.surface import Surface
from inspect3d.nominal.tessellation import Tessellation
from inspect3d.outcome import InputError

_NEARLY_SHARP = 0.8 * FEATURE_ANGLE
_SLIVER = 1e-3

Place = Callable[[Integers, Floats, Floats, Booleans], Placed]


def mesh_on_brep(tessellation: Tessellation, size: float) -> tuple[InspectionMesh, tuple[str, ...]]:
    """Return an inspection mesh with edges of about `size` mm whose nodes lie on the exact faces, and remarks.

    Parameters
    ----------
    tessellation : of the part, with chords well below `size`
    size : mm
    """

    def place(body: Integers, nodes: Floats, normals: Floats, feature: Booleans) -> Placed:
        return placed(_part(tessellation, body), nodes, normals, feature, size)

    return _meshed(tessellation.vertices, tessellation.triangles, size, place)


def mesh_on_surface(surface: Surface, size: float) -> tuple[InspectionMesh, tuple[str, ...]]:
    """Return an inspection mesh with edges of about `size` mm whose nodes lie on a mesh model, and remarks."""

    def place(body: Integers, nodes: Floats, normals: Floats, feature: Booleans) -> Placed:
        return _on_surface(Surface(surface.vertices, surface.triangles[body]), nodes, normals, feature, size)

    return _meshed(surface.vertices, surface.triangles, size, place)


def _meshed(vertices: Floats, triangles: Integers, size: float, place: Place) -> tuple[InspectionMesh, tuple[str, ...]]:
    """Mesh body by body, put the nodes in their places, and leave out what found none."""
    meshes, lost, folded = [], 0, 0
    for body in bodies_of(triangles):
        nodes, corners = remeshed(vertices, triangles[body], size)
        if not len(corners):
            nodes, corners = vertices, triangles[body]
        at = place(body, nodes, _normals(nodes, corners), _features(nodes, corners))
        astray = np.linalg.norm(at.points - nodes, axis=1) > size
        kept = corners[~astray[corners].any(axis=1)]
        proper = _proper(at, kept)
        lost, folded = lost + int(astray[corners].any(axis=1).sum()), folded + int((~proper).sum())
        meshes.append((at, kept[proper]))
    remarks = []
    if lost:
        remarks.append(f"{lost} elements are left out of the inspection mesh: the model cannot be evaluated there.")
    if folded:
        remarks.append(f"{folded} degenerate or folded elements are left out of the inspection mesh.")
    return _joined(meshes), tuple(remarks)


def _joined(meshes: list[tuple[Placed, Integers]]) -> InspectionMesh:
    starts = np.cumsum([0] + [len(at.points) for at, _ in meshes])
    triangles = np.concatenate([corners + start for (_, corners), start in zip(meshes, starts, strict=False)])
    if not len(triangles):
        raise InputError(
            "No inspection mesh can be made: the part is smaller than one element; set element_size lower."
        )
    points, normals, face, crease = (np.concatenate(column) for column in zip(*(at for at, _ in meshes), strict=True))
    used, compact = np.unique(triangles, return_inverse=True)
    return InspectionMesh(points[used], compact.reshape(-1, 3), normals[used], crease[used], face[used])


def _part(tessellation: Tessellation, body: Integers) -> Tessellation:
    """Return the tessellation of one body."""
    triangles = tessellation.triangles[body]
    own = np.zeros(len(tessellation.vertices), dtype=bool)
    own[triangles] = True
    segments = own[tessellation.segments].all(axis=1)
    return replace(
        tessellation,
        triangles=triangles,
        face=tessellation.face[body],
        uv=tessellation.uv[body],
        segments=tessellation.segments[segments],
        segment_edge=tessellation.segment_edge[segments],
        segment_t=tessellation.segment_t[segments],
    )


def _on_surface(surface: Surface, nodes: Floats, normals: Floats, feature: Booleans, size: float) -> Placed:
    """Return nodes at their feet on a triangulated surface; those of sharp edges and rims on its own."""
    points, _ = closest_facing(surface, nodes, normals)
    sides = sides_of(surface.vertices, surface.triangles)
    lines = sides.sharp(FEATURE_ANGLE)
    start, end = surface.vertices[lines[:, 0]], surface.vertices[lines[:, 1]]
    near = nearest_on_segments(nodes, start, end, size / 4)
    on_line = feature & (near.distance < SNAP * size)
    segment, share = near.segment[on_line], near.share[on_line, None]
    points[on_line] = start[segment] + share * (end - start)[segment]
    corners = np.flatnonzero(corners_of_lines(surface.vertices, lines, FEATURE_ANGLE))
    at_corner, corner = nearest_nodes(nodes, surface.vertices[corners], SNAP * size)
    points[at_corner] = surface.vertices[corners[corner]]
    folds = sides.ends[sides.angle > FEATURE_ANGLE]
    to_fold = nearest_on_segments(points, surface.vertices[folds[:, 0]], surface.vertices[folds[:, 1]], size / 4)
    crease = to_fold.distance < 1e-9 * surface.diagonal
    return Placed(points, surface.closest(points).normals, np.full(len(points), -1), crease)


def _proper(nodes: Placed, triangles: Integers) -> Booleans:
    """Tell which triangles (m,) have an area and look the way that their nodes do."""
    a, b, c = (nodes.points[triangles[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    longest = np.max([np.linalg.norm(side, axis=1) for side in (b - a, c - b, a - c)], axis=0)
    looks = np.einsum("ijk,ik->ij", nodes.normals[triangles], cross)
    return (np.linalg.norm(cross, axis=1) > _SLIVER * longest**2) & (looks > 0).any(axis=1)


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
