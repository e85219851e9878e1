"""The closest point of one exact surface, from a guess."""

from __future__ import annotations

from typing import Any

import numpy as np

from inspect3d.arrays import Floats

_STEPS = 30
"""Steps at most; three are usual from the guess of a fine tessellation."""


def closest_parameters(surface: Any, points: Floats, guess: Floats) -> Floats:
    """Return the parameters (n, 2) of the points of a surface that are closest to points.

    Newton's method on |S(u, v) - p|² / 2 from the guess, for all points at once; Gauss-Newton where the Hessian is not
    positive definite (beyond a centre of curvature); a step that leads away from the point is halved.

    Parameters
    ----------
    surface : `BRepAdaptor_Surface`, S
    points : (n, 3) mm, p
    guess : (n, 2)
    """
    low, high = _bounds(surface)
    longest = 0.1 * np.array([_span(surface, "U"), _span(surface, "V")])
    best, uv = guess.copy(), guess.copy()
    nearest = np.full(len(points), np.inf)
    active = np.arange(len(points))
    for _ in range(_STEPS):
        at, s_u, s_v, s_uu, s_vv, s_uv = _second_order(surface, uv[active])
        r = at - points[active]
        distance = np.linalg.norm(r, axis=1)
        closer = distance < nearest[active]
        nearest[active] = np.where(closer, distance, nearest[active])
        best[active] = np.where(closer[:, None], uv[active], best[active])
        gradient = np.stack([_dot(r, s_u), _dot(r, s_v)], axis=1)
        e, f, g = _dot(s_u, s_u), _dot(s_u, s_v), _dot(s_v, s_v)
        a, b, c = e + _dot(r, s_uu), f + _dot(r, s_uv), g + _dot(r, s_vv)
        convex = (a > 0) & (a * c - b * b > 1e-12 * e * g)
        a, b, c = (np.where(convex, full, gauss) for full, gauss in ((a, e), (b, f), (c, g)))
        step = -_solved(a, b, c, gradient)
        step /= np.maximum(1.0, (np.abs(step) / longest).max(axis=1, keepdims=True))
        halfway = (uv[active] + best[active]) / 2
        moved = np.where(closer[:, None], np.clip(uv[active] + step, low, high), halfway)
        change = np.abs(moved - best[active])
        uv[active] = moved
        active = active[np.sqrt(e) * change[:, 0] + np.sqrt(g) * change[:, 1] > 1e-10]
        if not len(active):
            break
    return best


def _span(surface: Any, letter: str) -> float:
    first, last = (getattr(surface, f"{end}{letter}Parameter")() for end in ("First", "Last"))
    return min(last - first, 1e6)


def _bounds(surface: Any) -> tuple[Floats, Floats]:
    """Return the limits of the parameters, open where the surface closes on itself."""
    low = np.array([surface.FirstUParameter(), surface.FirstVParameter()])
    high = np.array([surface.LastUParameter(), surface.LastVParameter()])
    free = np.array([surface.IsUPeriodic(), surface.IsVPeriodic()])
    return np.where(free, -np.inf, low), np.where(free, np.inf, high)


def _second_order(surface: Any, uv: Floats) -> Floats:
    from OCP.gp import gp_Pnt, gp_Vec

    point = gp_Pnt()
    s_u, s_v, s_uu, s_vv, s_uv = (gp_Vec() for _ in range(5))
    rows = np.empty((len(uv), 18))
    for row, (u, v) in zip(rows, uv.tolist(), strict=True):
        surface.D2(u, v, point, s_u, s_v, s_uu, s_vv, s_uv)
        row[:] = point.Coord() + s_u.Coord() + s_v.Coord() + s_uu.Coord() + s_vv.Coord() + s_uv.Coord()
    return np.moveaxis(rows.reshape(-1, 6, 3), 1, 0)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.einsum("ij,ij->i", a, b)


def _solved(a: Floats, b: Floats, c: Floats, right: Floats) -> Floats:
    """Solve [[a, b], [b, c]] x = right; where that is singular (a pole), each unknown by itself."""
    determinant = a * c - b * b
    regular = determinant > 1e-14 * a * c
    safe = np.where(regular, determinant, 1.0)
    both = np.stack([c * right[:, 0] - b * right[:, 1], a * right[:, 1] - b * right[:, 0]], axis=1) / safe[:, None]
    diagonal = np.stack([a, c], axis=1)
    single = np.where(diagonal > 0, right / np.where(diagonal > 0, diagonal, 1.0), 0.0)
    return np.where(regular[:, None], both, single)
