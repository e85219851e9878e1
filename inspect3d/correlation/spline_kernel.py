"""From grey levels to the coefficients of the cubic B-spline through them: a numba kernel over plain arrays."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Singles

POLE = np.float32(np.sqrt(3.0) - 2.0)
GAIN = np.float32(6.0)
HORIZON = 14  # beyond that, powers of the pole are less than a rounding error
BAND = 128


@njit(cache=True, parallel=True, fastmath={"contract"})
def to_coefficients(picture: Singles) -> None:
    """Overwrite a picture (rows, columns) by its coefficients; beyond its borders it goes on as its mirror image.

    Notes
    -----
    M. Unser, A. Aldroubi, M. Eden, "B-spline signal processing: part II", IEEE Transactions on Signal Processing 41(2),
    1993: a recursive filter forwards and one backwards, along the columns and along the rows.
    """
    rows, columns = picture.shape
    for band in prange((columns + BAND - 1) // BAND):
        _filter(picture[:, band * BAND : (band + 1) * BAND])
    for band in prange((rows + BAND - 1) // BAND):
        turned = picture[band * BAND : (band + 1) * BAND].T.copy()
        _filter(turned)
        picture[band * BAND : (band + 1) * BAND] = turned.T


@njit(cache=True, fastmath={"contract"})
def _filter(lines: Singles) -> None:
    """Filter along the first axis; the lines (n, k) lie side by side, so that one instruction handles several."""
    n, width = lines.shape
    for j in range(width):
        first, power = lines[0, j], POLE
        for i in range(1, min(HORIZON, n)):
            first += power * lines[i, j]
            power *= POLE
        lines[0, j] = GAIN * first
    for i in range(1, n):
        for j in range(width):
            lines[i, j] = GAIN * lines[i, j] + POLE * lines[i - 1, j]
    for j in range(width):
        lines[n - 1, j] = POLE / (POLE * POLE - 1) * (lines[n - 1, j] + POLE * lines[n - 2, j])
    for i in range(n - 2, -1, -1):
        for j in range(width):
            lines[i, j] = POLE * (lines[i + 1, j] - lines[i, j])
