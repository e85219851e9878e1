"""Kernels of the adjustment: the normal equations of cameras and points, the points eliminated. Arrays only."""

from __future__ import annotations

import numpy as np
from numba import njit

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera_kernel import distort, in_camera, project_with_slope

CHANGES = 16  # of a view: a small motion of the part, and the lens, as in `inspect3d.correlation.freedom`
TURNING = 9.0  # squared normalised residual at which an observation has lost three quarters of its weight


@njit(cache=True)
def _weight(squared: float) -> float:
    """Return Geman and McClure's weight of a squared normalised residual."""
    return (TURNING / (TURNING + squared)) ** 2


@njit(cache=True)
def _cost(squared: float) -> float:
    return TURNING * squared / (TURNING + squared)


@njit(cache=True, error_model="numpy")
def write_slopes(
    matrix: Floats,
    distortion: Floats,
    rotation: Floats,
    translation: Floats,
    origin: Floats,
    point: Floats,
    pixel: Floats,
    by_point: Floats,
    by_view: Floats,
) -> float:
    """Write where a point appears (2,), the derivatives by it (2, 3) and by the view (2, 16); return its depth."""
    (px, py, depth), slope = project_with_slope(matrix, distortion, rotation, translation, point[0], point[1], point[2])
    pixel[0], pixel[1] = px, py
    for a in range(2):
        for b in range(3):
            by_point[a, b] = slope[3 * a + b]
    cx, cy, _ = in_camera(rotation, translation, point[0], point[1], point[2])
    x, y = cx / depth, cy / depth
    u, v, _, _, _ = distort(x, y, distortion)
    ax, ay, az = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    by_view[:] = 0.0
    for a in range(2):
        gx, gy, gz = by_point[a, 0], by_point[a, 1], by_point[a, 2]
        by_view[a, 0], by_view[a, 1], by_view[a, 2] = ay * gz - az * gy, az * gx - ax * gz, ax * gy - ay * gx
        by_view[a, 3], by_view[a, 4], by_view[a, 5] = gx, gy, gz
    by_view[0, 6], by_view[1, 7], by_view[0, 8], by_view[1, 9], by_view[0, 15] = u, v, 1.0, 1.0, v
    r = x * x + y * y
    for k in range(5):
        if k == 2:
            du, dv = 2.0 * x * y, r + 2.0 * y * y
        elif k == 3:
            du, dv = r + 2.0 * x * x, 2.0 * x * y
        else:
            power = r if k == 0 else (r * r if k == 1 else r * r * r)
            du, dv = power * x, power * y
        by_view[0, 10 + k] = matrix[0, 0] * du + matrix[0, 1] * dv
        by_view[1, 10 + k] = matrix[1, 1] * dv
    return depth


@njit(cache=True)
def _inverse(matrix: Floats, found: Floats) -> None:
    """Write the inverse of a symmetric positive definite matrix (3, 3)."""
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 1], matrix[1, 2], matrix[2, 2]
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    over = 1.0 / (a * p + b * q + c * r)
    found[0, 0], found[0, 1], found[0, 2] = p * over, q * over, r * over
    found[1, 0], found[1, 1], found[1, 2] = q * over, (a * f - c * c) * over, (b * c - a * e) * over
    found[2, 0], found[2, 1], found[2, 2] = r * over, (b * c - a * e) * over, (a * d - b * b) * over


@njit(cache=True, error_model="numpy")
def accumulate(
    rig: tuple[Floats, Floats, Floats, Floats],
    origin: Floats,
    points: Floats,
    pixels: Floats,
    seen: Booleans,
    noise: float,
    planes: tuple[Floats, Floats],
    sigma: float,
    damping: float,
    normal: Floats,
    right: Floats,
    own: Floats,
    folded: Floats,
) -> float:
    """Add up the normal equations of the views with the points eliminated; return the cost.

    Parameters
    ----------
    rig : camera matrices (v, 3, 3), distortions (v, 5), rotations (v, 3, 3) and translations (v, 3)
    planes : feet and normals (n, 3) of the planes the points should lie on; normals of zero ask nothing
    sigma : mm, how far points may be off their planes
    damping : of the points, as a share of the mean of their diagonal
    normal, right : (16 v, 16 v) and (16 v,), zero before
    own, folded : (n, 3) and (n, 3, 16 v), zero before: a step s of the views moves point k by own[k] - folded[k] s
    """
    matrices, distortions, rotations, translations = rig
    feet, normals = planes
    views = len(matrices)
    pixel, by_point, by_view = np.empty(2), np.empty((2, 3)), np.empty((2, CHANGES))
    block, inverse, pull = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    between = np.empty((3, CHANGES * views))
    cost = 0.0
    for p in range(len(points)):
        block[:], pull[:], between[:] = 0.0, 0.0, 0.0
        for k in range(views):
            if not seen[p, k]:
                continue
            depth = write_slopes(
                matrices[k], distortions[k], rotations[k], translations[k], origin, points[p], pixel, by_point, by_view
            )
            if not depth > 0.0:
                return np.inf
            miss_x, miss_y = pixels[p, k, 0] - pixel[0], pixels[p, k, 1] - pixel[1]
            squared = (miss_x * miss_x + miss_y * miss_y) / noise**2
            cost += _cost(squared)
            weight = _weight(squared) / noise**2
            first = CHANGES * k
            for i in range(CHANGES):
                right[first + i] += weight * (by_view[0, i] * miss_x + by_view[1, i] * miss_y)
                for j in range(CHANGES):
                    normal[first + i, first + j] += weight * (
                        by_view[0, i] * by_view[0, j] + by_view[1, i] * by_view[1, j]
                    )
            for a in range(3):
                pull[a] += weight * (by_point[0, a] * miss_x + by_point[1, a] * miss_y)
                for b in range(3):
                    block[a, b] += weight * (by_point[0, a] * by_point[0, b] + by_point[1, a] * by_point[1, b])
                for i in range(CHANGES):
                    between[a, first + i] += weight * (by_point[0, a] * by_view[0, i] + by_point[1, a] * by_view[1, i])
        away, asked = 0.0, 0.0
        for a in range(3):
            away += (points[p, a] - feet[p, a]) * normals[p, a]
            asked += normals[p, a] * normals[p, a]
        if asked > 0.0:
            squared = (away / sigma) ** 2
            cost += _cost(squared)
            weight = _weight(squared) / sigma**2
            for a in range(3):
                pull[a] -= weight * away * normals[p, a]
                for b in range(3):
                    block[a, b] += weight * normals[p, a] * normals[p, b]
        firm = (damping + 1e-9) * (block[0, 0] + block[1, 1] + block[2, 2])
        for a in range(3):
            block[a, a] += firm
        _inverse(block, inverse)
        for a in range(3):
            own[p, a] = inverse[a, 0] * pull[0] + inverse[a, 1] * pull[1] + inverse[a, 2] * pull[2]
            for i in range(CHANGES * views):
                folded[p, a, i] = (
                    inverse[a, 0] * between[0, i] + inverse[a, 1] * between[1, i] + inverse[a, 2] * between[2, i]
                )
        for i in range(CHANGES * views):
            b0, b1, b2 = between[0, i], between[1, i], between[2, i]
            if b0 == 0.0 and b1 == 0.0 and b2 == 0.0:
                continue
            right[i] -= b0 * own[p, 0] + b1 * own[p, 1] + b2 * own[p, 2]
            for j in range(CHANGES * views):
                normal[i, j] -= b0 * folded[p, 0, j] + b1 * folded[p, 1, j] + b2 * folded[p, 2, j]
    return cost


@njit(cache=True, error_model="numpy")
def settle(
    rig: tuple[Floats, Floats, Floats, Floats], pixels: Floats, seen: Booleans, noise: float, steps: int, points: Floats
) -> None:
    """Move points (n, 3) in place to where they appear nearest to where they were found, views held: Gauss-Newton."""
    matrices, distortions, rotations, translations = rig
    pixel, by_point, by_view = np.empty(2), np.empty((2, 3)), np.empty((2, CHANGES))
    block, inverse, pull, origin = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.zeros(3)
    for p in range(len(points)):
        for _ in range(steps):
            block[:], pull[:] = 0.0, 0.0
            ahead = True
            for k in range(len(matrices)):
                if not seen[p, k]:
                    continue
                depth = write_slopes(
                    matrices[k], distortions[k], rotations[k], translations[k], origin, points[p],
                    pixel, by_point, by_view,
                )  # fmt: skip
                if not depth > 0.0:
                    ahead = False
                    break
                miss_x, miss_y = pixels[p, k, 0] - pixel[0], pixels[p, k, 1] - pixel[1]
                weight = _weight((miss_x * miss_x + miss_y * miss_y) / (100.0 * noise**2))
                for a in range(3):
                    pull[a] += weight * (by_point[0, a] * miss_x + by_point[1, a] * miss_y)
                    for b in range(3):
                        block[a, b] += weight * (by_point[0, a] * by_point[0, b] + by_point[1, a] * by_point[1, b])
            if not ahead:
                break
            firm = 1e-9 * (block[0, 0] + block[1, 1] + block[2, 2])
            for a in range(3):
                block[a, a] += firm
            _inverse(block, inverse)
            largest = 0.0
            for a in range(3):
                move = inverse[a, 0] * pull[0] + inverse[a, 1] * pull[1] + inverse[a, 2] * pull[2]
                points[p, a] += move
                largest = max(largest, abs(move))
            if largest < 1e-9:
                break
