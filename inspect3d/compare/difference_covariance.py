"""The covariance of the difference of two maps in their common alignment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.deviate.map_covariance import variances_without
from inspect3d.measure import FieldCovariance


@dataclass(frozen=True, eq=False)
class DifferenceCovariance:
    """The covariance G (S_a + S_b) G' + H H' at k nodes, with G = I - J M.

    Parameters
    ----------
    own : S_a and S_b, of the maps' own errors
    modes : J (k, q)
    solver : M (q, k)
    shared : H (k, s) mm, errors that all nodes share, one column for each, in the common alignment
    """

    own: tuple[FieldCovariance, ...]
    modes: Floats
    solver: Floats
    shared: Floats

    @cached_property
    def variances(self) -> Floats:
        """Return the diagonal, (k,) mm²."""
        own = [variances_without(field, self.modes, self.solver) for field in self.own]
        return np.sum(own, axis=0) + (self.shared**2).sum(axis=1)

    def covariance(self, columns: Floats) -> Floats:
        """Return it times columns (k, m)."""
        back = columns - self.solver.T @ (self.modes.T @ columns)
        found = np.sum([field.covariance(back) for field in self.own], axis=0)
        return found - self.modes @ (self.solver @ found) + self.shared @ (self.shared.T @ columns)
