"""A grid around the CAD that knows the nearest surface at every cell: a lookup in place of a search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.nominal.surface import Surface


@dataclass(frozen=True, eq=False)
class Field:
    """Foot and normal of the nominal surface at the centres of a regular grid.

    Parameters
    ----------
    origin : (3,) mm, centre of the first cell
    step : edge of a cell, mm
    feet : (nx, ny, nz, 3) mm, closest point of the surface
    normals : (nx, ny, nz, 3), unit, out of the material, at the foot
    """

    origin: Floats
    step: float
    feet: Floats
    normals: Floats

    @classmethod
    def of(cls, surface: Surface, cells: int = 300_000, margin: float = 0.1) -> Field:
        """Return the field of a surface on about so many cubic cells, its box grown by a share of the diagonal."""
        low, high = surface.bounds
        low, high = low - margin * surface.diagonal, high + margin * surface.diagonal
        step = float((np.prod(high - low) / cells) ** (1 / 3))
        counts = np.ceil((high - low) / step).astype(int) + 1
        axes = [low[k] + step * np.arange(counts[k]) for k in range(3)]
        centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        feet = surface.closest(centres.reshape(-1, 3))
        return cls(low, step, feet.points.reshape(centres.shape), feet.normals.reshape(centres.shape))
