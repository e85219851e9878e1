"""Facets in four: a finer mesh where the elements do not follow the part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inspect3d.arrays import Integers, unit
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.remeshing import FEATURE_ANGLE


def quartered(nominal: Nominal) -> tuple[Nominal, Integers]:
    """Return the part with each facet cut in four, and of each node (n, 2) the ends of the edge that it halves.

    Nodes of before keep their numbers, and are both ends themselves. New ones lie on the nominal surface, with the mean
    of the normals at both ends; where these are too far apart for one face, or on a crease, it is one.
    """
    mesh = nominal.mesh
    n, count = len(mesh), len(mesh.triangles)
    sides = np.sort(np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    keys, new = np.unique(sides @ [n, 1], return_inverse=True)
    ends = np.column_stack(np.divmod(keys, n))
    feet = nominal.surface.closest(mesh.nodes[ends].mean(axis=1))
    one, other = (mesh.normals[ends[:, k]] for k in (0, 1))
    apart = (one * other).sum(axis=1) < np.cos(FEATURE_ANGLE)
    face = np.full(len(ends), -1) if nominal.surface_face is None else nominal.surface_face[feet.triangle]
    middle = n + new.reshape(count, 3)
    a, b, c = mesh.triangles.T
    ab, bc, ca = middle.T
    parts = [np.stack(corners, axis=1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    finer = InspectionMesh(
        np.vstack([mesh.nodes, feet.points]),
        np.stack(parts, axis=1).reshape(-1, 3),
        np.vstack([mesh.normals, np.where(apart[:, None], feet.normals, unit(one + other))]),
        np.concatenate([mesh.crease, apart | mesh.crease[ends].all(axis=1)]),
        np.concatenate([mesh.face, face]),
    )
    return replace(nominal, mesh=finer), np.vstack([np.repeat(np.arange(n), 2).reshape(-1, 2), ends])
