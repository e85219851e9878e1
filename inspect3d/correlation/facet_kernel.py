"""What the pictures say about each facet: project, sample, normalise and accumulate in one go; arrays only.

The pictures k of a facet are compared as zero-mean, unit-variance grey levels z_k with their mean z over the views,
weighted by w_k = s_k² (s_k the standard deviation of the facet in picture k, so that raw noise counts equally):

    E = sum_k w_k |z_k - z|²,        for two views |z_1 - z_2|² / (1/s_1² + 1/s_2²).

With tangents T (3, 2) of the surface and P_k = dx_k/dX (2, 3), one gradient G = sum_k w_k (P_k T)' g_k / s_k / sum w
in the coordinates of the material serves all views, so that dz_k/dp = G . (P_k T)⁻¹ dx_k/dp. A motion that slides all
pictures together over the surface then has the derivative zero, as it must; each picture's own, noisy gradient would
give it a stiffness it has not.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.correlation.reading_kernel import Points, Rig, Stack, normalise, read_facet, share

Out = tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats]

CHUNKS = 64
FEWEST = 6
NOISIEST = 0.25


@njit(cache=True, parallel=True, error_model="numpy")
def accumulate(
    stack: Stack,
    rig: Rig,
    points: Points,
    taking: Booleans,
    deviation: Floats,
    weights: Floats,
    power: int,
    columns: Integers,
    out: Out,
) -> None:
    """Write what every facet contributes to the normal equations.

    Parameters
    ----------
    stack : levels (v, rows, columns), sizes (v, 2), cubic
    rig : matrices (v, 3, 3), distortions (v, 5), rotations (v, 3, 3), translations (v, 3), origin (3,)
    points : places (p, 3) mm, shapes (p, 3), starts (f + 1,), corners (f, 3), normals (n, 3)
    taking : (f, v), the views that see the facet
    deviation : (n,) mm
    weights : (f,) of the facets in the sums over the cameras
    power : how often those sums are multiplied by the facet's clean share
    columns : (c,) the camera parameters of each view in the cross and camera blocks: turns 0
        to 2, shifts 3 to 5, then as in `reading_kernel.lens_slope`
    out : arrays to be written, for C = v c: node (f, 3, 3), right (f, 3), cross (f, 3, C), camera (64, C, C),
        camera_right (64, C), whole (f, C, C), each facet's camera
        block, or empty, statistics (f, 4): E, evaluation points, mean correlation of the pictures, clean share
    """
    facets, views, c = len(taking), taking.shape[1], len(columns)
    most = 1
    for f in range(facets):
        most = max(most, points[2][f + 1] - points[2][f])
    for chunk in prange(CHUNKS):
        grey = np.empty((views, most))
        slopes, normal_slides = np.empty((views, most, 2)), np.empty((views, most, 2))
        slides = np.empty((views, most, c, 2))
        shape = np.empty((most, 3))
        spread, sums = np.empty(views), np.empty((3, views, 3 + c))
        column, seen = np.empty((views, 3 + views * c)), np.empty(views, np.int64)
        block, right = np.empty((3 + views * c, 3 + views * c)), np.empty(3 + views * c)
        for f in range(chunk * facets // CHUNKS, (chunk + 1) * facets // CHUNKS):
            k_seen = 0
            for k in range(views):
                if taking[f, k]:
                    seen[k_seen] = k
                    k_seen += 1
            out[6][f] = 0.0
            n = 0
            if k_seen >= 2:
                n = read_facet(
                    stack, rig, points, f, seen[:k_seen], deviation, columns, grey, slopes, normal_slides, slides, shape
                )
            if n < FEWEST or not normalise(grey, k_seen, n, spread):
                out[0][f], out[1][f], out[2][f] = 0.0, 0.0, 0.0
                continue
            share(slopes, k_seen, n, spread)
            _sum(
                grey, slopes, normal_slides, slides, shape, k_seen, n, c, spread, sums, column, block, right, out[6][f]
            )
            _deal(f, chunk, seen, k_seen, c, weights[f], power, block, right, out)


@njit(cache=True, error_model="numpy")
def _sum(
    grey: Floats,
    slopes: Floats,
    normal_slides: Floats,
    slides: Floats,
    shape: Floats,
    views: int,
    n: int,
    c: int,
    spread: Floats,
    sums: Floats,
    column: Floats,
    block: Floats,
    right: Floats,
    statistics: Floats,
) -> None:
    """Accumulate a facet's block of the normal matrix, its right-hand side and its statistics.

    Local unknowns: three nodes, then c parameters of each view. `sums` holds, for each view, the sums over the points
    of its rows by 1 (0) and by the mean profile z (1), which normalising takes out, and by the residual (2).
    """
    size = 3 + views * c
    total, squares = 0.0, 0.0
    for m in range(views):
        total += spread[m] ** 2
    for m in range(views):
        squares += spread[m] ** 4 / total**2
    block[:size, :size] = 0.0
    sums[:, :views] = 0.0
    energy, profile, agreement, noisy, clean = 0.0, 0.0, 0.0, 0.0, 0.0
    for q in range(n):
        gx, gy, mean, plain = 0.0, 0.0, 0.0, 0.0
        slide_x, slide_y = 0.0, 0.0
        for m in range(views):
            part = spread[m] ** 2 / total
            gx, gy = gx + slopes[m, q, 0], gy + slopes[m, q, 1]
            mean += part * grey[m, q]
            plain += grey[m, q]
            slide_x, slide_y = slide_x + part * normal_slides[m, q, 0], slide_y + part * normal_slides[m, q, 1]
        profile += mean * mean
        agreement += plain * plain
        nodes = shape[q, 0] ** 2 + shape[q, 1] ** 2 + shape[q, 2] ** 2
        for m in range(views):
            weight = spread[m] ** 2
            residual = grey[m, q] - mean
            energy += weight * residual * residual
            ax, ay = normal_slides[m, q, 0] - slide_x, normal_slides[m, q, 1] - slide_y
            own = 0.0
            for other in range(views):
                own += (slopes[other, q, 0] * ax + slopes[other, q, 1] * ay) ** 2
            both = (gx * ax + gy * ay) ** 2
            noisy += weight * nodes * both
            clean += weight * nodes * (both - own) / (1.0 - squares)
            along = gx * normal_slides[m, q, 0] + gy * normal_slides[m, q, 1]
            for i in range(3):
                row = along * shape[q, i]
                sums[0, m, i] += row
                sums[1, m, i] += row * mean
                sums[2, m, i] += row * residual
            for j in range(c):
                row = gx * slides[m, q, j, 0] + gy * slides[m, q, j, 1]
                sums[0, m, 3 + j] += row
                sums[1, m, 3 + j] += row * mean
                sums[2, m, 3 + j] += row * residual
            _column(m, q, gx, gy, ax, ay, slides, shape, views, c, spread, total, column)
            if views > 2:
                _add(block, column[m], weight, size)
        if views == 2:  # the rows of the two views are opposite: w_1 c_1 = -w_2 c_2
            _add(block, column[0], spread[0] ** 2 * total / spread[1] ** 2, size)
    _project(block, right, sums, views, n, c, spread, total, profile, column)
    statistics[0], statistics[1] = energy, n
    statistics[2] = (agreement / n - views) / (views * (views - 1))
    statistics[3] = min(max(clean / noisy, NOISIEST), 1.0) if noisy > 0 else NOISIEST


@njit(cache=True, error_model="numpy")
def _add(block: Floats, row: Floats, weight: float, size: int) -> None:
    """Add weight times row' row to the upper triangle of a block."""
    for i in range(size):
        first = weight * row[i]
        for j in range(i, size):
            block[i, j] += first * row[j]


@njit(cache=True, error_model="numpy")
def _column(
    m: int,
    q: int,
    gx: float,
    gy: float,
    ax: float,
    ay: float,
    slides: Floats,
    shape: Floats,
    views: int,
    c: int,
    spread: Floats,
    total: float,
    column: Floats,
) -> None:
    """Write the derivative of view m's residual z_m - z at point q by the local unknowns."""
    across = gx * ax + gy * ay
    for i in range(3):
        column[m, i] = across * shape[q, i]
    for other in range(views):
        factor = (1.0 if other == m else 0.0) - spread[other] ** 2 / total
        for j in range(c):
            column[m, 3 + other * c + j] = factor * (gx * slides[other, q, j, 0] + gy * slides[other, q, j, 1])


@njit(cache=True, error_model="numpy")
def _project(
    block: Floats,
    right: Floats,
    sums: Floats,
    views: int,
    n: int,
    c: int,
    spread: Floats,
    total: float,
    profile: float,
    column: Floats,
) -> None:
    """Take the mean and the mean profile, which normalising removes, out of the block; write the right-hand side."""
    size = 3 + views * c
    right[:size] = 0.0
    for m in range(views):
        weight = spread[m] ** 2
        for i in range(3):
            right[i] -= weight * sums[2, m, i]
        for j in range(c):
            right[3 + m * c + j] -= weight * sums[2, m, 3 + j]
    for kind in range(2):
        norm = 1.0 / n if kind == 0 else 1.0 / profile
        for m in range(views):
            for i in range(3):
                column[m, i] = sums[kind, m, i]
                for other in range(views):
                    column[m, i] -= spread[other] ** 2 / total * sums[kind, other, i]
            for other in range(views):
                factor = (1.0 if other == m else 0.0) - spread[other] ** 2 / total
                for j in range(c):
                    column[m, 3 + other * c + j] = factor * sums[kind, other, 3 + j]
            for i in range(size):
                first = spread[m] ** 2 * norm * column[m, i]
                for j in range(i, size):
                    block[i, j] -= first * column[m, j]
    for i in range(size):
        for j in range(i):
            block[i, j] = block[j, i]


@njit(cache=True, error_model="numpy")
def _deal(
    f: int,
    chunk: int,
    seen: Integers,
    views: int,
    c: int,
    weight: float,
    power: int,
    block: Floats,
    right: Floats,
    out: Out,
) -> None:
    """Deal a facet's block out to the arrays of all facets and all cameras; see `accumulate`."""
    node, node_right, cross, camera, camera_right, whole, statistics = out
    node[f], node_right[f] = block[:3, :3], right[:3]
    cross[f] = 0.0
    factor = weight * statistics[f, 3] ** power
    for m in range(views):
        at = seen[m] * c
        cross[f, :, at : at + c] = block[:3, 3 + m * c : 3 + (m + 1) * c]
        camera_right[chunk, at : at + c] += weight * right[3 + m * c : 3 + (m + 1) * c]
        for other in range(views):
            to = seen[other] * c
            part = block[3 + m * c : 3 + (m + 1) * c, 3 + other * c : 3 + (other + 1) * c]
            camera[chunk, at : at + c, to : to + c] += factor * part
            if len(whole):
                whole[f, at : at + c, to : to + c] = part
