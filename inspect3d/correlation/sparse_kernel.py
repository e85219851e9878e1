"""Factor a sparse symmetric matrix and invert it where it is not zero: numba kernels over plain arrays."""

from __future__ import annotations

import numpy as np
from numba import njit

from inspect3d.arrays import Floats, Integers


@njit(cache=True)
def symbolic(starts: Integers, columns: Integers) -> tuple[Integers, Integers]:
    """Return parents in the elimination tree and entries per column of L, (n,), for a symmetric matrix in rows."""
    n = len(starts) - 1
    parents, counts, flags = np.full(n, -1), np.zeros(n, np.int64), np.arange(n)
    for k in range(n):
        flags[k] = k
        for p in range(starts[k], starts[k + 1]):
            i = columns[p]
            while i < k and flags[i] != k:
                if parents[i] < 0:
                    parents[i] = k
                counts[i] += 1
                flags[i] = k
                i = parents[i]
    return parents, counts


@njit(cache=True)
def factored(
    starts: Integers, columns: Integers, values: Floats, parents: Integers, counts: Integers
) -> tuple[Integers, Integers, Floats, Floats]:
    """Return L, unit lower triangular, by columns (starts, rows ascending, values), and the diagonal D of A = L D L'.

    Notes
    -----
    T. A. Davis, "Algorithm 849: a concise sparse Cholesky factorization package", ACM Transactions on Mathematical
    Software 31(4), 2005.
    """
    n = len(counts)
    begins = np.zeros(n + 1, np.int64)
    begins[1:] = np.cumsum(counts)
    rows, lower = np.empty(begins[n], np.int64), np.empty(begins[n])
    filled, flags, path = np.zeros(n, np.int64), np.full(n, -1), np.empty(n, np.int64)
    work, diagonal = np.zeros(n), np.empty(n)
    for k in range(n):
        top = n
        flags[k] = k
        for p in range(starts[k], starts[k + 1]):
            i = columns[p]
            if i > k:
                continue
            work[i] += values[p]
            length = 0
            while flags[i] != k:
                path[length] = i
                length += 1
                flags[i] = k
                i = parents[i]
            while length > 0:
                top -= 1
                length -= 1
                path[top] = path[length]
        diagonal[k] = work[k]
        work[k] = 0.0
        for step in range(top, n):
            i = path[step]
            y = work[i]
            work[i] = 0.0
            end = begins[i] + filled[i]
            for p in range(begins[i], end):
                work[rows[p]] -= lower[p] * y
            diagonal[k] -= y / diagonal[i] * y
            rows[end], lower[end] = k, y / diagonal[i]
            filled[i] += 1
    return begins, rows, lower, diagonal


@njit(cache=True)
def solve(begins: Integers, rows: Integers, lower: Floats, diagonal: Floats, x: Floats) -> None:
    """Overwrite the right-hand sides x (n, m) by A⁻¹ x."""
    n = len(diagonal)
    for j in range(n):
        for p in range(begins[j], begins[j + 1]):
            x[rows[p]] -= lower[p] * x[j]
    for j in range(n - 1, -1, -1):
        x[j] /= diagonal[j]
        for p in range(begins[j], begins[j + 1]):
            x[j] -= lower[p] * x[rows[p]]


@njit(cache=True)
def inverted(begins: Integers, rows: Integers, lower: Floats, diagonal: Floats) -> tuple[Floats, Floats]:
    """Return the entries of A⁻¹ where L has any (same order as L's), and its diagonal.

    Notes
    -----
    K. Takahashi, J. Fagan, M.-S. Chin, "Formation of a sparse bus impedance matrix and its application to short circuit
    study", 8th PICA Conference, 1973: column j of Z = A⁻¹ follows from the later ones, Z_ij = -sum_k Z_ik L_kj.
    """
    n = len(diagonal)
    inverse, inverse_diagonal = np.empty(len(lower)), np.empty(n)
    sums, member = np.zeros(n), np.zeros(n, np.bool_)
    factors = np.zeros(n)
    for j in range(n - 1, -1, -1):
        begin, end = begins[j], begins[j + 1]
        for p in range(begin, end):
            member[rows[p]], factors[rows[p]], sums[rows[p]] = True, lower[p], 0.0
        for p in range(begin, end):
            k = rows[p]
            sums[k] += inverse_diagonal[k] * lower[p]
            for q in range(begins[k], begins[k + 1]):
                i = rows[q]
                if member[i]:
                    sums[i] += inverse[q] * lower[p]
                    sums[k] += inverse[q] * factors[i]
        inverse_diagonal[j] = 1.0 / diagonal[j]
        for p in range(begin, end):
            inverse[p] = -sums[rows[p]]
            inverse_diagonal[j] -= lower[p] * inverse[p]
            member[rows[p]] = False
    return inverse, inverse_diagonal


@njit(cache=True)
def entry(begins: Integers, rows: Integers, inverse: Floats, inverse_diagonal: Floats, i: int, j: int) -> float:
    """Return entry (i, j) of the inverse; the pair must lie in the pattern of L."""
    if i == j:
        return inverse_diagonal[i]
    column, row = min(i, j), max(i, j)
    low, high = begins[column], begins[column + 1]
    while high - low > 1:
        middle = (low + high) // 2
        if rows[middle] <= row:
            low = middle
        else:
            high = middle
    return inverse[low]


@njit(cache=True)
def quadratic(
    begins: Integers,
    rows: Integers,
    inverse: Floats,
    inverse_diagonal: Floats,
    starts: Integers,
    columns: Integers,
    values: Floats,
) -> Floats:
    """Return t' A⁻¹ t for each row t of a sparse matrix (starts, columns, values)."""
    forms = np.zeros(len(starts) - 1)
    for r in range(len(forms)):
        for p in range(starts[r], starts[r + 1]):
            for q in range(starts[r], starts[r + 1]):
                z = entry(begins, rows, inverse, inverse_diagonal, columns[p], columns[q])
                forms[r] += values[p] * values[q] * z
    return forms


@njit(cache=True)
def blocks(begins: Integers, rows: Integers, inverse: Floats, inverse_diagonal: Floats, corners: Integers) -> Floats:
    """Return the 3 x 3 blocks of A⁻¹ at the corners (f, 3) of triangles, (f, 3, 3)."""
    found = np.empty((len(corners), 3, 3))
    for f in range(len(corners)):
        for a in range(3):
            for b in range(3):
                found[f, a, b] = entry(begins, rows, inverse, inverse_diagonal, corners[f, a], corners[f, b])
    return found
