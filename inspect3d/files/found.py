"""What a reader finds in a file, before it is checked and cleaned."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers

_FARTHEST = 1e18


def _none() -> Integers:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Found:
    """Points, and the polygons between them, as a file states them; nothing is dropped yet.

    Parameters
    ----------
    points : (n, 3) file units; not finite where an organised cloud has no point
    normals : (n, 3) of any length, or None
    corners : (k,) the points around each polygon, one polygon after the other; not checked
    sizes : (m,) the number of corners of each polygon
    parts : the number of points of each station, where the file holds several; empty where it does not say
    units : where the format fixes the unit: mm, cm, m, um, inch, or a name such as ft; else None
    remarks : what was done to the data that the report must say, a sentence each
    """

    points: Floats
    normals: Floats | None = None
    corners: Integers = field(default_factory=_none)
    sizes: Integers = field(default_factory=_none)
    parts: tuple[int, ...] = ()
    units: str | None = None
    remarks: tuple[str, ...] = ()

    @property
    def finite(self) -> Booleans:
        """Tell which points have coordinates (n,); some programs write the largest number they have for none."""
        return np.asarray((np.abs(self.points) < _FARTHEST).all(axis=1))
