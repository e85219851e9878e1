"""Stage 5: method against method, in one alignment and with what both do not know."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.compare.agreement_words import agreement_words
from inspect3d.compare.common_gauge import CommonGauge, common_gauge
from inspect3d.compare.comparison import Comparison
from inspect3d.compare.measured_map import MeasuredMap
from inspect3d.compare.region_test import RegionTest
from inspect3d.compare.resolution import unresolved
from inspect3d.deviate.statistics import Statistics
from inspect3d.measure import FieldCovariance
from inspect3d.nominal.nominal import InspectionMesh

AGREEMENT = 1.96  # standard deviations either side of the mean that hold 95 % of normal differences
LEAST_STEPPED = 0.01  # share of the nodes beside steps; fewer may come from noise
LEAST_NODES = 12  # fewer common nodes are no comparison


@dataclass(frozen=True)
class Compare:
    """Bring maps into one alignment, two at a time, and compare them node by node and by regions.

    Parameters
    ----------
    test : finds the regions in which two maps differ beyond doubt
    """

    test: RegionTest = field(default_factory=RegionTest)

    def __call__(self, maps: tuple[MeasuredMap, ...], mesh: InspectionMesh) -> tuple[Comparison, ...]:
        """Return the comparison of every pair of maps on a mesh, in their order."""
        return tuple(self.pair(a, b, mesh) for a, b in combinations(maps, 2))

    def pair(self, a: MeasuredMap, b: MeasuredMap, mesh: InspectionMesh) -> Comparison:
        """Return the comparison of two maps."""
        common = a.deviation.observed & b.deviation.observed
        at = np.flatnonzero(common)
        if len(at) < LEAST_NODES:
            return _apart(a, b, mesh)
        gauge = common_gauge(a, b, mesh, at)
        value_a, value_b = gauge(a.deviation.value[at]), gauge(b.deviation.value[at])
        difference, areas = value_a - value_b, mesh.areas[at]
        figures = Statistics.of(difference, areas)
        reason = _not_independent(a, b)
        remarks, weighed = _remarks(a, b, gauge), {}
        if not reason:
            steps = unresolved(a, b, mesh, at)
            weighed = self._weighed(difference, gauge.covariance(a, b, at), mesh, at, steps)
            weak = gauge.taken(a.deviation.value[at] - b.deviation.value[at], a, b, at)
            remarks = (*_stepped(steps, np.abs(difference) / (2 * weighed["sigma"][at])), *weak, *remarks)
        found = replace(
            _apart(a, b, mesh),
            common=common,
            difference=_spread(difference, at, len(mesh)),
            average=_spread((value_a + value_b) / 2, at, len(mesh)),
            reason=reason,
            mean=figures.mean,
            std=figures.std,
            limits_of_agreement=(figures.mean - AGREEMENT * figures.std, figures.mean + AGREEMENT * figures.std),
            correlation=_correlation(value_a, value_b, areas),
            gauge=gauge.words,
            **weighed,
        )
        return replace(found, words=agreement_words(found, remarks))

    def _weighed(
        self, difference: Floats, covariance: FieldCovariance, mesh: InspectionMesh, at: Integers, steps: Floats
    ) -> dict[str, Any]:
        """Return what the uncertainty of the difference at the common nodes `at` (k,) adds to a comparison.

        Regions count where the difference is larger than the `steps` (k,) mm beside, which each method resolves in its
        own way.
        """
        sigma = np.sqrt(covariance.variances)
        en = np.abs(difference) / (2 * sigma)
        regions = self.test(difference, covariance, mesh.nodes[at], mesh.normals[at], mesh.areas[at], steps)
        return {
            "sigma": _spread(sigma, at, len(mesh)),
            "en_rms": float(np.sqrt(np.mean(en**2))),
            "en_above_1": float(np.mean(en > 1)),
            "regions": tuple(replace(region, nodes=at[region.nodes]) for region in regions),
        }


def _apart(a: MeasuredMap, b: MeasuredMap, mesh: InspectionMesh) -> Comparison:
    """Return the comparison of two maps that have too little in common for one."""
    common = a.deviation.observed & b.deviation.observed
    nothing = np.full(len(mesh), np.nan)
    areas = np.where(mesh.crease, 0.0, mesh.areas)
    seen = [float(areas[each].sum() / areas.sum()) for each in (a.deviation.observed, b.deviation.observed, common)]
    reason = f"{a.name} and {b.name} have observed {np.count_nonzero(common)} nodes in common, too few to compare them."
    return Comparison(
        a=a.name,
        b=b.name,
        common=common,
        difference=nothing,
        average=nothing,
        sigma=None,
        reason=reason,
        mean=None,
        std=None,
        limits_of_agreement=None,
        correlation=None,
        coverage_a=seen[0],
        coverage_b=seen[1],
        coverage=seen[2],
        en_rms=None,
        en_above_1=None,
        regions=None,
        gauge="",
        words=(reason,),
    )


def _not_independent(a: MeasuredMap, b: MeasuredMap) -> str:
    """Return why the errors of two maps are not independent, or nothing."""
    shared = sorted(a.sources[key] for key in a.sources.keys() & b.sources.keys())
    if not shared:
        return ""
    files = ", ".join(shared[:3]) + (f" and {len(shared) - 3} more files" if len(shared) > 3 else "")
    return (
        f"{a.name} and {b.name} were measured from the same {files}: they share errors by an amount that is not known, "
        "so their difference has no stated uncertainty and no E_n."
    )


def _remarks(a: MeasuredMap, b: MeasuredMap, gauge: CommonGauge) -> tuple[str, ...]:
    """Return what was assumed about the errors that two maps may share, a sentence each."""
    remarks = []
    if gauge.same_coat:
        remarks.append("Both state the same coating, so it is taken for the same coat and its error cancels.")
    elif a.covariance.coating[1] and b.covariance.coating[1]:
        remarks.append("The errors of the two coatings are taken to be independent.")
    if a.covariance.calibration and b.covariance.calibration:
        remarks.append("The calibrations are taken to be those of two instruments, their errors independent.")
    return tuple(remarks)


def _stepped(steps: Floats, en: Floats) -> tuple[str, ...]:
    """Return what the search for regions allows for beside steps (k,) mm, a sentence; none where it does not matter."""
    beside = int(np.count_nonzero((steps > 0) & (en > 1)))
    if not beside or np.mean(steps > 0) < LEAST_STEPPED:
        return ()
    nodes = "One node" if beside == 1 else f"{beside} nodes"
    return (
        f"{nodes} with E_n above 1 lie{'s' * (beside == 1)} within an element of a step that both maps show: a "
        "difference up to its height counts there as one of resolution, not as a region.",
    )


def _spread(values: Floats, at: Integers, n: int) -> Floats:
    spread = np.full(n, np.nan)
    spread[at] = values
    return spread


def _correlation(a: Floats, b: Floats, areas: Floats) -> float | None:
    """Return the weighted correlation of two fields, or None where one of them is constant."""
    a, b = a - np.average(a, weights=areas), b - np.average(b, weights=areas)
    power = np.sqrt(np.average(a**2, weights=areas) * np.average(b**2, weights=areas))
    return float(np.average(a * b, weights=areas) / power) if power > 0 else None
