"""NURBS surfaces at many parameters, and the parameters nearest to many points: numba kernels over plain arrays.

L. Piegl, W. Tiller, The NURBS Book, 2nd edition, Springer, 1997: algorithms A2.1 to A2.3 and equation 4.20.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Floats, Indices

CHUNKS = 64
SINGULAR = 1e-12
Net = tuple[Floats, Floats, Floats, Floats]
"""Poles (a, b, 3) mm, weights (a, b), knots in u (a + p + 1,) and v (b + q + 1,)."""


@njit(cache=True, error_model="numpy")
def _span(knots: Floats, count: int, degree: int, at: float) -> int:
    """Return the knot span i with knots[i] <= at < knots[i + 1]; the last one at the end."""
    if at >= knots[count]:
        low = count - 1
        while low > degree and knots[low] == knots[low + 1]:
            low -= 1
        return low
    low, high = degree, count
    while high - low > 1:
        middle = (low + high) // 2
        if at < knots[middle]:
            high = middle
        else:
            low = middle
    return low


@njit(cache=True, error_model="numpy")
def _basis(knots: Floats, count: int, degree: int, at: float, values: Floats, slopes: Floats) -> int:
    """Write the degree + 1 B-splines that do not vanish and their slopes; return the number of the first."""
    span = _span(knots, count, degree, at)
    values[0] = 1.0
    slopes[0] = 0.0
    for d in range(1, degree + 1):
        if d == degree:
            below = 0.0
            for r in range(d):
                width = knots[span + r + 1] - knots[span + r + 1 - d]
                part = degree * values[r] / width
                slopes[r] = below - part
                below = part
            slopes[d] = below
        saved = 0.0
        for r in range(d):
            right, left = knots[span + r + 1] - at, at - knots[span + r + 1 - d]
            part = values[r] / (right + left)
            values[r] = saved + right * part
            saved = left * part
        values[d] = saved
    return span - degree


@njit(cache=True, error_model="numpy")
def _place(net: Net, p: int, q: int, u: float, v: float, work: Floats, found: Floats) -> None:
    """Write S, dS/du and dS/dv, (9,) mm."""
    poles, weights, knots_u, knots_v = net
    i = _basis(knots_u, weights.shape[0], p, u, work[0], work[1])
    j = _basis(knots_v, weights.shape[1], q, v, work[2], work[3])
    found[:] = 0.0
    w, w_u, w_v = 0.0, 0.0, 0.0
    for k in range(p + 1):
        for m in range(q + 1):
            weight = weights[i + k, j + m]
            share = weight * work[0, k] * work[2, m]
            along_u, along_v = weight * work[1, k] * work[2, m], weight * work[0, k] * work[3, m]
            w += share
            w_u += along_u
            w_v += along_v
            for c in range(3):
                pole = poles[i + k, j + m, c]
                found[c] += share * pole
                found[3 + c] += along_u * pole
                found[6 + c] += along_v * pole
    for c in range(3):
        found[c] /= w
        found[3 + c] = (found[3 + c] - w_u * found[c]) / w
        found[6 + c] = (found[6 + c] - w_v * found[c]) / w


@njit(cache=True, parallel=True, error_model="numpy")
def write_places(net: Net, p: int, q: int, uv: Floats, found: Floats) -> None:
    """Write S, dS/du and dS/dv at parameters (n, 2) within the bounds, (n, 9) mm."""
    for chunk in prange(CHUNKS):
        work = np.empty((4, max(p, q) + 1))
        for n in range(chunk * len(uv) // CHUNKS, (chunk + 1) * len(uv) // CHUNKS):
            _place(net, p, q, uv[n, 0], uv[n, 1], work, found[n])


@njit(cache=True, parallel=True, error_model="numpy")
def write_functions(net: Net, p: int, q: int, uv: Floats, columns: Indices, values: Floats) -> None:
    """Write which control points weigh at parameters (n, 2) within the bounds, and how much, (n, (p + 1) (q + 1))."""
    weights = net[1]
    across, along = weights.shape
    for chunk in prange(CHUNKS):
        work = np.empty((4, max(p, q) + 1))
        for n in range(chunk * len(uv) // CHUNKS, (chunk + 1) * len(uv) // CHUNKS):
            i = _basis(net[2], across, p, uv[n, 0], work[0], work[1])
            j = _basis(net[3], along, q, uv[n, 1], work[2], work[3])
            total, at = 0.0, 0
            for k in range(p + 1):
                for m in range(q + 1):
                    columns[n, at] = (i + k) * along + j + m
                    values[n, at] = weights[i + k, j + m] * work[0, k] * work[2, m]
                    total += values[n, at]
                    at += 1
            for k in range(at):
                values[n, k] /= total


@njit(cache=True, parallel=True, error_model="numpy")
def turn_towards(columns: Indices, frames: Floats, normals: Floats, values: Floats, turned: Floats) -> None:
    """Write values (n, w) times the shares of directions (k, d, 3), by columns, along normals (n, 3): (n, w, d)."""
    ways = frames.shape[1]
    for chunk in prange(CHUNKS):
        for n in range(chunk * len(values) // CHUNKS, (chunk + 1) * len(values) // CHUNKS):
            x, y, z = normals[n]
            for m in range(values.shape[1]):
                for d in range(ways):
                    way = frames[columns[n, m], d]
                    turned[n, m, d] = values[n, m] * (way[0] * x + way[1] * y + way[2] * z)


@njit(cache=True, parallel=True, error_model="numpy")
def descend(net: Net, p: int, q: int, points: Floats, steps: int, arrived: float, uv: Floats) -> None:
    """Bring parameters (n, 2) to the closest points of the surface, by Gauss-Newton within its rim.

    Parameters
    ----------
    points : (n, 3) mm
    steps : at most
    arrived : mm, length of the last step
    """
    low_u, high_u = net[2][p], net[2][net[1].shape[0]]
    low_v, high_v = net[3][q], net[3][net[1].shape[1]]
    for chunk in prange(CHUNKS):
        work, at = np.empty((4, max(p, q) + 1)), np.empty(9)
        for n in range(chunk * len(uv) // CHUNKS, (chunk + 1) * len(uv) // CHUNKS):
            for _ in range(steps):
                _place(net, p, q, uv[n, 0], uv[n, 1], work, at)
                e, f, g, right_u, right_v = 0.0, 0.0, 0.0, 0.0, 0.0
                for c in range(3):
                    rest = points[n, c] - at[c]
                    e += at[3 + c] * at[3 + c]
                    f += at[3 + c] * at[6 + c]
                    g += at[6 + c] * at[6 + c]
                    right_u += rest * at[3 + c]
                    right_v += rest * at[6 + c]
                if e * g - f * f <= SINGULAR * e * g:  # at a pole, along each by itself
                    f = 0.0
                step_u, step_v = 0.0, 0.0
                if e * g - f * f > 0:
                    step_u = (g * right_u - f * right_v) / (e * g - f * f)
                    step_v = (e * right_v - f * right_u) / (e * g - f * f)
                u = min(max(uv[n, 0] + step_u, low_u), high_u)
                if u != uv[n, 0] + step_u and g > 0:  # along the rim, as far as is best there
                    step_v = (right_v - f * (u - uv[n, 0])) / g
                v = min(max(uv[n, 1] + step_v, low_v), high_v)
                if v != uv[n, 1] + step_v and e > 0:
                    u = min(max(uv[n, 0] + (right_u - f * (v - uv[n, 1])) / e, low_u), high_u)
                length = np.sqrt(e) * abs(u - uv[n, 0]) + np.sqrt(g) * abs(v - uv[n, 1])
                uv[n, 0], uv[n, 1] = u, v
                if length <= arrived:
                    break
