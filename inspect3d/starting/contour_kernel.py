"""Kernel of the adjustment that adds what the outline asks of the cameras. Arrays only."""

from __future__ import annotations

import numpy as np
from numba import njit

from inspect3d.arrays import Floats, Integers
from inspect3d.starting.bundle_kernel import CHANGES, TURNING, write_slopes


@njit(cache=True, error_model="numpy")
def accumulate_outline(
    rig: tuple[Floats, Floats, Floats, Floats],
    origin: Floats,
    points: Floats,
    views: Integers,
    pixels: Floats,
    outward: Floats,
    sigma: float,
    normal: Floats,
    right: Floats,
) -> float:
    """Add the normal equations of points of the CAD that should appear on lines; return the cost.

    Parameters
    ----------
    rig : camera matrices (v, 3, 3), distortions (v, 5), rotations (v, 3, 3) and translations (v, 3)
    points : (n, 3) mm, held
    views, pixels, outward : (n,), (n, 2) px and (n, 2): the camera, a point of the line, and its unit normal
    sigma : px, standard uncertainty of a line's place
    normal, right : (16 v, 16 v) and (16 v,), added to
    """
    matrices, distortions, rotations, translations = rig
    pixel, by_point, by_view = np.empty(2), np.empty((2, 3)), np.empty((2, CHANGES))
    slope = np.empty(CHANGES)
    cost = 0.0
    for p in range(len(points)):
        k = views[p]
        depth = write_slopes(
            matrices[k], distortions[k], rotations[k], translations[k], origin, points[p], pixel, by_point, by_view
        )
        if not depth > 0.0:
            return np.inf
        miss = outward[p, 0] * (pixels[p, 0] - pixel[0]) + outward[p, 1] * (pixels[p, 1] - pixel[1])
        squared = (miss / sigma) ** 2
        cost += TURNING * squared / (TURNING + squared)
        weight = (TURNING / (TURNING + squared)) ** 2 / sigma**2
        first = CHANGES * k
        for i in range(CHANGES):
            slope[i] = outward[p, 0] * by_view[0, i] + outward[p, 1] * by_view[1, i]
        for i in range(CHANGES):
            right[first + i] += weight * slope[i] * miss
            for j in range(CHANGES):
                normal[first + i, first + j] += weight * slope[i] * slope[j]
    return cost
