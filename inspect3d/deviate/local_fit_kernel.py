"""Kernel of the cloud-to-node step: a robust polynomial of the signed distance around each node.

Arrays only. Points are given by their feet on the nominal surface, sorted by the cell of a grid they lie in.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Booleans, Floats, Integers

QUADRATIC, LINEAR = 6, 3  # unknowns of the polynomial
ENOUGH = 15  # points that a quadratic polynomial wants
LEAST = 6  # points below which a node is not observed
REJECTED = 4.0  # scales at which a point is left out of the fit
SAME_SIDE = 0.7  # cosine between the normals of node and foot
AMIDST = 0.5  # radii by which the points' centre may lie off the node; on the straight edge of a scan it is 4 / (3 pi)
MOST = 2000  # points used around a node; more are thinned evenly


@njit(cache=True)
def _span(keys: Integers, key: int) -> tuple[np.int64, np.int64]:
    return np.searchsorted(keys, key), np.searchsorted(keys, key + 1)


@njit(cache=True)
def _gather(
    node: Floats,
    normal: Floats,
    radius: float,
    low: Floats,
    cell: float,
    shape: Integers,
    keys: Integers,
    feet: Floats,
    foot_normals: Floats,
    found: Integers,
) -> int:
    """Write the indices of the points around a node into `found`; return how many there are (they may be thinned)."""
    total = 0
    reach = math.ceil(radius / cell)
    i0, j0, k0 = int((node[0] - low[0]) / cell), int((node[1] - low[1]) / cell), int((node[2] - low[2]) / cell)
    for sweep in range(2):
        stride = 1 if sweep == 0 else total // len(found) + 1
        if sweep == 1 and stride == 1:
            break
        total = 0
        for i in range(max(i0 - reach, 0), min(i0 + reach, shape[0] - 1) + 1):
            for j in range(max(j0 - reach, 0), min(j0 + reach, shape[1] - 1) + 1):
                for k in range(max(k0 - reach, 0), min(k0 + reach, shape[2] - 1) + 1):
                    first, last = _span(keys, (i * shape[1] + j) * shape[2] + k)
                    for p in range(first, last):
                        square = 0.0
                        cosine = 0.0
                        for a in range(3):
                            square += (feet[p, a] - node[a]) ** 2
                            cosine += foot_normals[p, a] * normal[a]
                        if square > radius * radius or cosine < SAME_SIDE:
                            continue
                        if total % stride == 0 and total // stride < len(found):
                            found[total // stride] = p
                        total += 1
        if sweep == 1:
            total = (total + stride - 1) // stride
    return min(total, len(found))


@njit(cache=True)
def _solve(columns: Floats, y: Floats, kept: Booleans, unknowns: int, matrix: Floats, coefficients: Floats) -> float:
    """Write the least-squares polynomial of the kept points; return the variance factor of its value at the node."""
    right = np.zeros(unknowns)
    for a in range(unknowns):
        for b in range(unknowns):
            matrix[a, b] = 0.0
    for p in range(len(y)):
        if not kept[p]:
            continue
        for a in range(unknowns):
            right[a] += columns[p, a] * y[p]
            for b in range(a + 1):
                matrix[a, b] += columns[p, a] * columns[p, b]
    for i in range(unknowns):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i == j:
                if total < 1e-9 * (matrix[0, 0] + 1e-300):
                    return math.inf
                matrix[i, i] = math.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]
    # forward substitution of the right-hand side and of the first unit vector
    first = np.zeros(unknowns)
    first[0] = 1.0
    factor = 0.0
    for i in range(unknowns):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
            first[i] -= matrix[i, k] * first[k]
        right[i] /= matrix[i, i]
        first[i] /= matrix[i, i]
        factor += first[i] * first[i]
    for i in range(unknowns - 1, -1, -1):
        for k in range(i + 1, unknowns):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
        coefficients[i] = right[i]
    return factor


@njit(cache=True)
def _change(
    columns: Floats, fourth: Floats, residual: Floats, kept: Booleans, unknowns: int, matrix: Floats
) -> tuple[float, float]:
    """Return by how much one more column changes the value at the node, and the variance factor of that; inf: none.

    With the column q beside the fitted A, the residuals r, M = A'A (`matrix` holds its Cholesky factor) and
    b = A'q: s = q'q - b'M⁻¹b; its coefficient is q'r / s, the change -(M⁻¹b)₀ q'r / s and its factor (M⁻¹b)₀² / s.
    """
    solved = np.zeros(unknowns)
    own = along = 0.0
    for p in range(len(fourth)):
        if not kept[p]:
            continue
        own += fourth[p] * fourth[p]
        along += fourth[p] * residual[p]
        for a in range(unknowns):
            solved[a] += columns[p, a] * fourth[p]
    left = own
    for i in range(unknowns):
        for k in range(i):
            solved[i] -= matrix[i, k] * solved[k]
        solved[i] /= matrix[i, i]
        left -= solved[i] * solved[i]
    if left < 1e-6 * own or not own > 0.0:
        return 0.0, math.inf
    for i in range(unknowns - 1, -1, -1):
        for k in range(i + 1, unknowns):
            solved[i] -= matrix[k, i] * solved[k]
        solved[i] /= matrix[i, i]
    return -solved[0] * along / left, solved[0] ** 2 / left


@njit(cache=True)
def _fit(
    columns: Floats, fourth: Floats, y: Floats, plain: Floats, noise: float, unknowns: int
) -> tuple[float, float, float, int, float, float]:
    """Return value at the node, variance factor, sum of squared residuals, degrees of freedom; factor inf: no fit.

    The last two are the change of the value by the `fourth` power of the distance and its variance factor. Rows and
    right-hand side are weighted; `plain` is the latter without.
    """
    n = len(y)
    middle = np.median(plain)
    scale = max(1.4826 * np.median(np.abs(plain - middle)), noise)
    kept = np.abs(plain - middle) <= REJECTED * scale
    matrix, coefficients = np.empty((unknowns, unknowns)), np.zeros(unknowns)
    residual = np.empty(n)
    factor, squares, count = math.inf, 0.0, 0
    for order in (LINEAR, unknowns, unknowns, unknowns, unknowns, unknowns, unknowns, unknowns):
        factor = _solve(columns, y, kept, order, matrix, coefficients)
        if not factor < math.inf:
            return 0.0, math.inf, 0.0, 0, 0.0, math.inf
        for p in range(n):
            residual[p] = y[p]
            for a in range(order):
                residual[p] -= coefficients[a] * columns[p, a]
        scale = max(1.4826 * np.median(np.abs(residual)) * math.sqrt(n / max(n - order, 1)), 0.5 * noise)
        changed = False
        squares, count = 0.0, 0
        for p in range(n):
            inside = abs(residual[p]) <= REJECTED * scale
            changed = changed or inside != kept[p]
            kept[p] = inside
            if inside:
                squares += residual[p] * residual[p]
                count += 1
        if order == unknowns and not changed:
            break
    if count <= unknowns + 2 or 2 * count < n:
        return 0.0, math.inf, 0.0, 0, 0.0, math.inf
    change, uncertain = 0.0, math.inf
    if unknowns == QUADRATIC and not changed and count >= ENOUGH:
        change, uncertain = _change(columns, fourth, residual, kept, unknowns, matrix)
    return coefficients[0], factor, squares, count - unknowns, change, uncertain


@njit(parallel=True, cache=True)
def fit_nodes(
    nodes: Floats,
    normals: Floats,
    radii: Floats,
    noise: float,
    low: Floats,
    cell: float,
    shape: Integers,
    keys: Integers,
    feet: Floats,
    foot_normals: Floats,
    distance: Floats,
    weights: Floats,
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """Return value (mm), variance factor, residual sum of squares (mm²), degrees of freedom and change for each node.

    Parameters
    ----------
    nodes, normals : (n, 3)
    radii : (n, k) mm, tried from the first on until there are enough points
    noise : mm, floor of the rejection scale
    low, cell, shape, keys : grid of the feet; keys (m,) sorted
    feet, foot_normals, distance : of the points, (m, 3), (m, 3), (m,), in the order of the keys
    weights : (m,), usual uncertainty of a point over that of each

    Returns
    -------
    value (n,), factor (n,) with inf where the node is not observed, squares (n,), freedom (n,), and by how much the
    fourth power of the distance from the node, as one more term of a quadratic fit, changes the value (n,) mm, with
    the variance factor of that (n,), inf where it is not told
    """
    n = len(nodes)
    value, factor = np.zeros(n), np.full(n, math.inf)
    squares, freedom = np.zeros(n), np.zeros(n)
    change, uncertain = np.zeros(n), np.full(n, math.inf)
    for i in prange(n):
        found = np.empty(MOST, np.int64)
        normal = normals[i]
        helper = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.7 else np.array([0.0, 1.0, 0.0])
        first = np.cross(normal, helper)
        first /= math.sqrt(np.sum(first * first))
        second = np.cross(normal, first)
        count, radius = 0, 0.0
        for level in range(radii.shape[1]):
            radius = radii[i, level]
            count = _gather(nodes[i], normal, radius, low, cell, shape, keys, feet, foot_normals, found)
            if count >= ENOUGH:
                break
        if count < LEAST:
            continue
        columns, fourth = np.empty((count, 6)), np.empty(count)
        y, plain = np.empty(count), np.empty(count)
        certain, east, north = 0.0, 0.0, 0.0
        for c in range(count):
            p = found[c]
            u = v = 0.0
            for a in range(3):
                u += (feet[p, a] - nodes[i, a]) * first[a] / radius
                v += (feet[p, a] - nodes[i, a]) * second[a] / radius
            w = weights[p]
            columns[c, 0], columns[c, 1], columns[c, 2] = w, w * u, w * v
            columns[c, 3], columns[c, 4], columns[c, 5] = w * u * u, w * u * v, w * v * v
            fourth[c] = w * (u * u + v * v) ** 2
            y[c], plain[c] = w * distance[p], distance[p]
            certain, east, north = certain + w * w / count, east + u / count, north + v / count
        if math.hypot(east, north) > AMIDST:
            continue
        if count >= ENOUGH:
            value[i], factor[i], squares[i], freedom[i], change[i], uncertain[i] = _fit(
                columns, fourth, y, plain, noise, QUADRATIC
            )
        if not factor[i] * certain <= 1.0:
            value[i], factor[i], squares[i], freedom[i], change[i], uncertain[i] = _fit(
                columns, fourth, y, plain, noise, LINEAR
            )
        if not factor[i] * certain <= 1.0:
            factor[i] = math.inf
    return value, factor, squares, freedom, change, uncertain
