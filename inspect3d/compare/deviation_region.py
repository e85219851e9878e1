"""A part of the surface that stands out, as one thing: where it is, how large, and how sure."""

from __future__ import annotations

from dataclasses import dataclass

from inspect3d.arrays import Floats, Integers


@dataclass(frozen=True, eq=False)
class DeviationRegion:
    """Connected nodes whose deviation, or whose difference between two methods, stands out.

    Parameters
    ----------
    nodes : (k,) numbers of its nodes
    area : mm²
    place : (3,) mm, CAD frame, its centre
    height : mm, the largest deviation in it with its sign
    mean : mm, the mean over its area
    sigma : mm, standard uncertainty of the mean; None where the uncertainty of the map is not known
    p_value : probability of something as clear anywhere on the part by chance; None where it was not tested
    """

    nodes: Integers
    area: float
    place: Floats
    height: float
    mean: float
    sigma: float | None = None
    p_value: float | None = None

    @property
    def significance(self) -> float | None:
        """Return by how many standard uncertainties the mean differs from zero."""
        return None if self.sigma is None else abs(self.mean) / self.sigma
