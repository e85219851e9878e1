"""Solve with the inverse of a similar matrix: conjugate gradients, preconditioned."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.correlation.space import Matrix

ENOUGH = 1e-2


def conjugate(matrix: Matrix, right: Floats, similar: Callable[[Floats], Floats], most: int) -> Floats | None:
    """Return x with A x = b for b (n,), but for a hundredth of b; None if so many steps do not lead there.

    Parameters
    ----------
    matrix : A, symmetric and positive definite
    similar : multiplies by M⁻¹, for a matrix M that is not far from A; what is left of b is measured by M⁻¹
    most : steps

    Notes
    -----
    Y. Saad, "Iterative Methods for Sparse Linear Systems", 2nd edition, SIAM, 2003, algorithm 9.1.
    """
    x, rest = np.zeros(len(right)), right
    ahead = turned = similar(rest)
    size = first = rest @ turned
    for _ in range(most):
        if not size > ENOUGH**2 * first:
            return x
        pushed = matrix @ ahead
        length = size / (ahead @ pushed)
        x = x + length * ahead
        rest = rest - length * pushed
        turned = similar(rest)
        size, before = rest @ turned, size
        ahead = turned + size / before * ahead
    return x if not size > ENOUGH**2 * first else None
