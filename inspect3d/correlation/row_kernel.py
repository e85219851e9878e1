"""Sums along rows: numba kernels whose order of summation is free, so that one instruction adds several numbers."""

from __future__ import annotations

import numpy as np
from numba import njit

from inspect3d.arrays import Floats


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def total(row: Floats, n: int) -> float:
    """Return the sum of the first n numbers."""
    found = 0.0
    for q in range(n):
        found += row[q]
    return found


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def product(row: Floats, other: Floats, n: int) -> float:
    """Return the scalar product of the first n numbers of two rows."""
    found = 0.0
    for q in range(n):
        found += row[q] * other[q]
    return found


@njit(cache=True, error_model="numpy")
def normalised(row: Floats, n: int) -> tuple[float, float]:
    """Bring the first n numbers to mean 0 and variance 1; return the mean and standard deviation they had."""
    mean = total(row, n) / n
    for q in range(n):
        row[q] -= mean
    spread = np.sqrt(product(row, row, n) / n)
    for q in range(n):
        row[q] /= spread
    return mean, spread
