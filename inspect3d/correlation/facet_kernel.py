"""What the pictures say about each facet: project, sample, normalise and accumulate in one go; arrays only.

The pictures k of a facet are compared as zero-mean, unit-variance grey levels z_k with their mean z over the views,
weighted by w_k = s_k² (s_k the standard deviation of the facet in picture k, so that raw noise counts equally):

    E = sum_k w_k |z_k - z|²,        for two views |z_1 - z_2|² / (1/s_1² + 1/s_2²).

With tangents T (3, 2) of the surface and P_k = dx_k/dX (2, 3), one gradient G = sum_k w_k (P_k T)' g_k / s_k / sum w
in the coordinates of the material serves all views, so that dz_k/dp = G . (P_k T)⁻¹ dx_k/dp. A motion that slides all
pictures together over the surface then has the derivative zero, as it must; each picture's own, noisy gradient would
give it a stiffness it has not.

With b_k the derivatives of z_k by the parameters, and zero by those of other views, the residual z_k - z has the
derivatives b_k - sum_o w_o b_o / w, w = sum w, so that the normal matrix is that of all products b_k b_o', each taken
w_k (k = o) - w_k w_o / w times.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.correlation.reading_kernel import (
    GREY,
    PLACED,
    READING,
    SHAPE,
    SLIDE,
    SLOPE,
    Points,
    Rig,
    Stack,
    place_facet,
    sample_facet,
    see_facet,
    write_columns,
)
from inspect3d.correlation.row_kernel import normalised, product, total

Out = tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats]

CHUNKS = 64
FEWEST = 6
NOISIEST = 0.25
GX, GY, MEAN, MEAN_X, MEAN_Y, NODES, WORK = 0, 1, 2, 3, 4, 5, 6
"""Rows of a facet's work: G (2 rows), the mean grey level z, the mean slide over the views (2), |N|²."""


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
    stack : levels (v, rows, columns), sizes (v, 2), cubic, step
    rig : matrices (v, 3, 3), distortions (v, 5), rotations (v, 3, 3), translations (v, 3), origin (3,)
    points : places (p, 3) mm, shapes (p, 3), starts (f + 1,), corners (f, 3), normals (n, 3)
    taking : (f, v), the views that see the facet
    deviation : (n,) mm
    weights : (f,) of the facets in the sums over the cameras
    power : how often those sums are multiplied by the facet's clean share
    columns : (c,) the camera parameters of each view in the cross and camera blocks: turns 0
        to 2, shifts 3 to 5, then as in `reading_kernel.lens_slope`
    out : arrays to be written, for C = v c: node (f, 3, 3), right (f, 3), cross (f, 3, C), camera (64, C, C),
        camera_right (64, C), whole (f, C, C) and each_right (f, C), each facet's camera block and
        right-hand side, or empty, statistics (f, 4): E, evaluation points, mean correlation of the pictures, clean
        share
    """
    facets, views, c = len(taking), taking.shape[1], len(columns)
    most = 1
    for f in range(facets):
        most = max(most, points[2][f + 1] - points[2][f])
    for chunk in prange(CHUNKS):
        placed, reading, work = np.empty((PLACED, most)), np.empty((views, READING, most)), np.empty((WORK, most))
        rows, sums = np.empty((views * (3 + c), most)), np.empty((2, views, 3 + c))
        spread, seen = np.empty(views), np.empty(views, np.int64)
        block, right = np.empty((3 + views * c, 3 + views * c)), np.empty(3 + views * c)
        for f in range(chunk * facets // CHUNKS, (chunk + 1) * facets // CHUNKS):
            k_seen = 0
            for k in range(views):
                if taking[f, k]:
                    seen[k_seen] = k
                    k_seen += 1
            out[7][f] = 0.0
            n = 0
            if k_seen >= 2:
                n = place_facet(points, f, deviation, placed)
                for m in range(k_seen):
                    see_facet(rig, seen[m], placed, n, reading[m])
                    sample_facet(stack, seen[m], n, reading[m])
            if n < FEWEST or not _normalise(reading, k_seen, n, spread):
                out[0][f], out[1][f], out[2][f] = 0.0, 0.0, 0.0
                continue
            _share(placed, reading, k_seen, n, spread, work)
            _judge(reading, k_seen, n, spread, work, out[7][f])
            for m in range(k_seen):
                at = m * (3 + c)
                _write_nodes(placed, reading[m], n, work, rows[at : at + 3])
                if c:
                    write_columns(columns, seen[m], rig, placed, reading[m], work, n, rows[at + 3 : at + 3 + c])
            _sum(rows, reading, k_seen, n, c, spread, work, sums, block, right)
            _deal(f, chunk, seen, k_seen, c, weights[f], power, block, right, out)


@njit(cache=True, error_model="numpy")
def _normalise(reading: Floats, views: int, n: int, spread: Floats) -> bool:
    """Bring each view's grey levels to mean 0 and variance 1; return False where one has no contrast at all."""
    for m in range(views):
        mean, spread[m] = normalised(reading[m, GREY], n)
        if not spread[m] > 1e-9 * (1.0 + abs(mean)):
            return False
    return True


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _share(placed: Floats, reading: Floats, views: int, n: int, spread: Floats, work: Floats) -> None:
    """Write G, z and the mean slide; turn each view's slopes into its part of G, w_k (P_k T)' g_k / s_k / sum w."""
    whole = 0.0
    for m in range(views):
        whole += spread[m] ** 2
    work[: NODES + 1, :n] = 0.0
    for m in range(views):
        part, weight = spread[m] / whole, spread[m] ** 2 / whole
        row = reading[m]
        for q in range(n):
            row[SLOPE, q] *= part
            row[SLOPE + 1, q] *= part
            work[GX, q] += row[SLOPE, q]
            work[GY, q] += row[SLOPE + 1, q]
            work[MEAN, q] += weight * row[GREY, q]
            work[MEAN_X, q] += weight * row[SLIDE, q]
            work[MEAN_Y, q] += weight * row[SLIDE + 1, q]
    for i in range(3):
        for q in range(n):
            work[NODES, q] += placed[SHAPE + i, q] ** 2


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _judge(reading: Floats, views: int, n: int, spread: Floats, work: Floats, statistics: Floats) -> None:
    """Write a facet's statistics; see `accumulate`."""
    whole, squares, agreement, energy, noisy, clean = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for m in range(views):
        whole += spread[m] ** 2
    for m in range(views):
        squares += spread[m] ** 4 / whole**2
    for q in range(n):
        plain = 0.0
        for m in range(views):
            plain += reading[m, GREY, q]
        agreement += plain * plain
    for m in range(views):
        weight, row = spread[m] ** 2, reading[m]
        for q in range(n):
            ax, ay = row[SLIDE, q] - work[MEAN_X, q], row[SLIDE + 1, q] - work[MEAN_Y, q]
            both = work[GX, q] * ax + work[GY, q] * ay
            own = 0.0
            for other in range(views):
                own += (reading[other, SLOPE, q] * ax + reading[other, SLOPE + 1, q] * ay) ** 2
            energy += weight * (row[GREY, q] - work[MEAN, q]) ** 2
            noisy += weight * work[NODES, q] * both**2
            clean += weight * work[NODES, q] * (both**2 - own)
    statistics[0], statistics[1] = energy, n
    statistics[2] = (agreement / n - views) / (views * (views - 1))
    statistics[3] = min(max(clean / (1.0 - squares) / noisy, NOISIEST), 1.0) if noisy > 0 else NOISIEST


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _write_nodes(placed: Floats, reading: Floats, n: int, work: Floats, rows: Floats) -> None:
    """Write a view's derivatives by the three nodes, less their mean over the views, which falls out (3, most)."""
    for i in range(3):
        for q in range(n):
            x, y = reading[SLIDE, q] - work[MEAN_X, q], reading[SLIDE + 1, q] - work[MEAN_Y, q]
            rows[i, q] = (work[GX, q] * x + work[GY, q] * y) * placed[SHAPE + i, q]


@njit(cache=True, error_model="numpy")
def _sum(
    rows: Floats,
    reading: Floats,
    views: int,
    n: int,
    c: int,
    spread: Floats,
    work: Floats,
    sums: Floats,
    block: Floats,
    right: Floats,
) -> None:
    """Accumulate a facet's block of the normal matrix and its right-hand side.

    Local unknowns: three nodes, then c parameters of each view. `sums` holds, for each view, the sums over the points
    of its derivatives by 1 (0) and by the mean profile z (1), which normalising takes out.
    """
    size, width, whole = 3 + views * c, 3 + c, 0.0
    profile = product(work[MEAN], work[MEAN], n)
    block[:size, :size] = 0.0
    right[:size] = 0.0
    for m in range(views):
        whole += spread[m] ** 2
        for a in range(width):
            row = rows[m * width + a]
            sums[0, m, a] = total(row, n)
            sums[1, m, a] = product(row, work[MEAN], n)
            right[_place(m, a, c)] -= spread[m] ** 2 * (product(row, reading[m, GREY], n) - sums[1, m, a])
    for m in range(views):
        for a in range(width):
            i = _place(m, a, c)
            for other in range(m + 1):
                times = spread[m] ** 2 * (1.0 * (m == other) - spread[other] ** 2 / whole)
                for b in range(a + 1 if m == other else width):
                    j = _place(other, b, c)
                    entry = product(rows[m * width + a], rows[other * width + b], n)
                    entry -= sums[0, m, a] * sums[0, other, b] / n + sums[1, m, a] * sums[1, other, b] / profile
                    twice = i == j and m != other
                    block[max(i, j), min(i, j)] += (2.0 if twice else 1.0) * times * entry
    for i in range(size):
        for j in range(i):
            block[j, i] = block[i, j]


@njit(cache=True)
def _place(m: int, a: int, c: int) -> int:
    """Return which local unknown the derivative a of view m is by."""
    return a if a < 3 else a + m * c


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
    node, node_right, cross, camera, camera_right, whole, each_right, statistics = out
    factor = weight * statistics[f, 3] ** power
    for i in range(3):
        node_right[f, i] = right[i]
        for j in range(3):
            node[f, i, j] = block[i, j]
        for j in range(cross.shape[2]):
            cross[f, i, j] = 0.0
    for m in range(views):
        for i in range(c):
            own, at = 3 + m * c + i, seen[m] * c + i
            camera_right[chunk, at] += weight * right[own]
            if len(whole):
                each_right[f, at] = right[own]
            for j in range(3):
                cross[f, j, at] = block[j, own]
            for other in range(views):
                for j in range(c):
                    part, to = block[own, 3 + other * c + j], seen[other] * c + j
                    camera[chunk, at, to] += factor * part
                    if len(whole):
                        whole[f, at, to] = part
