"""Which pairs of lines of sight obey one epipolar geometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats, floats

CERTAIN = 0.9999


@dataclass(frozen=True, eq=False)
class Epipolar:
    """An essential matrix, (3, 3), and the pairs that obey it, (n,)."""

    essential: Floats
    good: Booleans


def epipolar(one: Floats, other: Floats, reach: float) -> Epipolar | None:
    """Return the epipolar geometry that most pairs of rays (n, 2) obey within `reach`; None where there is none.

    By five points, which a flat part determines as well; D. Nistér, "An efficient solution to the five-point relative
    pose problem", IEEE PAMI 26(6), 2004. OpenCV refuses some pairs that have nothing in common with an error.
    """
    import cv2

    try:
        essential, good = cv2.findEssentialMat(one, other, np.eye(3), cv2.USAC_ACCURATE, CERTAIN, reach)
    except cv2.error:
        return None
    if essential is None or essential.shape != (3, 3) or good is None:
        return None
    return Epipolar(floats(essential, "essential", 3, 3), good.ravel().astype(bool))
