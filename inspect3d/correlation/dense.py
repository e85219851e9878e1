"""A full symmetric positive definite matrix, factored."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from inspect3d.arrays import Floats

RIDGE = 1e-10


@dataclass(frozen=True, eq=False)
class DenseFactor:
    """A = L L'; see `inspect3d.correlation.space.Factored`."""

    lower: Floats

    def solve(self, right: Floats) -> Floats:
        """Return A⁻¹ b for right-hand sides (k,) or (k, m)."""
        return cho_solve((self.lower, True), right) if right.size else np.zeros(right.shape)

    @cached_property
    def inverse(self) -> Floats:
        """Return A⁻¹, (k, k)."""
        return self.solve(np.eye(len(self.lower)))

    def quadratic(self, rows: sparse.csr_matrix) -> Floats:
        """Return t' A⁻¹ t for each row t."""
        return np.asarray(rows.multiply(rows @ self.inverse).sum(axis=1)).ravel()

    def times(self, number: float) -> DenseFactor:
        """Return the factor of A times a positive number."""
        return DenseFactor(np.sqrt(number) * self.lower)


def cholesky(matrix: Floats) -> Floats:
    """Return L of a matrix upon a ridge, a tiny share of the median of its diagonal, which holds what nothing tells."""
    diagonal = np.diag(matrix)
    ridge = RIDGE * float(np.median(diagonal[diagonal > 0])) if (diagonal > 0).any() else 1.0
    return cho_factor(matrix + ridge * np.eye(len(matrix)), lower=True)[0]
