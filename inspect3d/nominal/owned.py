"""Places where faces meet, on one of them, also where they gape."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.nominal.brep import Brep
from inspect3d.nominal.meeting import meeting

GAPE = 1e-8
"""Faces that gape by more than this, mm, leave doubt who owns the nodes between them."""


def owned(brep: Brep, faces: Integers, uv: Floats, elsewhere: Booleans) -> tuple[Floats, Integers, Floats]:
    """Return places on the common border of faces, and who owns them.

    Parameters
    ----------
    faces : (n, k) numbers, the one to prefer first
    uv : (n, k, 2) parameters of the border on each
    elsewhere : (n,) the edge or the vertex may be elsewhere than the borders

    Returns
    -------
    places (n, 3) mm, the numbers (n,) of the faces that own them, and how far the other faces are from them, (n,) mm
    """
    n, k = faces.shape
    border = brep.points_at(faces.ravel(), uv.reshape(-1, 2)).reshape(n, k, 3)
    points, face = border[:, 0].copy(), faces[:, 0].copy()
    apart = np.linalg.norm(border - border[:, :1], axis=2).max(axis=1)
    doubtful = np.flatnonzero(elsewhere | (apart > GAPE))
    met_uv = meeting(brep, border[doubtful].mean(axis=1), faces[doubtful], uv[doubtful])
    for row, met in zip(doubtful.tolist(), met_uv, strict=True):
        points[row], face[row], apart[row] = _between(brep, faces[row], border[row], uv[row], met)
    return points, face, apart


def _between(
    brep: Brep, faces: Integers, border: Floats, border_uv: Floats, met_uv: Floats
) -> tuple[Floats, int, float]:
    """Return the place (3,) between faces that gape that is nearest to all of them, its owner, and how near, mm.

    Parameters
    ----------
    faces : (k,) numbers, the one to prefer first
    border : (k, 3) mm, the common border on each
    border_uv, met_uv : (k, 2) parameters on each of the border and of the place where the surfaces meet
    """
    best, place, owner = np.inf, border[0], int(faces[0])
    for uv in (met_uv, border_uv):
        for which, number in enumerate(faces.tolist()):
            at = brep.held(number, uv[which])
            if at is None:
                continue
            feet, feet_uv = brep.project(np.tile(at, (len(faces), 1)), faces, uv)
            to_border = np.linalg.norm(border - at, axis=1)
            off = np.where(brep.inside(faces, feet_uv), np.linalg.norm(feet - at, axis=1), to_border)
            off[which] = 0.0
            if off.max() < best - GAPE:
                best, place, owner = float(off.max()), at, number
    return place, owner, best
