"""Factor a sparse symmetric matrix and invert it where it is not zero: numba kernels over plain arrays.

Neighbouring columns of the factor with the same rows below form a panel, and panels are worked on as dense matrices.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from inspect3d.arrays import Floats, Integers
from inspect3d.correlation.row_kernel import product

WIDEST = 48


@njit(cache=True)
def elimination_tree(starts: Integers, columns: Integers) -> Integers:
    """Return the parent of each unknown in the elimination tree of a symmetric matrix in rows, -1 for a root."""
    n = len(starts) - 1
    parents, ancestors = np.full(n, -1), np.full(n, -1)
    for k in range(n):
        for p in range(starts[k], starts[k + 1]):
            i = columns[p]
            while i >= 0 and i < k:
                i, last = ancestors[i], i
                ancestors[last] = k
                if i < 0:
                    parents[last] = k
    return parents


@njit(cache=True)
def children_first(parents: Integers) -> Integers:
    """Return the unknowns in an order in which each follows right upon its descendants, (n,)."""
    n = len(parents)
    heads, following, order, waiting = np.full(n + 1, -1), np.full(n, -1), np.empty(n, np.int64), np.empty(n, np.int64)
    for k in range(n - 1, -1, -1):
        following[k], heads[parents[k]] = heads[parents[k]], k
    filled, root = 0, heads[-1]
    while root >= 0:
        waiting[0], depth = root, 1
        while depth > 0:
            child = heads[waiting[depth - 1]]
            if child < 0:
                depth -= 1
                order[filled] = waiting[depth]
                filled += 1
            else:
                heads[waiting[depth - 1]] = following[child]
                waiting[depth] = child
                depth += 1
        root = following[root]
    return order


@njit(cache=True)
def symbolic(starts: Integers, columns: Integers, parents: Integers) -> tuple[Integers, Integers]:
    """Return the pattern of the unit lower triangular factor L by columns: where they start, and their rows, ascending.

    Notes
    -----
    T. A. Davis, "Algorithm 849: a concise sparse Cholesky factorization package", ACM Transactions on Mathematical
    Software 31(4), 2005.
    """
    n = len(starts) - 1
    counts, flags = np.zeros(n, np.int64), np.arange(n)
    begins, rows = np.zeros(n + 1, np.int64), np.empty(0, np.int64)
    for turn in range(2):
        if turn:
            begins[1:] = np.cumsum(counts)
            rows = np.empty(begins[n], np.int64)
        counts[:], flags[:] = 0, np.arange(n)
        for k in range(n):
            flags[k] = k
            for p in range(starts[k], starts[k + 1]):
                i = columns[p]
                while i < k and flags[i] != k:
                    if turn:
                        rows[begins[i] + counts[i]] = k
                    counts[i] += 1
                    flags[i] = k
                    i = parents[i]
    return begins, rows


@njit(cache=True)
def panels_of(parents: Integers, begins: Integers) -> Integers:
    """Return where the panels start, (s + 1,)."""
    n = len(parents)
    firsts = np.empty(n + 1, np.int64)
    count = 0
    for k in range(n):
        alike = k > 0 and parents[k - 1] == k and begins[k] - begins[k - 1] == begins[k + 1] - begins[k] + 1
        if not alike or k - firsts[count - 1] == WIDEST:
            firsts[count] = k
            count += 1
    firsts[count] = n
    return firsts[: count + 1].copy()


@njit(cache=True)
def factored(
    starts: Integers, columns: Integers, values: Floats, begins: Integers, rows: Integers, firsts: Integers
) -> tuple[Floats, Floats]:
    """Return L's values, in the order of `rows`, and the diagonal D of A = L D L'; not positive if A is not definite.

    Notes
    -----
    J. W. H. Liu, "The multifrontal method for sparse matrix solution: theory and practice", SIAM Review 34(1), 1992. A
    panel gathers its part of the matrix and what its children left of theirs, is eliminated, and leaves the rest to its
    parent. Children come right before, so what they left lies on top of a stack.
    """
    n, count = len(begins) - 1, len(firsts) - 1
    lower, diagonal, place = np.empty(len(rows)), np.empty(n), np.zeros(n, np.int64)
    stack, tops = np.empty(_highest(begins, rows, firsts)), np.zeros(count + 1, np.int64)
    owners, factors = np.empty(count, np.int64), np.empty(WIDEST)
    waiting = 0
    for s in range(count):
        first, last = firsts[s], firsts[s + 1] - 1
        width = last + 1 - first
        below = rows[begins[last] : begins[last + 1]]
        size = width + len(below)
        front = np.zeros((size, size))
        for k in range(width):
            place[first + k] = k
        for k in range(len(below)):
            place[below[k]] = width + k
        for j in range(first, last + 1):
            for p in range(starts[j], starts[j + 1]):
                if columns[p] >= j:
                    front[j - first, place[columns[p]]] = values[p]
        while waiting > 0:
            child = firsts[owners[waiting - 1] + 1] - 1
            theirs = rows[begins[child] : begins[child + 1]]
            if theirs[0] > last:
                break
            waiting -= 1
            left = stack[tops[waiting] : tops[waiting + 1]].reshape(len(theirs), len(theirs))
            for a in range(len(theirs)):
                at = place[theirs[a]]
                for b in range(a, len(theirs)):
                    front[at, place[theirs[b]]] += left[a, b]
        for a in range(size):
            for k in range(min(a, width)):
                factors[k] = front[k, a] / diagonal[first + k]
            subtract(front[a], front, factors, min(a, width), a)
            if a < width:
                diagonal[first + a] = front[a, a]
                if not front[a, a] > 0:
                    return lower, np.full(n, -1.0)
        for k in range(width):
            begin = begins[first + k] - k - 1
            for i in range(k + 1, size):
                lower[begin + i] = front[k, i] / diagonal[first + k]
        if len(below) > 0:
            owners[waiting], tops[waiting + 1] = s, tops[waiting] + len(below) ** 2
            stack[tops[waiting] : tops[waiting + 1]] = front[width:, width:].ravel()
            waiting += 1
    return lower, diagonal


@njit(cache=True, fastmath={"contract"})
def subtract(row: Floats, rows: Floats, factors: Floats, count: int, begin: int) -> None:
    """Subtract factors times the first so many rows from another, from the column `begin` on."""
    end = len(row)
    for k in range(0, count - 3, 4):
        a, b, c, d = factors[k], factors[k + 1], factors[k + 2], factors[k + 3]
        first, second, third, fourth = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
        for j in range(begin, end):
            row[j] -= a * first[j] + b * second[j] + c * third[j] + d * fourth[j]
    for k in range(count - count % 4, count):
        a, first = factors[k], rows[k]
        for j in range(begin, end):
            row[j] -= a * first[j]


@njit(cache=True)
def _highest(begins: Integers, rows: Integers, firsts: Integers) -> int:
    """Return how many numbers lie on the stack of `factored` at most."""
    count = len(firsts) - 1
    waiting, sizes, ends = 0, np.empty(count, np.int64), np.empty(count, np.int64)
    high, highest = 0, 0
    for s in range(count):
        last = firsts[s + 1] - 1
        while waiting > 0 and ends[waiting - 1] <= last:
            waiting -= 1
            high -= sizes[waiting]
        below = begins[last + 1] - begins[last]
        if below > 0:
            sizes[waiting], ends[waiting] = below**2, rows[begins[last]]
            high += below**2
            highest = max(high, highest)
            waiting += 1
    return highest


@njit(cache=True)
def solve(begins: Integers, rows: Integers, lower: Floats, diagonal: Floats, x: Floats) -> None:
    """Overwrite the right-hand sides x (n, m) by A⁻¹ x."""
    n, m = x.shape
    for j in range(n):
        for p in range(begins[j], begins[j + 1]):
            for c in range(m):
                x[rows[p], c] -= lower[p] * x[j, c]
    for j in range(n - 1, -1, -1):
        for c in range(m):
            x[j, c] /= diagonal[j]
        for p in range(begins[j], begins[j + 1]):
            for c in range(m):
                x[j, c] -= lower[p] * x[rows[p], c]


@njit(cache=True)
def inverted(
    begins: Integers, rows: Integers, lower: Floats, diagonal: Floats, firsts: Integers
) -> tuple[Floats, Floats]:
    """Return the entries of A⁻¹ where L has any (same order as L's), and its diagonal.

    Notes
    -----
    K. Takahashi, J. Fagan, M.-S. Chin, "Formation of a sparse bus impedance matrix and its application to short circuit
    study", 8th PICA Conference, 1973, panel by panel from the last: with J the panel's unknowns and R those below,
    Z = A⁻¹ has Z_RJ = -Z_RR L_RJ L_JJ⁻¹, and Z_JJ follows from Z_JJ L_JJ + Z_JR L_RJ = L_JJ⁻ᵀ D⁻¹.
    """
    n = len(diagonal)
    inverse, inverse_diagonal, place = np.empty(len(lower)), np.empty(n), np.full(n, -1)
    for s in range(len(firsts) - 2, -1, -1):
        first, last = firsts[s], firsts[s + 1] - 1
        width = last + 1 - first
        below = rows[begins[last] : begins[last + 1]]
        known = _gathered(below, begins, rows, inverse, inverse_diagonal, place)
        mixed, across, here = np.zeros((width, len(below))), np.zeros((width, len(below))), np.zeros((width, width))
        for k in range(width - 1, -1, -1):
            begin, end = begins[first + k], begins[first + k + 1]
            inside, outside = lower[begin : end - len(below)], lower[end - len(below) : end]
            mixed[k] = outside
            subtract(mixed[k], mixed[k + 1 :], inside, len(inside), 0)
            subtract(across[k], known, mixed[k], len(below), 0)
            here[k, k] = 1.0 / diagonal[first + k] - product(across[k], outside, len(below))
            for i in range(k + 1, width):
                found = product(here[i, k + 1 :], inside, len(inside)) + product(across[i], outside, len(below))
                here[i, k], here[k, i] = -found, -found
                here[k, k] += inside[i - k - 1] * found
                inverse[begin + i - k - 1] = -found
            inverse[end - len(below) : end] = across[k]
            inverse_diagonal[first + k] = here[k, k]
    return inverse, inverse_diagonal


@njit(cache=True)
def _gathered(
    members: Integers, begins: Integers, rows: Integers, inverse: Floats, inverse_diagonal: Floats, place: Integers
) -> Floats:
    """Return the inverse between some unknowns; `place` (n,) is -1 before and after."""
    found = np.empty((len(members), len(members)))
    for a in range(len(members)):
        place[members[a]] = a
    for a in range(len(members)):
        k = members[a]
        found[a, a] = inverse_diagonal[k]
        for p in range(begins[k], begins[k + 1]):
            b = place[rows[p]]
            if b >= 0:
                found[a, b], found[b, a] = inverse[p], inverse[p]
    for k in members:
        place[k] = -1
    return found


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
