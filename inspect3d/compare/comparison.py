"""What two methods say about the same part, side by side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats, booleans, floats
from inspect3d.compare.deviation_region import DeviationRegion


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two maps brought into one alignment, node by node; a figure is None where the data do not give it.

    Parameters
    ----------
    a, b : names of the measurements
    common : (n,), the nodes that both observed
    difference : (n,) mm, a - b in the common alignment; NaN where they are not common
    average : (n,) mm, (a + b) / 2 in the common alignment; NaN where they are not common
    sigma : (n,) mm, standard uncertainty of the difference, NaN where they are not common; None if it is not known
    reason : why there is no `sigma`, and so no E_n, or no difference at all; empty if there is
    mean, std : of the difference, mm, weighted by area
    limits_of_agreement : mm, mean -+ 1.96 std: between them lie about 95 % of the differences
    correlation : of the two maps, weighted by area
    coverage_a, coverage_b, coverage : shares of the area, creases apart, that a, b and both observed
    en_rms : root mean square of E_n over the common nodes; 0.5 where both uncertainties are true
    en_above_1 : share of the common nodes whose E_n lies above 1; 0.046 where both uncertainties are true
    regions : where the two differ beyond doubt, clearest first; with at most 5 % probability one is there by chance.
        None: not tested
    gauge : the common alignment in words, a sentence
    words : what the comparison shows, a sentence each

    Notes
    -----
    Limits of agreement: J. M. Bland, D. G. Altman, "Statistical methods for assessing agreement between two methods of
    clinical measurement", Lancet 327 (1986). E_n: ISO 13528:2022, 9.7, with the expansion factor 2.
    """

    a: str
    b: str
    common: Booleans
    difference: Floats
    average: Floats
    sigma: Floats | None
    reason: str
    mean: float | None
    std: float | None
    limits_of_agreement: tuple[float, float] | None
    correlation: float | None
    coverage_a: float
    coverage_b: float
    coverage: float
    en_rms: float | None
    en_above_1: float | None
    regions: tuple[DeviationRegion, ...] | None
    gauge: str
    words: tuple[str, ...]

    def __post_init__(self) -> None:
        n = len(self.difference)
        object.__setattr__(self, "common", booleans(self.common, "common", n))
        for name in ("difference", "average", "sigma"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, floats(getattr(self, name), name, n, finite=False))
        if (self.sigma is None) != bool(self.reason):
            raise ValueError("a comparison has either an uncertainty or a reason why it has none")

    @property
    def nodes(self) -> int:
        """Return how many nodes both observed."""
        return int(np.count_nonzero(self.common))

    @property
    def en(self) -> Floats | None:
        """Return E_n = |a - b| / (2 sigma) at each node, (n,); NaN where they are not common, None without sigma."""
        return None if self.sigma is None else np.abs(self.difference) / (2 * self.sigma)
