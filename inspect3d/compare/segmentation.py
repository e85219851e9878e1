"""The deviation of a part as a list of regions that stand out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from inspect3d.compare.deviation_region import DeviationRegion
from inspect3d.compare.difference_covariance import DifferenceCovariance
from inspect3d.compare.region_test import region_of
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.map_covariance import MapCovariance
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.register.gauge import MAD


@dataclass(frozen=True)
class Segmentation:
    """Gather connected nodes whose deviation stands out of the usual one of the part, and of its uncertainty.

    Parameters
    ----------
    stands_out : robust scales of the map beyond which a deviation does
    certain : standard uncertainties by which it must differ from zero
    least : nodes of a region
    most : regions, the largest in volume
    """

    stands_out: float = 3.0
    certain: float = 2.0
    least: int = 3
    most: int = 20

    def __call__(
        self, deviation: Deviation, covariance: MapCovariance, mesh: InspectionMesh
    ) -> tuple[DeviationRegion, ...]:
        """Return the regions of a map, by the volume of material too much or missing."""
        at = covariance.node
        value, sigma = deviation.value[at], deviation.sigma[at]
        scale = MAD * float(np.median(np.abs(value - np.median(value))))
        out = (np.abs(value) > self.stands_out * scale) & (np.abs(value) > self.certain * sigma)
        sign = np.zeros(len(mesh), np.int64)
        sign[at[out]] = np.sign(value[out])
        sides = mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        sides = sides[(sign[sides[:, 0]] == sign[sides[:, 1]]) & (sign[sides[:, 0]] != 0)]
        graph = sparse.csr_matrix((np.ones(len(sides)), sides.T), (len(mesh), len(mesh)))
        label = sparse.csgraph.connected_components(graph, directed=False)[1][at]
        members = np.flatnonzero(out)
        _, name, count = np.unique(label[members], return_inverse=True, return_counts=True)
        areas = mesh.areas[at]
        volume = np.abs(np.bincount(name, value[members] * areas[members], minlength=len(count)))
        large = np.flatnonzero(count >= self.least)
        found, whole = [], _whole(covariance)
        for k in large[np.argsort(-volume[large], kind="stable")][: self.most]:
            region = region_of(members[name == k], value, whole, mesh.nodes[at], areas, None)
            found.append(replace(region, nodes=at[region.nodes]))
        return tuple(found)


def _whole(covariance: MapCovariance) -> DifferenceCovariance:
    """Return the covariance of a map with what its nodes share."""
    k = len(covariance.node)
    shared = np.column_stack([covariance.pose, np.full(k, covariance.coating[1]), np.full(k, covariance.calibration)])
    return DifferenceCovariance((covariance.own,), np.zeros((k, 0)), np.zeros((0, k)), shared)
