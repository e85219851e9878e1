"""The one alignment that two maps are brought into before they are compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.compare.difference_covariance import DifferenceCovariance
from inspect3d.compare.measured_map import MeasuredMap
from inspect3d.deviate.map_covariance import Selected
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.register.gauge import best_fit


@dataclass(frozen=True, eq=False)
class CommonGauge:
    """The linear map G = I - J M that takes the same motions out of both maps.

    Parameters
    ----------
    modes : J (k, q), what the motions do to the deviations of the common nodes
    solver : M (q, k), the motions in a map
    same_coat : whether both maps have the same coating, whose error cancels
    words : which alignment it is, a sentence
    """

    modes: Floats
    solver: Floats
    same_coat: bool
    words: str

    def __call__(self, values: Floats) -> Floats:
        """Return G v of maps (k,) or (k, m) mm."""
        return values - self.modes @ (self.solver @ values)

    def covariance(self, a: MeasuredMap, b: MeasuredMap, at: Integers) -> DifferenceCovariance:
        """Return the covariance of the difference at the common nodes `at` (k,)."""
        own, shared = [], []
        for covariance in (a.covariance, b.covariance):
            rows = np.searchsorted(covariance.node, at)
            own.append(Selected(covariance.own, rows))
            shared.append(self(covariance.pose[rows]))
            if not self.same_coat:
                shared.append(self(np.full((len(at), 1), covariance.coating[1])))
            shared.append(np.full((len(at), 1), covariance.calibration))
        return DifferenceCovariance((own[0], own[1]), self.modes, self.solver, np.concatenate(shared, axis=1))


def common_gauge(a: MeasuredMap, b: MeasuredMap, mesh: InspectionMesh, at: Integers) -> CommonGauge:
    """Return the common alignment of two maps over their common nodes `at` (k,).

    It is the robust best fit of their difference, so that a defect which only one of them shows does not tilt it. The
    scale goes from both if one cannot tell it. Two maps that were both held in a given pose are compared as they are.
    """
    same_coat = a.covariance.coating == b.covariance.coating and a.covariance.coating[1] > 0
    if not (a.covariance.refined or b.covariance.refined):
        words = "Both maps stay in the poses they were given; no motion is taken out of their difference."
        return CommonGauge(np.zeros((len(at), 0)), np.zeros((0, len(at))), same_coat, words)
    growth = not (a.covariance.scale_known and b.covariance.scale_known)
    difference = a.deviation.value[at] - b.deviation.value[at]
    gauge = best_fit(mesh.nodes[at], mesh.normals[at], mesh.areas[at], difference, growth)
    what = "rigid motion and the scale" if growth else "rigid motion"
    words = f"The {what} between the two maps is taken out of both, by a robust best fit over their common nodes."
    return CommonGauge(gauge.jacobian, gauge.solver, same_coat, words)
