"""The verdict at each node: conform, undecided or nonconform, with guard bands from its uncertainty."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from inspect3d.arrays import Floats, Integers
from inspect3d.deviate.deviation import Deviation

NONE, CONFORM, UNDECIDED, NONCONFORM = range(4)


def verdict(deviation: Deviation, tolerance: Floats, probability: float) -> Integers:
    """Return 0 none, 1 conform, 2 undecided, 3 nonconform for each node, (n,).

    A node conforms where its deviation lies inside the tolerance by at least a guard band of z sigma, and fails where
    it lies outside by as much; z is the one-sided normal quantile of the probability (1.645 at 0.95).
    Nodes that were not observed, or for which there is no tolerance, have none.

    Parameters
    ----------
    deviation : the map
    tolerance : (n, 2) mm, lower and upper limit of each node; NaN where there is none
    probability : of a right decision where the node lies at the limit

    Notes
    -----
    ISO 14253-1:2017, decision rule for verifying conformity and nonconformity; JCGM 106:2012, 8.3.2 (guarded
    acceptance) for the one-sided factor.
    """
    guard = ndtri(probability) * deviation.sigma
    low, high = tolerance[:, 0], tolerance[:, 1]
    value = deviation.value
    result = np.full(len(value), UNDECIDED)
    result[(value >= low + guard) & (value <= high - guard)] = CONFORM
    result[(value < low - guard) | (value > high + guard)] = NONCONFORM
    result[~deviation.observed | np.isnan(low) | np.isnan(high)] = NONE
    return result
