"""How fine the speckle of a picture is."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats

WINDOW = 512  # px
BROAD = 20.0  # px, standard deviation of what counts as light and not as speckle


def speckle_size(grey: Floats, places: Floats) -> float:
    """Return the width of the speckle's dots, px: that of the autocorrelation's peak at half its height; 0 without any.

    Parameters
    ----------
    grey : (rows, columns)
    places : (n, 2) px, where the part is seen; the speckle is looked at around their middle
    """
    import cv2

    middle = np.median(places, axis=0)
    left, top = np.clip(middle - WINDOW / 2, 0, np.maximum(np.array(grey.shape[::-1]) - WINDOW, 0)).astype(int)
    part = np.ascontiguousarray(grey[top : top + WINDOW, left : left + WINDOW], dtype=np.float64)
    part = part - cv2.GaussianBlur(part, (0, 0), BROAD)
    part -= part.mean()
    if not part.any():
        return 0.0
    padded = (2 * part.shape[0], 2 * part.shape[1])
    power = np.abs(np.fft.rfft2(part, padded)) ** 2
    correlation = np.fft.irfft2(power, padded)
    peak = (correlation[0, :] / correlation[0, 0], correlation[:, 0] / correlation[0, 0])
    return float(np.mean([2 * _half_width(line) for line in peak]))


def _half_width(line: Floats) -> float:
    """Return where a line that starts at one first falls to a half."""
    below = int(np.argmax(line < 0.5))
    if below == 0:
        return float(len(line))
    return below - 1 + float((line[below - 1] - 0.5) / (line[below - 1] - line[below]))
