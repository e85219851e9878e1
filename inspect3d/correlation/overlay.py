"""A photograph with the CAD's edges over it, small enough for a report."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.correlation.outline import outline
from inspect3d.figure import Photograph
from inspect3d.nominal.nominal import Nominal

WIDEST = 800  # px of a picture in the report
FINEST = 3  # px of a photograph in one of its residual map's


def overlay(
    name: str, words: str, nominal: Nominal, view: View, small: tuple[NDArray[np.uint8], float], marks: Floats
) -> Photograph:
    """Return a photograph, reduced by `reduced`, with the edges and the outline of the CAD and marked places (m, 2)."""
    return Photograph(name, words, small[0], small[1], outline(nominal, view), marks)


def reduced(grey: Floats) -> tuple[NDArray[np.uint8], float]:
    """Return a picture small enough for the report, 8 bit, and how many of its pixels go into one."""
    import cv2

    scale = max(FINEST, int(np.ceil(grey.shape[1] / WIDEST)))
    size = (max(grey.shape[1] // scale, 1), max(grey.shape[0] // scale, 1))
    small = cv2.resize(
        grey[: size[1] * scale, : size[0] * scale].astype(np.float32), size, interpolation=cv2.INTER_AREA
    )
    low, high = np.percentile(small, (0.5, 99.5))
    return np.clip(255 * (small - low) / max(high - low, 1e-9), 0, 255).astype(np.uint8), float(scale)
