"""A smooth freeform part: one B-spline face, an open sheet as a camera sees it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.virtual.part import Part
from inspect3d.virtual.patch import Patch


@dataclass(frozen=True)
class FreeformSizes:
    """The sizes of the freeform part, mm: the sheet covers 0 to `length` in x and 0 to `width` in y, normals up.

    `relief` is the height between its lowest and its highest point; `poles` counts control points along x and y, and
    `degrees` are those of the B-spline along them.
    """

    length: float = 104.0
    width: float = 84.0
    relief: float = 9.0
    poles: tuple[int, int] = (10, 8)
    degrees: tuple[int, int] = (3, 3)


def freeform(sizes: FreeformSizes | None = None) -> Part:
    """Return the freeform sheet, by default 104 x 84 mm with 9 mm relief; no symmetry."""
    chosen = sizes or FreeformSizes()
    return Part("freeform", lambda: _shape(chosen))


def freeform_patch(sizes: FreeformSizes) -> Patch:
    """Return the sheet as a B-spline with (u, v) in the unit square; x and y are proportional to u and v."""
    across, along = sizes.poles
    p, q = sizes.degrees
    knots_u, knots_v = _knots(across, p), _knots(along, q)
    u, v = np.meshgrid(_greville(knots_u, p), _greville(knots_v, q), indexing="ij")
    x, y = sizes.length * u, sizes.width * v
    waves = np.sin(4.1 * u + 0.6) * np.cos(3.3 * v - 0.4) + 0.55 * np.sin(5.0 * v + 2.2 * u) + 0.5 * u * v
    height = waves + 0.8 * np.exp(-((u - 0.68) ** 2 + (v - 0.35) ** 2) / 0.05)

    grid = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 401)] * 2), axis=-1).reshape(-1, 2)
    rough = Patch(np.stack([x, y, height, np.ones_like(x)], axis=-1), knots_u, knots_v)(grid)[0][:, 2]
    height = (height - rough.min()) * sizes.relief / np.ptp(rough)
    return Patch(np.stack([x, y, height, np.ones_like(x)], axis=-1), knots_u, knots_v)


def _knots(count: int, degree: int) -> Floats:
    inner = np.linspace(0.0, 1.0, count - degree + 1)
    return np.concatenate([np.zeros(degree), inner, np.ones(degree)])


def _greville(knots: Floats, degree: int) -> Floats:
    """Return the parameters at which control points make the map linear."""
    return np.array([knots[i + 1 : i + 1 + degree].mean() for i in range(len(knots) - degree - 1)])


def _shape(sizes: FreeformSizes) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array2OfPnt
    from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

    patch = freeform_patch(sizes)
    across, along = sizes.poles
    poles = TColgp_Array2OfPnt(1, across, 1, along)
    for i in range(across):
        for j in range(along):
            poles.SetValue(i + 1, j + 1, gp_Pnt(*map(float, patch.poles[i, j, :3])))
    arguments = []
    for knots in (patch.knots_u, patch.knots_v):
        distinct, times = np.unique(knots, return_counts=True)
        values, counts = TColStd_Array1OfReal(1, len(distinct)), TColStd_Array1OfInteger(1, len(distinct))
        for k, (knot, count) in enumerate(zip(distinct, times, strict=True), start=1):
            values.SetValue(k, float(knot))
            counts.SetValue(k, int(count))
        arguments.append((values, counts))
    (values_u, counts_u), (values_v, counts_v) = arguments
    surface = Geom_BSplineSurface(poles, values_u, values_v, counts_u, counts_v, *sizes.degrees, False, False)
    return BRepBuilderAPI_MakeFace(surface, 1e-7).Face()
