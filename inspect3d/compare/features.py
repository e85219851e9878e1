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
from inspect3d.deviate.map_covariance import Independent, MapCovariance, Selected, pose_errors
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.recipe_feature import Feature
from inspect3d.register.alignment import Alignment
from inspect3d.register.mobility import jacobian

MOST = 20_000  # points used for one feature; more are thinned evenly
REACH = 0.8  # edge lengths over which a node mixes what is around it


def features_of_nodes(
    wanted: tuple[Feature, ...],
    mesh: InspectionMesh,
    deviation: Deviation,
    covariance: MapCovariance,
    alignment: Alignment,
) -> tuple[FeatureEstimate, ...]:
    """Return the features that a map shows in its alignment."""

    def readings(feature: Feature) -> Readings:
        at = np.flatnonzero(inside(feature.place, mesh.nodes, mesh.face) & deviation.observed)
        own = Selected(covariance.own, np.searchsorted(covariance.node, at))
        edge = mesh.edge_length
        pose = _pose(alignment, mesh.nodes[at], mesh.normals[at])
        return Readings(mesh.nodes[at], deviation.value[at], own, pose, "nodes", edge, REACH * edge)

    return tuple(estimate(feature, readings(feature)) for feature in wanted)


def features_of_points(
    wanted: tuple[Feature, ...],
    mesh: InspectionMesh,
    points_cad: Floats,
    distance: Floats,
    noise: float,
    alignment: Alignment,
) -> tuple[FeatureEstimate, ...]:
    """Return the features that the points of a cloud show: (k, 3) and their deviations (k,) mm, NaN where none."""
    if not wanted:
        return ()
    told = np.isfinite(distance)
    node = cKDTree(mesh.nodes).query(points_cad)[1]

    def readings(feature: Feature) -> Readings:
        at = np.flatnonzero(inside(feature.place, points_cad, mesh.face[node]) & told)
        spacing = _spacing(points_cad[at])
        at = at[:: len(at) // MOST + 1]
        own = Independent(np.full(len(at), noise**2))
        pose = _pose(alignment, points_cad[at], mesh.normals[node[at]])
        return Readings(points_cad[at], distance[at], own, pose, "points", spacing, 0.0)

    return tuple(estimate(feature, readings(feature)) for feature in wanted)


def _pose(alignment: Alignment, places: Floats, normals: Floats) -> Floats:
    return pose_errors(jacobian(places, normals, alignment.origin), alignment.covariance)


def _spacing(points: Floats) -> float:
    """Return the median distance to the second nearest neighbour, mm: along a scanned line the nearest is too near."""
    return float(np.median(cKDTree(points).query(points, 3)[0][:, 2])) if len(points) > 2 else np.inf
