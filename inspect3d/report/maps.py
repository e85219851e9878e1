"""The maps as files: the inspection mesh with its deviations, and the measured points, for any VTK reader."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.record import MeasuredPart
from inspect3d.report.triangulated import triangulated

if TYPE_CHECKING:
    from pyvista import PolyData


def map_polydata(mesh: InspectionMesh, part: MeasuredPart) -> PolyData:
    """Return the inspection mesh in the CAD frame with the point arrays of the contract.

    `deviation` and `sigma` are float64 in mm and NaN where the node is not observed; `observed` and `crease` are
    uint8; `verdict` is int8: 0 none, 1 conform, 2 undecided, 3 nonconform; `Normals` are the outward normals.
    Stereo methods add `residual`, float64 and NaN where no facet around the node was measured; isogeometric ones
    `unresolved`, uint8: 1 where the part has a shape that their splines do not follow.

    Raises
    ------
    ValueError
        The measurement ended without a map, or its map belongs to another mesh.
    """
    if part.deviation is None:
        raise ValueError(f"{part.name} has no map")
    if len(part.deviation.value) != len(mesh):
        raise ValueError(f"the map of {part.name} has {len(part.deviation.value)} values for {len(mesh)} nodes")
    observed = part.deviation.observed
    verdict = np.zeros(len(mesh)) if part.verdict is None else np.where(observed, part.verdict, 0)
    polydata = triangulated(mesh.nodes, mesh.triangles)
    polydata.point_data["deviation"] = np.where(observed, part.deviation.value, np.nan)
    polydata.point_data["sigma"] = np.where(observed, part.deviation.sigma, np.nan)
    polydata.point_data["observed"] = observed.astype(np.uint8)
    polydata.point_data["crease"] = mesh.crease.astype(np.uint8)
    polydata.point_data["verdict"] = verdict.astype(np.int8)
    if part.residual is not None:
        polydata.point_data["residual"] = np.array(part.residual)
    if part.unresolved is not None:
        polydata.point_data["unresolved"] = (observed & part.unresolved).astype(np.uint8)
    polydata.point_data.active_normals = np.array(mesh.normals)
    return polydata


def cloud_polydata(part: MeasuredPart) -> PolyData:
    """Return the measured points in the CAD frame, in the order of the files, with their `deviation` in mm.

    Raises
    ------
    ValueError
        The method measures no points, or some lack their deviation.
    """
    from pyvista import PolyData

    if part.points_cad is None or part.point_deviation is None:
        raise ValueError(f"{part.name} has no points with deviations")
    if len(part.points_cad) != len(part.point_deviation):
        raise ValueError(f"{part.name} has {len(part.point_deviation)} deviations for {len(part.points_cad)} points")
    polydata = PolyData(np.array(part.points_cad))
    polydata.point_data["deviation"] = np.array(part.point_deviation)
    return polydata
