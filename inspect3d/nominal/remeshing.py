"""Quasi-uniform triangles in place of any others."""

from __future__ import annotations

from typing import Any

import numpy as np

from inspect3d.arrays import Floats, Integers

FEATURE_ANGLE = np.radians(30.0)
"""Facets farther apart than this meet in a sharp edge, rad."""

_ROUNDS = 10
_TOO_SHORT = 0.8


def remeshed(vertices: Floats, triangles: Integers, size: float) -> tuple[Floats, Integers]:
    """Return vertices (k, 3) mm and triangles (l, 3) of about the asked edge length that keep sharp edges and rims.

    The vertices lie near the given surface, not on it: whoever knows the exact surface puts them there. Give one body
    at a time: surfaces that touch hinder each other.

    Parameters
    ----------
    vertices : (n, 3) mm, shared by the triangles around them
    triangles : (m, 3)
    size : wanted edge length, mm

    Notes
    -----
    MeshLab's isotropic explicit remeshing after M. Botsch, L. Kobbelt, "A Remeshing Approach to Multiresolution
    Modeling", Eurographics Symposium on Geometry Processing, 2004.
    """
    import pymeshlab

    used, compact = np.unique(triangles, return_inverse=True)
    centre = vertices[used].mean(axis=0)
    faces = compact.reshape(-1, 3).astype(np.int32)
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=vertices[used] - centre, face_matrix=faces))
    _improve(meshes, size, near_surface=True)
    result = meshes.current_mesh()
    if _median_side(result.vertex_matrix(), result.face_matrix()) < _TOO_SHORT * size:
        _improve(meshes, size, near_surface=False)
    meshes.meshing_remove_duplicate_faces()
    meshes.meshing_remove_unreferenced_vertices()
    result = meshes.current_mesh()
    return result.vertex_matrix() + centre, result.face_matrix().astype(np.int64)


def _improve(meshes: Any, size: float, near_surface: bool) -> None:
    """Split, collapse, swap, smooth and reproject; `near_surface` refuses what would leave the surface by a quarter."""
    import pymeshlab

    # Every option is named: pymeshlab remembers those of the call before.
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=_ROUNDS,
        adaptive=False,
        selectedonly=False,
        targetlen=pymeshlab.PureValue(size),
        featuredeg=float(np.degrees(FEATURE_ANGLE)),
        checksurfdist=near_surface,
        maxsurfdist=pymeshlab.PureValue(size / 4),
        splitflag=True,
        collapseflag=True,
        swapflag=True,
        smoothflag=True,
        reprojectflag=True,
    )


def _median_side(vertices: Floats, triangles: Integers) -> float:
    corners = vertices[triangles]
    return float(np.median(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2))) if len(triangles) else 0.0
