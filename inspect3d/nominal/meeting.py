"""Where exact faces meet."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.nominal.brep import Brep

_STEPS = 8
_CLOSE = 1e-11
_PARALLEL = 0.1
"""Normals whose smallest singular value is below this share of the largest do not say where faces meet."""


def meeting(brep: Brep, points: Floats, faces: Integers, guess: Floats) -> Floats:
    """Return the parameters (n, k, 2), on each of k faces, of the points nearest to given ones where the faces meet.

    Newton's method: p goes to the nearest point of the planes that touch the faces at its feet f, N dp = N (f - p),
    where the rows of N are the normals; trimming is disregarded. Where the faces do not meet, the feet stay apart.

    Parameters
    ----------
    brep : the exact part
    points : (n, 3) mm, near all the faces
    faces : (n, k) numbers
    guess : (n, k, 2) parameters to start from
    """
    n, k = faces.shape
    at, uv = points, guess.reshape(-1, 2)
    for _ in range(_STEPS):
        feet, uv = brep.project(np.repeat(at, k, axis=0), faces.ravel(), uv)
        normals = brep.normals_at(faces.ravel(), uv).reshape(n, k, 3)
        height = np.einsum("nki,nki->nk", normals, feet.reshape(n, k, 3) - at[:, None])
        step = np.einsum("nik,nk->ni", np.linalg.pinv(normals, rcond=_PARALLEL), height)
        at = at + step
        if np.abs(step).max(initial=0.0) < _CLOSE:
            break
    return uv.reshape(n, k, 2)
