"""Readings of the deviation in a marked place: points of a cloud, or nodes of a map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.measure import FieldCovariance


@dataclass(frozen=True, eq=False)
class Readings:
    """Deviations at places on the part.

    Parameters
    ----------
    places : (k, 3) mm
    values : (k,) mm
    covariance : of the values, but for the pose
    pose : (k, p) mm, errors that the pose makes in all of them at once, a column for each independent one
    source : "points" or "nodes"
    spacing : mm, between neighbours
    reach : mm, over which a reading mixes what is around it; 0 for points
    """

    places: Floats
    values: Floats
    covariance: FieldCovariance
    pose: Floats
    source: str
    spacing: float
    reach: float

    def __len__(self) -> int:
        """Return their number."""
        return len(self.values)

    def along(self, across: Floats, origin: Floats) -> tuple[Floats, Floats]:
        """Return the coordinates (k,) mm of the readings along `across`, and square to it within the surface.

        Parameters
        ----------
        across : (3,)
        origin : (3,) mm
        """
        first = across / np.linalg.norm(across)
        offset = self.places - origin
        s = offset @ first
        rest = offset - s[:, None] * first
        second = np.linalg.svd(rest - rest.mean(axis=0), full_matrices=False)[2][0]
        return s, rest @ second
