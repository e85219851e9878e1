"""Motions that bring a CAD model onto itself."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.nominal.surface import Surface
from inspect3d.pose import Pose

TOLERANCE = 2e-3  # share of the diagonal within which a symmetry brings the surface onto itself


def surface_points(surface: Surface, count: int, seed: int = 0) -> tuple[Floats, Floats]:
    """Return points spread at random over the surface and the face normals there, (count, 3) each."""
    random = np.random.default_rng(seed)
    triangle = random.choice(len(surface.triangles), count, p=surface.areas / surface.areas.sum())
    share = random.random((count, 2))
    share = np.where(share.sum(axis=1, keepdims=True) > 1, 1 - share, share)
    a, b, c = (surface.vertices[surface.triangles[triangle, k]] for k in range(3))
    return a + share[:, :1] * (b - a) + share[:, 1:] * (c - a), surface.face_normals[triangle]


def is_symmetry(surface: Surface, motion: Pose, count: int = 3000) -> bool:
    """Tell whether the motion brings the surface onto itself, both ways, within 0.2 % of its diagonal."""
    points, normals = surface_points(surface, count)
    for there in (motion, motion.inverse()):
        feet = surface.closest(there(points))
        same_side = np.einsum("ni,ni->n", there.turned(normals), feet.normals) > 0.5
        near = np.abs(feet.distance) < TOLERANCE * surface.diagonal
        if np.mean(near & same_side) < 0.98 or np.mean(near) < 0.995:
            return False
    return True
