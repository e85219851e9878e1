"""The lines by which one recognises the part in a photograph: its outline, its sharp edges and its rims."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.nominal.nominal import Nominal

SHARP = np.cos(np.radians(30.0))
LIFT = 1e-3  # of the diagonal


def outline(nominal: Nominal, view: View) -> Floats:
    """Return lines (k, 2, 2) px: the edges of the inspection mesh that are sharp, rims or the outline, where visible.

    An edge counts as visible if the way from its middle, lifted towards the camera, is free.
    """
    mesh = nominal.mesh
    corners = mesh.nodes[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    facing = ((view.centre - corners[:, 0]) * normals).sum(axis=1) > 0
    ends = np.sort(np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, which, counts = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(which.ravel(), kind="stable")
    first = np.cumsum(counts) - counts
    one = order[first] // 3
    other = order[first + np.minimum(counts, 2) - 1] // 3
    single = counts == 1
    sharp = np.einsum("ei,ei->e", normals[one], normals[other]) < SHARP
    shown = np.where(single, facing[one], (facing[one] != facing[other]) | (sharp & (facing[one] | facing[other])))
    places = mesh.nodes[edges[shown]]
    middle = places.mean(axis=1)
    sight = view.centre - middle
    away = np.linalg.norm(sight, axis=1, keepdims=True)
    lift = LIFT * nominal.diagonal
    near = np.where(facing[one[shown], None], normals[one[shown]], normals[other[shown]])
    hits = nominal.surface.first_hit(middle + lift * near, sight, away[:, 0])
    ahead = (view.depth(places.reshape(-1, 3)) > 0).reshape(-1, 2).all(axis=1)
    seen = places[(hits.triangle < 0) & ahead]
    return view.project(seen.reshape(-1, 3)).reshape(-1, 2, 2)
