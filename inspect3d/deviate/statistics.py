"""The figures that sum up a map, weighted by the area each node stands for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inspect3d.arrays import Floats, floats


@dataclass(frozen=True)
class Statistics:
    """Location and spread of values that stand for areas, in the unit of the values.

    The weights make the figures those of the surface, whatever the mesh: halving the elements of one region does not
    let it count twice. They describe the part and say nothing about how well the mean is known: the nodes of a map
    share the pose and the noise of their points.

    Parameters
    ----------
    count : values that took part
    mean, std, rms : weighted; rms² = mean² + std²
    min, max : of the values, whatever their weight
    p05, p50, p95 : the values below which 5, 50 and 95 % of the area lie
    """

    count: int
    mean: float
    std: float
    rms: float
    min: float
    max: float
    p05: float
    p50: float
    p95: float

    @classmethod
    def of(cls, values: ArrayLike, weights: ArrayLike) -> Statistics:
        """Return the figures of values (n,) with weights (n,), the areas in any unit.

        Raises
        ------
        ValueError
            There is no value, a value is not finite, or the weights are negative or all zero.
        """
        values, weights = _checked(values, weights)
        share = weights / weights.sum()
        mean = float(share @ values)
        p05, p50, p95 = percentiles(values, weights, (5.0, 50.0, 95.0))
        return cls(
            count=len(values),
            mean=mean,
            std=float(np.sqrt(share @ (values - mean) ** 2)),
            rms=float(np.sqrt(share @ values**2)),
            min=float(values.min()),
            max=float(values.max()),
            p05=float(p05),
            p50=float(p50),
            p95=float(p95),
        )


def percentiles(values: ArrayLike, weights: ArrayLike, percent: ArrayLike) -> Floats:
    """Return the values below which the asked percentages of the weight lie.

    A value sits in the middle of its own weight; between two values the percentile is linear. With equal weights that
    is Hazen's plotting position, so that the 50th percentile is the usual median.

    Parameters
    ----------
    values : (n,)
    weights : (n,), not negative; a value of weight zero counts for nothing
    percent : (k,) in [0, 100]

    Raises
    ------
    ValueError
        There is no value, a value is not finite, or the weights are negative or all zero.
    """
    values, weights = _checked(values, weights)
    values, weights = values[weights > 0], weights[weights > 0]
    order = np.lexsort((weights, values))
    values, weights = values[order], weights[order]
    middle = np.cumsum(weights) - weights / 2.0
    return np.interp(np.asarray(percent, dtype=np.float64) / 100.0, middle / weights.sum(), values)


def _checked(values: ArrayLike, weights: ArrayLike) -> tuple[Floats, Floats]:
    values = floats(values, "values", None)
    weights = floats(weights, "weights", len(values))
    if len(values) == 0:
        raise ValueError("there are no values to sum up")
    if (weights < 0).any() or not weights.sum() > 0:
        raise ValueError("the weights are areas: none negative, and not all zero")
    return values, weights
