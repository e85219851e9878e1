"""The features that a recipe asks for, from what a method measured."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from inspect3d.arrays import Floats
from inspect3d.compare.estimate import estimate
from inspect3d.compare.feature_estimate import FeatureEstimate
from inspect3d.compare.readings import Readings
from inspect3d.compare.tolerances import inside
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.map_covariance import Independent, MapCovariance, Selected
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.recipe_feature import Feature

MOST = 20_000  # points used for one feature; more are thinned evenly
REACH = 0.8  # edge lengths over which a node mixes what is around it


def features_of_nodes(
    wanted: tuple[Feature, ...], mesh: InspectionMesh, deviation: Deviation, covariance: MapCovariance
) -> tuple[FeatureEstimate, ...]:
    """Return the features that a map shows."""

    def readings(feature: Feature) -> Readings:
        at = np.flatnonzero(inside(feature.place, mesh.nodes, mesh.face) & deviation.observed)
        own = Selected(covariance.own, np.searchsorted(covariance.node, at))
        edge = mesh.edge_length
        return Readings(mesh.nodes[at], deviation.value[at], own, "nodes", edge, REACH * edge)

    return tuple(estimate(feature, readings(feature)) for feature in wanted)


def features_of_points(
    wanted: tuple[Feature, ...], mesh: InspectionMesh, points_cad: Floats, distance: Floats, noise: float
) -> tuple[FeatureEstimate, ...]:
    """Return the features that the points of a cloud show: (k, 3) and their deviations (k,) mm, NaN where none."""
    told = np.isfinite(distance)
    face = mesh.face[cKDTree(mesh.nodes).query(points_cad)[1]] if wanted else np.zeros(0, np.int64)

    def readings(feature: Feature) -> Readings:
        at = np.flatnonzero(inside(feature.place, points_cad, face) & told)
        spacing = _spacing(points_cad[at])
        at = at[:: len(at) // MOST + 1]
        own = Independent(np.full(len(at), noise**2))
        return Readings(points_cad[at], distance[at], own, "points", spacing, 0.0)

    return tuple(estimate(feature, readings(feature)) for feature in wanted)


def _spacing(points: Floats) -> float:
    """Return the median distance to the second nearest neighbour, mm: along a scanned line the nearest is too near."""
    return float(np.median(cKDTree(points).query(points, 3)[0][:, 2])) if len(points) > 2 else np.inf
