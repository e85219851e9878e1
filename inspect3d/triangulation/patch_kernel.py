"""Patches of the surface moved until all photographs agree on them: a numba kernel, arrays only.

A patch is a small square of the surface around a point, `2 half + 1` samples along each side. Its height along the
normal, its two slopes and its three curvatures are fitted by Gauss-Newton: z_k, the grey levels that view k shows
there, of zero mean and unit deviation, are to equal their mean T over the views. If the patch stands wrong by h, view k
sees the texture shifted by d_k h over the patch, d_k being the motion of its picture by a unit of height, carried back
onto the patch. With e_k = d_k - mean d and f = (1, i, j, i², i j, j²) for the unknowns,

    N = sum (grad T . e_k)² f f',    N x = - sum (grad T . e_k) f z_k,    cov x = s² N⁻¹

Since the e_k sum to zero, T itself drops out of the right side, and its noise with it. What no model explains, as
errors of the interpolation, shifts each picture by some tau of a hundredth of a pixel: that adds tau² / sum |e_k|² to
the variance of the height.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Booleans, Floats, Integers, Singles
from inspect3d.camera_kernel import project_with_slope
from inspect3d.correlation.sampling_kernel import sample_cubic
from inspect3d.register.search_kernel import solve_spd

Pictures = tuple[Singles, Integers]
Cameras = tuple[Floats, Floats, Floats, Floats]
Seen = tuple[Floats, Floats, Floats]
Settings = tuple[int, float, int, float, float, float]

STEEPEST = 0.35  # largest slope that a patch may take on
STILL = 0.003  # px, a step in the pictures below which a patch rests
INTERPOLATED = 1.0 / 0.76  # variance of a pixel over that of a cubic B-spline between pixels, on average
FEWEST = 2
UNKNOWNS = 6


@njit(cache=True)
def _read(
    k: int,
    at: Floats,
    normal: Floats,
    across: Floats,
    along: Floats,
    bend: Floats,
    half: int,
    steepest: float,
    pictures: Pictures,
    cameras: Cameras,
    seen: Seen,
) -> bool:
    """Write what view k shows of a patch: grey levels (n,), their gradient over it (n, 2), and d_k (2,).

    Returns False where the view does not show the whole patch, or too much from the side.
    """
    rotation, translation, levels = cameras[2][k], cameras[3][k], pictures[0][k]
    width, height = pictures[1][k, 0], pictures[1][k, 1]
    grey, gradient, shift = seen[0][k], seen[1][k], seen[2][k]
    (x, y, depth), s = project_with_slope(cameras[0][k], cameras[1][k], rotation, translation, at[0], at[1], at[2])
    facing = 0.0
    length = 0.0
    for a in range(3):
        ray = -at[a]
        for b in range(3):
            ray -= rotation[b, a] * translation[b]
        facing += ray * normal[a]
        length += ray * ray
    if depth <= 0.0 or facing < steepest * math.sqrt(length):
        return False
    xi = s[0] * across[0] + s[1] * across[1] + s[2] * across[2]
    yi = s[3] * across[0] + s[4] * across[1] + s[5] * across[2]
    xj = s[0] * along[0] + s[1] * along[1] + s[2] * along[2]
    yj = s[3] * along[0] + s[4] * along[1] + s[5] * along[2]
    xh = s[0] * normal[0] + s[1] * normal[1] + s[2] * normal[2]
    yh = s[3] * normal[0] + s[4] * normal[1] + s[5] * normal[2]
    wide = half * (abs(xi) + abs(xj)) + 2.0
    high = half * (abs(yi) + abs(yj)) + 2.0
    if x < wide or y < high or x > width - 1 - wide or y > height - 1 - high:
        return False
    determinant = xi * yj - xj * yi
    if abs(determinant) < 1e-9:
        return False
    shift[0] = (yj * xh - xj * yh) / determinant
    shift[1] = (xi * yh - yi * xh) / determinant
    n = 0
    mean = 0.0
    for i in range(-half, half + 1):
        for j in range(-half, half + 1):
            rise = i * i * bend[0] + i * j * bend[1] + j * j * bend[2]
            u, v = x + i * xi + j * xj + rise * xh, y + i * yi + j * yj + rise * yh
            value, gx, gy = sample_cubic(levels, width, height, u, v)
            grey[n] = value
            gradient[n, 0] = gx * xi + gy * yi
            gradient[n, 1] = gx * xj + gy * yj
            mean += value
            n += 1
    mean /= n
    square = 0.0
    for m in range(n):
        grey[m] -= mean
        square += grey[m] * grey[m]
    deviation = math.sqrt(square / n)
    if deviation < 1e-6:
        return False
    for m in range(n):
        grey[m] /= deviation
        gradient[m, 0] /= deviation
        gradient[m, 1] /= deviation
    return True


@njit(cache=True)
def _fit(
    point: Floats,
    normal: Floats,
    pitch: float,
    allowed: Booleans,
    settings: Settings,
    pictures: Pictures,
    cameras: Cameras,
    found: Floats,
) -> bool:
    """Fit one patch in place; write its variance of the height (mm²), its likeness and its number of views."""
    half, reach, steps, like, steepest, systematic = settings
    views = len(allowed)
    n = (2 * half + 1) ** 2
    grey, gradient, shift = np.empty((views, n)), np.empty((views, n, 2)), np.empty((views, 2))
    seen, mean, slope = np.empty(views, np.bool_), np.empty(n), np.empty((n, 2))
    helper, across, along, at = np.zeros(3), np.empty(3), np.empty(3), np.empty(3)
    weight, pull, basis = np.empty(n), np.empty(n), np.ones(UNKNOWNS)
    smallest = 0
    for a in range(3):
        if abs(normal[a]) < abs(normal[smallest]):
            smallest = a
    helper[smallest] = 1.0
    for a in range(3):
        across[a] = helper[(a + 1) % 3] * normal[(a + 2) % 3] - helper[(a + 2) % 3] * normal[(a + 1) % 3]
    norm = math.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
    for a in range(3):
        across[a] *= pitch / norm
    for a in range(3):
        along[a] = normal[(a + 1) % 3] * across[(a + 2) % 3] - normal[(a + 2) % 3] * across[(a + 1) % 3]
    up = normal.copy()
    h, p, q, bend = 0.0, 0.0, 0.0, np.zeros(3)
    taking, likeness, variance = 0, 0.0, 0.0
    for step in range(steps):
        for a in range(3):
            at[a] = point[a] + h * up[a]
        lean_across, lean_along = across + p * pitch * up, along + q * pitch * up
        taking = 0
        for k in range(views):
            seen[k] = allowed[k] and _read(
                k, at, up, lean_across, lean_along, bend, half, steepest, pictures, cameras, (grey, gradient, shift)
            )
            taking += seen[k]
        for turn in range(2):
            if taking < FEWEST:
                return False
            mean[:] = 0.0
            slope[:] = 0.0
            for k in range(views):
                if seen[k]:
                    mean += grey[k]
                    slope += gradient[k]
            mean /= taking
            slope /= taking
            if turn == 1 or step < 2:
                break
            dropped = 0
            for k in range(views):  # a view that shows something else there, or in which the patch is hidden
                if seen[k]:
                    own = (mean * taking - grey[k]) / (taking - 1)
                    alike = (own * grey[k]).sum() / math.sqrt(max((own * own).sum(), 1e-12) * n)
                    if alike < like:
                        seen[k] = False
                        dropped += 1
            taking -= dropped
            if dropped == 0:
                break
        middle_x, middle_y = 0.0, 0.0
        for k in range(views):
            if seen[k]:
                middle_x += shift[k, 0] / taking
                middle_y += shift[k, 1] / taking
        squares, likeness, largest, spread = 0.0, 1.0, 0.0, 0.0
        weight[:] = 0.0
        pull[:] = 0.0
        length = math.sqrt(max((mean * mean).sum(), 1e-12) * n)
        for k in range(views):
            if not seen[k]:
                continue
            ex, ey = shift[k, 0] - middle_x, shift[k, 1] - middle_y
            largest = max(largest, math.sqrt(ex * ex + ey * ey))
            spread += ex * ex + ey * ey
            for m in range(n):
                steep = slope[m, 0] * ex + slope[m, 1] * ey
                rest = grey[k, m] - mean[m]
                squares += rest * rest
                weight[m] += steep * steep
                pull[m] -= steep * rest
            likeness = min(likeness, (grey[k] * mean).sum() / length)
        matrix, right, first = np.zeros((UNKNOWNS, UNKNOWNS)), np.zeros(UNKNOWNS), np.zeros(UNKNOWNS)
        first[0] = 1.0
        m = 0
        for i in range(-half, half + 1):
            for j in range(-half, half + 1):
                basis[1], basis[2], basis[3], basis[4], basis[5] = i, j, i * i, i * j, j * j
                for a in range(UNKNOWNS):
                    right[a] += pull[m] * basis[a]
                    for b in range(a + 1):
                        matrix[a, b] += weight[m] * basis[a] * basis[b]
                m += 1
        for a in range(UNKNOWNS):
            if matrix[a, a] <= 0.0:
                return False
            matrix[a, a] *= 1.0 + 1e-9
        freedom = (taking - 1) * (n - 2) - UNKNOWNS
        sigma = INTERPOLATED * squares / max(freedom, 1)
        inverse = solve_spd(matrix.copy(), first)
        variance = sigma * inverse[0] + systematic**2 / spread
        motion = solve_spd(matrix, right)
        h += motion[0]
        p += motion[1] / pitch
        q += motion[2] / pitch
        bend += motion[3:]
        if abs(h) > reach * pitch or abs(p) > STEEPEST or abs(q) > STEEPEST or not math.isfinite(h):
            return False
        if step >= 3 and abs(motion[0]) * largest < STILL:
            break
    for a in range(3):
        point[a] += h * up[a]
        normal[a] = up[a] - (p * across[a] + q * along[a]) / pitch
    norm = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    for a in range(3):
        normal[a] /= norm
    found[0] = variance / norm**2
    found[1] = likeness
    found[2] = taking
    return True


@njit(cache=True, parallel=True)
def fit_patches(
    points: Floats,
    normals: Floats,
    pitches: Floats,
    allowed: Booleans,
    settings: Settings,
    pictures: Pictures,
    cameras: Cameras,
    found: Floats,
    fits: Booleans,
) -> None:
    """Fit patches in place.

    Parameters
    ----------
    points, normals : (m, 3), of the patches; the start and the answer
    pitches : (m,) mm, from one sample of the patch to the next
    allowed : (m, v), the views that may show the patch
    settings : samples on each side of the middle one; px, that a patch may move along its normal; steps at the most;
        least correlation of a view with the others; cosine of the largest angle between normal and line of sight; px,
        standard uncertainty of a shift of each picture that no model explains
    pictures : B-spline coefficients (v, rows, columns), and the sizes (v, 2) px
    cameras : matrix, distortion, rotation and translation of each view, (v, ...)
    found : (m, 3), written: variance of the point along the normal, mm²; least correlation; number of views
    fits : (m,), written
    """
    for m in prange(len(points)):
        fits[m] = _fit(points[m], normals[m], pitches[m], allowed[m], settings, pictures, cameras, found[m])
