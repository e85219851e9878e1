"""Points that can be found again in another picture, and what they look like."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats, Singles

LARGEST = 1_600_000  # px of a picture in which features are looked for; larger ones are reduced
MOST = 12_000  # features of a picture, the clearest
CONTRAST = 0.02  # least contrast of a feature, half of what D. Lowe takes: speckle is fine


@dataclass(frozen=True, eq=False)
class Features:
    """Features of one picture.

    Parameters
    ----------
    pixels : (n, 2) px
    looks : (n, 128), unit, how their surroundings look
    step : px of the picture per pixel of the reduced one they were found in
    """

    pixels: Floats
    looks: Singles
    step: float

    def __len__(self) -> int:
        """Return the number of features."""
        return len(self.pixels)


def features(grey: Floats, mask: Booleans | None) -> Features:
    """Return the SIFT features of a picture.

    Parameters
    ----------
    grey : (rows, columns) grey levels
    mask : (rows, columns), where to look, or None

    Notes
    -----
    D. G. Lowe, "Distinctive image features from scale-invariant keypoints", International Journal of Computer Vision
    60(2), 2004; compared by the roots of their histograms: R. Arandjelović, A. Zisserman, "Three things everyone should
    know to improve object retrieval", CVPR 2012.
    """
    import cv2

    rows, columns = grey.shape
    step = max(np.sqrt(grey.size / LARGEST), 1.0)
    size = (round(columns / step), round(rows / step))
    low, high = np.percentile(grey[::4, ::4], (0.5, 99.5))
    eight = np.clip(255 * (grey - low) / max(high - low, 1e-9), 0, 255).astype(np.uint8)
    allowed = np.ones(grey.shape, np.uint8) if mask is None else mask.astype(np.uint8)
    if step > 1:
        eight = np.asarray(cv2.resize(eight, size, interpolation=cv2.INTER_AREA), np.uint8)
        allowed = np.asarray(cv2.resize(allowed, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    keys, looks = cv2.SIFT.create(nfeatures=MOST, contrastThreshold=CONTRAST).detectAndCompute(eight, allowed)
    if not keys:
        return Features(np.zeros((0, 2)), np.zeros((0, 128), np.float32), step)
    ratio = np.array([columns / size[0], rows / size[1]])
    pixels = (np.array([key.pt for key in keys], dtype=np.float64) + 0.5) * ratio - 0.5
    roots = np.sqrt(looks / np.maximum(looks.sum(axis=1, keepdims=True), 1e-9))
    pixels, first = np.unique(pixels, axis=0, return_index=True)  # one place may have several orientations
    return Features(pixels, roots[first].astype(np.float32), step)
