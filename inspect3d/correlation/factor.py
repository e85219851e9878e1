"""A sparse symmetric positive definite matrix, factored: solves, and the inverse where the matrix is not zero."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats, Integers


@dataclass(frozen=True, eq=False)
class Ordering:
    """The order in which unknowns are eliminated, and what that fixes about the factor; one per pattern.

    Parameters
    ----------
    starts, columns : the rows of the symmetric pattern with its diagonal, n unknowns, columns ascending
    within : a larger pattern that holds this one, and the number (n,) of each unknown there
    """

    starts: Integers
    columns: Integers
    within: tuple[Ordering, Integers] | None = None

    @cached_property
    def order(self) -> Integers:
        """Return the unknowns in the order of elimination (n,): by minimum degree, or as in the larger pattern.

        Each follows right upon those on whose elimination its own depends.
        """
        from inspect3d.correlation.sparse_kernel import children_first, elimination_tree

        order = self._least_degree() if self.within is None else np.argsort(self.within[0].place[self.within[1]])
        starts, columns, _ = self._in_order(order)
        return order[children_first(elimination_tree(starts, columns))]

    def _least_degree(self) -> Integers:
        """Return an order of minimum degree, (n,), by SuperLU, which factors a matrix to tell."""
        from scipy.sparse.linalg import splu

        n = len(self.starts) - 1
        pattern = sparse.csc_matrix((-np.ones(len(self.columns)), self.columns, self.starts), shape=(n, n))
        pattern.setdiag(np.diff(self.starts) + 1.0)
        options = {"SymmetricMode": True}
        return np.argsort(splu(pattern, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options).perm_c)

    @cached_property
    def place(self) -> Integers:
        """Return the place of each unknown in the order, (n,)."""
        place = np.empty_like(self.order)
        place[self.order] = np.arange(len(place))
        return place

    def _in_order(self, order: Integers) -> tuple[Integers, Integers, Integers]:
        """Rows of the pattern in an order: starts, columns, and where each value stood."""
        n = len(self.starts) - 1
        stood = sparse.csr_matrix((np.arange(len(self.columns)), self.columns, self.starts), shape=(n, n))
        moved = stood[order][:, order].tocsr()
        return moved.indptr.astype(np.int64), moved.indices.astype(np.int64), moved.data

    @cached_property
    def _reordered(self) -> tuple[Integers, Integers, Integers]:
        return self._in_order(self.order)

    @cached_property
    def shape(self) -> tuple[Integers, Integers, Integers]:
        """Return the pattern of L by columns, starts (n + 1,) and rows, and where its panels start, (s + 1,)."""
        from inspect3d.correlation.sparse_kernel import elimination_tree, panels_of, symbolic

        starts, columns, _ = self._reordered
        parents = elimination_tree(starts, columns)
        begins, rows = symbolic(starts, columns, parents)
        return begins, rows, panels_of(parents, begins)

    def factor(self, values: Floats) -> Factor:
        """Return the factor of the matrix with these values, in the order of `columns`.

        Raises
        ------
        ValueError
            The matrix is not positive definite.
        """
        from inspect3d.correlation.sparse_kernel import factored

        starts, columns, stood = self._reordered
        lower, diagonal = factored(starts, columns, values[stood], *self.shape)
        if not (diagonal > 0).all():
            raise ValueError("the matrix is not positive definite")
        return Factor(self, lower, diagonal)


@dataclass(frozen=True, eq=False)
class Factor:
    """A = L D L', rows and columns in the order of elimination; it may be a number times another, whose L it shares."""

    ordering: Ordering
    lower: Floats
    diagonal: Floats
    _other: Factor | None = None

    def times(self, number: float) -> Factor:
        """Return the factor of A times a positive number; what this one has worked out serves it too."""
        return Factor(self.ordering, self.lower, number * self.diagonal, self)

    def solve(self, right: Floats) -> Floats:
        """Return A⁻¹ b for right-hand sides (n,) or (n, m)."""
        from inspect3d.correlation.sparse_kernel import solve

        if not right.size:
            return np.zeros(right.shape)
        x = np.ascontiguousarray(right[self.ordering.order].reshape(len(self.diagonal), -1))
        solve(*self.ordering.shape[:2], self.lower, self.diagonal, x)
        return x[self.ordering.place].reshape(right.shape)

    @cached_property
    def _inverse(self) -> tuple[Floats, Floats]:
        if self._other is not None:
            lower, diagonal = self._other._inverse
            number = self.diagonal[0] / self._other.diagonal[0]
            return lower / number, diagonal / number
        from inspect3d.correlation.sparse_kernel import inverted

        begins, rows, panels = self.ordering.shape
        return inverted(begins, rows, self.lower, self.diagonal, panels)

    @property
    def inverse_diagonal(self) -> Floats:
        """Return the diagonal of A⁻¹, (n,)."""
        return self._inverse[1][self.ordering.place]

    def quadratic(self, rows: sparse.csr_matrix) -> Floats:
        """Return t' A⁻¹ t for each row t of a sparse matrix whose pairs of columns lie in the pattern of A."""
        from inspect3d.correlation.sparse_kernel import quadratic

        columns = self.ordering.place[rows.indices]
        return quadratic(*self.ordering.shape[:2], *self._inverse, rows.indptr.astype(np.int64), columns, rows.data)

    def blocks(self, triangles: Integers) -> Floats:
        """Return the entries of A⁻¹ between the corners of triangles (f, 3), (f, 3, 3)."""
        from inspect3d.correlation.sparse_kernel import blocks

        return blocks(*self.ordering.shape[:2], *self._inverse, self.ordering.place[triangles])
