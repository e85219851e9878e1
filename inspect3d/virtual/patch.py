"""A rational B-spline surface, evaluated exactly at many points at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats, Integers, floats, unit


@dataclass(frozen=True, eq=False)
class Patch:
    """A NURBS surface S(u, v), oriented out of the material; planes, cylinders and tori have this form exactly.

    Parameters
    ----------
    poles : (a, b, 4), homogeneous control points (w x, w y, w z, w), mm
    knots_u : (a + p + 1,), clamped knots of degree p, repeated by their multiplicity
    knots_v : (b + q + 1,)
    reversed : the outward normal is dS/dv x dS/du, not dS/du x dS/dv

    Notes
    -----
    L. Piegl, W. Tiller, The NURBS Book, 1997: algorithms A2.2 (basis functions) and A4.4 (rational derivatives).
    """

    poles: Floats
    knots_u: Floats
    knots_v: Floats
    reversed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "poles", floats(self.poles, "poles", None, None, 4))
        object.__setattr__(self, "knots_u", floats(self.knots_u, "knots_u", None))
        object.__setattr__(self, "knots_v", floats(self.knots_v, "knots_v", None))

    def __call__(self, parameters: Floats) -> tuple[Floats, Floats]:
        """Return the points (n, 3) mm of parameters (n, 2), and their outward unit normals (n, 3)."""
        points, along_u, along_v = self.derivatives(parameters)
        normals = unit(np.cross(along_u, along_v))
        return points, -normals if self.reversed else normals

    def derivatives(self, parameters: Floats) -> tuple[Floats, Floats, Floats]:
        """Return S, dS/du and dS/dv, (n, 3) each, at parameters (n, 2)."""
        count_u, count_v, _ = self.poles.shape
        first_u, basis_u, slope_u = _basis(self.knots_u, count_u, parameters[:, 0])
        first_v, basis_v, slope_v = _basis(self.knots_v, count_v, parameters[:, 1])
        value = np.zeros((3, len(parameters), 4))
        for i in range(len(basis_u)):
            for j in range(len(basis_v)):
                pole = self.poles[first_u + i, first_v + j]
                value[0] += (basis_u[i] * basis_v[j])[:, None] * pole
                value[1] += (slope_u[i] * basis_v[j])[:, None] * pole
                value[2] += (basis_u[i] * slope_v[j])[:, None] * pole
        weight = value[0, :, 3:]
        points = value[0, :, :3] / weight
        along_u, along_v = ((value[k, :, :3] - points * value[k, :, 3:]) / weight for k in (1, 2))
        return points, along_u, along_v


def _basis(knots: Floats, count: int, at: Floats) -> tuple[Integers, Floats, Floats]:
    """Return the first pole that acts at each parameter, the p + 1 basis functions there, and their slopes."""
    degree = len(knots) - count - 1
    span = np.clip(np.searchsorted(knots, at, side="right") - 1, degree, count - 1)
    values = np.ones((1, len(at)))
    for order in range(1, degree + 1):
        lower = values
        values = np.zeros((order + 1, len(at)))
        slopes = np.zeros((order + 1, len(at)))
        for r in range(order):
            left, right = knots[span + 1 + r - order], knots[span + 1 + r]
            share = lower[r] / (right - left)
            values[r] += (right - at) * share
            values[r + 1] += (at - left) * share
            slopes[r] -= order * share
            slopes[r + 1] += order * share
    return span - degree, values, slopes
