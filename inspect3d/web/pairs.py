"""The pairs a page sends: a point of the CAD, and where the measurement shows it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.outcome import InputError

MOST = 500
"""Pairs anybody picks."""
MOST_SIZE = 1e12
"""mm or px, of a coordinate."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Complete pairs.

    Parameters
    ----------
    numbers : (n,) their places among all pairs of the page
    names : what the user calls them
    cad : (n, 3) mm
    shown : (n, v, d): pixels (d = 2) in v pictures, or one point (d = 3, v = 1) of a cloud, mm
    """

    numbers: tuple[int, ...]
    names: tuple[str, ...]
    cad: Floats
    shown: Floats

    def __len__(self) -> int:
        """Return the number of complete pairs."""
        return len(self.numbers)


def pairs_of(body: Any, places: int, dimension: int) -> Pairs:
    """Return the complete ones of the pairs { name, cad, shown } that a page sends, with None for what is missing.

    Raises
    ------
    InputError
        It sent something else.
    """
    rows = body.get("pairs") if isinstance(body, dict) else None
    if not (isinstance(rows, list) and len(rows) <= MOST and all(isinstance(row, dict) for row in rows)):
        raise InputError("The page sent no pairs.")
    numbers, names, cad, shown = [], [], [], []
    for number, row in enumerate(rows):
        point, places_shown = row.get("cad"), row.get("shown")
        if not isinstance(places_shown, list) or len(places_shown) != places:
            raise InputError("The page sent a pair for another measurement.")
        if point is None or any(place is None for place in places_shown):
            continue
        numbers.append(number)
        names.append(str(row.get("name", "")).strip()[:100])
        cad.append(_numbers(point, 3))
        shown.append([_numbers(place, dimension) for place in places_shown])
    n = len(numbers)
    arrays = np.array(cad, float).reshape(n, 3), np.array(shown, float).reshape(n, places, dimension)
    return Pairs(tuple(numbers), tuple(names), *arrays)


def _numbers(value: Any, count: int) -> list[float]:
    if not (isinstance(value, list) and len(value) == count and all(map(is_number, value))):
        raise InputError("The page sent a pair that is not made of numbers.")
    return [float(each) for each in value]


def is_number(value: Any) -> bool:
    """Tell whether what a page sent is a finite number, of a size that a coordinate may have."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < MOST_SIZE
