"""A covariance made small enough to be kept: its strongest modes, and the rest as if independent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.deviate.map_covariance import Independent
from inspect3d.measure import FieldCovariance

RANK = 256  # modes kept at the most
NUMBERS = 2e7  # of all modes together, at the most
SPARE = 8  # more columns than modes: the last ones converge slowly
LEAST = 1e-6  # share of a variance that stays independent, so that it is positive


@dataclass(frozen=True, eq=False)
class LowRank:
    """The covariance D + F F' of k values.

    Parameters
    ----------
    rest : (k,) mm², the diagonal D
    modes : F (k, r) mm
    """

    rest: Floats
    modes: Floats

    @property
    def variances(self) -> Floats:
        """Return the diagonal, (k,) mm²."""
        return self.rest + (self.modes**2).sum(axis=1)

    def covariance(self, columns: Floats) -> Floats:
        """Return it times columns (k, m)."""
        return self.rest[:, None] * columns + self.modes @ (self.modes.T @ columns)


def condensed(own: FieldCovariance) -> LowRank:
    """Return a covariance with the same variances and its strongest modes.

    What is left of the correlation of close neighbours is lost where the modes are fewer than the nodes.

    Notes
    -----
    N. Halko, P.-G. Martinsson, J. A. Tropp, "Finding structure with randomness", SIAM Review 53 (2011), 4.4 and 5.3,
    with one power iteration.
    """
    if isinstance(own, LowRank):
        return own
    variances = own.variances
    k = len(variances)
    if isinstance(own, Independent):
        return LowRank(variances, np.zeros((k, 0)))
    rank = min(RANK, k, max(int(NUMBERS // k), 1))
    columns = np.random.default_rng(0).normal(size=(k, min(rank + SPARE, k)))
    for _ in range(2):
        columns, _ = np.linalg.qr(own.covariance(columns))
    values, vectors = np.linalg.eigh(columns.T @ own.covariance(columns))
    modes = columns @ (vectors * np.sqrt(np.maximum(values, 0.0)))[:, -rank:]
    share = np.minimum(1.0, np.sqrt((1 - LEAST) * variances / np.maximum((modes**2).sum(axis=1), 1e-300)))
    modes = modes * share[:, None]
    return LowRank(variances - (modes**2).sum(axis=1), modes)
