"""What is seen in a picture, and where points of the part lie in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats

GRAZING = 0.1
"""Cosine between normal and direction to the eye below which a surface is too foreshortened to be seen."""


@dataclass(frozen=True, eq=False)
class Sight:
    """A parallel projection, with the distance of what is seen in each pixel.

    Parameters
    ----------
    nearness : (height, width) mm, towards the eye from the centre; NaN beside the part
    axes : (3, 3) rows right, up and towards the eye
    centre : (3,) mm, the point in the middle
    pixel : mm per pixel
    """

    nearness: Floats
    axes: Floats
    centre: Floats
    pixel: float

    def pixels(self, points: Floats) -> Floats:
        """Return where points (n, 3) mm lie, (n, 2) px right and down from the centre of the top left pixel."""
        height, width = self.nearness.shape
        right, up, _ = self.axes @ (points - self.centre).T / self.pixel
        return np.column_stack([width / 2 - 0.5 + right, height / 2 - 0.5 - up])

    def sees(self, points: Floats, normals: Floats) -> Booleans:
        """Tell which points (n, 3) mm of the surface face the eye and are not hidden, (n,)."""
        height, width = self.nearness.shape
        column, row = np.round(self.pixels(points)).astype(np.int64).T
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        cosine = normals @ self.axes[2]
        slope = np.sqrt(1 / np.clip(cosine, GRAZING, 1.0) ** 2 - 1)
        nearness = (points - self.centre) @ self.axes[2]
        foremost = self.nearness[row.clip(0, height - 1), column.clip(0, width - 1)]
        return inside & (cosine > GRAZING) & ~(nearness < foremost - self.pixel * (2 + 2 * slope))
