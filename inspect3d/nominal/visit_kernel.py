"""The order in which to visit points so that neighbours follow each other: numba kernels over plain arrays."""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from inspect3d.arrays import Floats, Integers

CELLS = 256
DIGIT = 4096


@njit(cache=True)
def visiting_order(points: Floats, origin: Floats, size: float) -> Integers:
    """Return the numbers of points (n, 3) along a curve that keeps neighbours together.

    The curve runs through 256^3 cells of a cube of one and a half times `size` about the origin; points outside count
    to its outer cells. It is sorted by two passes of a radix sort, which takes a time in proportion to n.

    Notes
    -----
    G. M. Morton, "A computer oriented geodetic data base and a new technique in file sequencing", IBM, 1966: the number
    of a cell is made of the bits of its three coordinates in turn.
    """
    keys = _keys(points, origin, CELLS / (1.5 * size))
    order = _sorted_by(keys % DIGIT, np.arange(len(points)))
    return _sorted_by(keys // DIGIT, order)


@njit(cache=True, parallel=True)
def _keys(points: Floats, origin: Floats, scale: float) -> NDArray[np.int32]:
    keys = np.empty(len(points), dtype=np.int32)
    for i in prange(len(points)):
        key = 0
        for axis in range(3):
            place = (points[i, axis] - origin[axis]) * scale + CELLS / 2
            cell = int(min(max(place, 0.0), CELLS - 1.0))
            cell = (cell | (cell << 8)) & 0x00F00F
            cell = (cell | (cell << 4)) & 0x0C30C3
            cell = (cell | (cell << 2)) & 0x249249
            key |= cell << axis
        keys[i] = key
    return keys


@njit(cache=True)
def _sorted_by(digits: NDArray[np.int32], order: Integers) -> Integers:
    """Return the numbers in `order` sorted by their digits, equal ones as they were."""
    place = np.zeros(DIGIT + 1, dtype=np.int64)
    for digit in digits:
        place[digit + 1] += 1
    place = np.cumsum(place)
    result = np.empty_like(order)
    for i in order:
        result[place[digits[i]]] = i
        place[digits[i]] += 1
    return result
