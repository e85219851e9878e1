"""A deviation inside the space of a sheet's own splines: its control points moved along their normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.nominal.nurbs import Nurbs
from inspect3d.virtual.deviation_field import together
from inspect3d.virtual.freeform import FreeformSizes, freeform_patch


@dataclass(frozen=True, eq=False)
class SplineField:
    """The deviation of a freeform sheet whose control points have moved along their normals.

    Parameters
    ----------
    sizes : of the sheet
    motions : (a b,) mm
    """

    sizes: FreeformSizes
    motions: Floats
    __add__ = together

    @classmethod
    def drawn(cls, sizes: FreeformSizes, size: float, seed: int) -> SplineField:
        """Return independent normal motions of a standard deviation, mm."""
        across, along = sizes.poles
        return cls(sizes, np.random.default_rng(seed).normal(0.0, size, across * along))

    def __call__(self, points_cad: Floats) -> Floats:
        """Return the deviation (n,) mm at points of the sheet, whose x and y are proportional to u and v."""
        patch = freeform_patch(self.sizes)
        nurbs = Nurbs(patch.poles[..., :3], patch.poles[..., 3], patch.knots_u, patch.knots_v)
        uv = np.clip(points_cad[:, :2] / [self.sizes.length, self.sizes.width], 0.0, 1.0)
        moved = nurbs.functions(uv) @ (self.motions[:, None] * nurbs.normals(nurbs.greville))
        return (moved * nurbs.normals(uv)).sum(axis=1)
