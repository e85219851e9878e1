"""The deviation map: one signed distance and one standard uncertainty per node."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats, booleans, floats


@dataclass(frozen=True, eq=False)
class Deviation:
    """Signed distance from the nominal to the measured surface at every node, along the node's outward normal.

    Parameters
    ----------
    value : (n,) mm, positive is too much material; NaN where nothing was measured
    sigma : (n,) mm, standard uncertainty (k = 1); NaN where nothing was measured
    observed : (n,), the nodes that were measured; creases never are
    """

    value: Floats
    sigma: Floats
    observed: Booleans

    def __post_init__(self) -> None:
        n = len(self.value)
        object.__setattr__(self, "value", floats(self.value, "value", n, finite=False))
        object.__setattr__(self, "sigma", floats(self.sigma, "sigma", n, finite=False))
        object.__setattr__(self, "observed", booleans(self.observed, "observed", n))
        if not (np.isfinite(self.value) == self.observed).all():
            raise ValueError("a deviation has a value exactly where it is observed")
        if not (self.sigma[self.observed] > 0).all():
            raise ValueError("an observed node has a positive standard uncertainty")
