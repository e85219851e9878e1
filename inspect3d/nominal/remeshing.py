"""Quasi-uniform triangles in place of any others."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats, Integers

FEATURE_ANGLE = np.radians(30.0)
"""Facets farther apart than this meet in a sharp edge, rad."""


def remeshed(vertices: Floats, triangles: Integers, size: float, rounds: int = 10) -> tuple[Floats, Integers]:
    """Return vertices (k, 3) mm and triangles (l, 3) of about the asked edge length that keep sharp edges and rims.

    The vertices lie near the given surface, not on it: whoever knows the exact surface puts them there.

    Parameters
    ----------
    vertices : (n, 3) mm, shared by the triangles around them
    triangles : (m, 3)
    size : wanted edge length, mm
    rounds : of splitting, collapsing, swapping and smoothing

    Notes
    -----
    Isotropic explicit remeshing of MeshLab: H. Hoppe et al., Mesh Optimization, SIGGRAPH 1993; M. Botsch and L. Kobbelt, A Remeshing
    Approach to Multiresolution Modeling, SGP 2004.
    """
    import pymeshlab

    centre = vertices.mean(axis=0)
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=vertices - centre, face_matrix=triangles.astype(np.int32)))
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=rounds,
        targetlen=pymeshlab.PureValue(size),
        featuredeg=float(np.degrees(FEATURE_ANGLE)),
        checksurfdist=True,
        maxsurfdist=pymeshlab.PureValue(size / 4),
    )
    meshes.meshing_remove_duplicate_faces()
    meshes.meshing_remove_null_faces()
    meshes.meshing_remove_unreferenced_vertices()
    result = meshes.current_mesh()
    return result.vertex_matrix() + centre, result.face_matrix().astype(np.int64)
