"""The one alignment that two maps are brought into before they are compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from inspect3d.arrays import Floats, Integers
from inspect3d.compare.difference_covariance import DifferenceCovariance
from inspect3d.compare.measured_map import MeasuredMap
from inspect3d.deviate.map_covariance import Selected
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.register.gauge import Gauge, best_fit

LEFT = 1e-3  # share of a weak motion that must be left beside the rigid ones for it to be one of its own
PROBABILITY = 0.95  # that such motions in the difference are more than chance
ROUNDS = 50
STAYING = "Both maps stay in the poses they were given; no motion is taken out of their difference."
SETTLED = 1e-4  # of the largest area: change of the weights at which the fit ends


@dataclass(frozen=True, eq=False)
class CommonGauge:
    """The linear map G = I - J M that takes the same motions out of both maps.

    Parameters
    ----------
    modes : J (k, q), what the motions do to the deviations of the common nodes
    solver : M (q, k), the motions in a map
    weak : how many of them, the last ones, are motions that a method hardly tells from errors of its cameras
    same_coat : whether both maps have the same coating, whose error cancels
    words : which alignment it is, a sentence
    """

    modes: Floats
    solver: Floats
    weak: int
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

    def taken(self, difference: Floats, a: MeasuredMap, b: MeasuredMap, at: Integers) -> tuple[str, ...]:
        """Return how large the weak motions in a - b (k,) mm are beside what is stated for them, a sentence or none."""
        if not self.weak:
            return ()
        weak = self.solver[-self.weak :]
        own = [Selected(each.covariance.own, np.searchsorted(each.covariance.node, at)) for each in (a, b)]
        stated = sum((weak @ field.covariance(np.ascontiguousarray(weak.T)) for field in own), np.zeros(()))
        sizes = weak @ difference
        clear = sizes @ np.linalg.solve(stated, sizes) > chi2.ppf(PROBABILITY, self.weak)
        found, uncertain = 1000 * np.linalg.norm(sizes), 1000 * np.sqrt(np.trace(stated))
        judged = "more than their stated uncertainties explain" if clear else "as their stated uncertainties allow"
        return (
            f"In the motions that the pictures hardly tell, {a.name} and {b.name} differ by {found:.1f} µm (root mean "
            f"square; standard uncertainty {uncertain:.1f} µm): {judged}.",
        )


def common_gauge(a: MeasuredMap, b: MeasuredMap, mesh: InspectionMesh, at: Integers) -> CommonGauge:
    """Return the common alignment of two maps over their common nodes `at` (k,).

    It is the robust best fit of their difference, so that a defect which only one of them shows does not tilt it. The
    scale goes from both if one cannot tell it, and so do the motions that the pictures of one hardly tell from errors
    of its cameras: a large and slow error that it states itself must not hide the small and local ones. Two maps that
    were both held in a given pose keep their places.
    """
    same_coat = a.covariance.coating == b.covariance.coating and a.covariance.coating[1] > 0
    weak = np.concatenate([c.weak[np.searchsorted(c.node, at)] for c in (a.covariance, b.covariance)], axis=1)
    placed = not (a.covariance.refined or b.covariance.refined)
    if placed and not weak.shape[1]:
        return CommonGauge(np.zeros((len(at), 0)), np.zeros((0, len(at))), 0, same_coat, STAYING)
    growth = not (a.covariance.scale_known and b.covariance.scale_known)
    difference = a.deviation.value[at] - b.deviation.value[at]
    places = mesh.nodes[at], mesh.normals[at], mesh.areas[at]
    gauge, remains = best_fit(*places, difference, growth), difference
    for _ in range(ROUNDS):
        modes, solver, count = _beside(gauge, weak, placed)
        if not count:
            break
        before, remains = gauge, difference - modes @ (solver @ difference)
        gauge = best_fit(*places, remains, growth)
        if np.abs(gauge.weights - before.weights).max() < SETTLED * mesh.areas[at].max():
            break
    words = _words(a, b, placed, growth, count)
    return CommonGauge(modes, solver, count, same_coat, words)


def _beside(gauge: Gauge, weak: Floats, placed: bool) -> tuple[Floats, Floats, int]:
    """Return J and M of the rigid motion, unless the maps stay in their places, and of the weak motions besides.

    What the rigid motion cannot take of the weak ones is made orthonormal in the weights W: B' W B = I, so that B' W
    finds it.
    """
    k = len(weak)
    rigid, solver = (np.zeros((k, 0)), np.zeros((0, k))) if placed else (gauge.jacobian, gauge.solver)
    root = np.sqrt(gauge.weights / gauge.weights.sum())[:, None]
    left = weak - rigid @ (solver @ weak)
    _, sizes, mixes = np.linalg.svd(root * left, full_matrices=False)
    kept = sizes > LEFT
    basis = left @ (mixes[kept].T / sizes[kept])
    return np.column_stack([rigid, basis]), np.concatenate([solver, (root**2 * basis).T]), int(kept.sum())


def _words(a: MeasuredMap, b: MeasuredMap, placed: bool, growth: bool, weak: int) -> str:
    motions = [] if placed else [f"the rigid motion{' and the scale' if growth else ''} between the two maps"]
    if weak:
        which = " and ".join(each.name for each in (a, b) if each.covariance.weak.shape[1])
        number = "a motion" if weak == 1 else f"{weak} motions"
        motions.append(f"{number} of cameras and shape together that the pictures of {which} hardly tell")
    if not motions:
        return STAYING
    taken = " and ".join(motions)
    verb = "is" if len(motions) == 1 and weak < 2 else "are"
    return f"{taken[0].upper()}{taken[1:]} {verb} taken out of both, by a robust best fit over their common nodes."
