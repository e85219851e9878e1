"""A picture of any field of a finished inspection, from any side."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.outcome import InputError, Status
from inspect3d.recipe import Interval
from inspect3d.report.colours import (
    ColourScale,
    deviation_scale,
    mark_scale,
    rising_limits,
    rising_scale,
    symmetric_limits,
    verdict_scale,
)
from inspect3d.report.layout import Layout
from inspect3d.report.picture import Caption, Picture
from inspect3d.report.scene import scene
from inspect3d.report.viewpoint import Viewpoint

if TYPE_CHECKING:
    from pyvista import PolyData

MARKS = {"observed": "measured", "crease": "on an edge"}
LEAST = 200
"""Pixels of a side below which the words on a picture are not readable."""


def screenshot(
    out: Path,
    file: Path,
    *,
    name: str | None = None,
    field: str = "deviation",
    view: str | tuple[float, float] = "iso",
    size: tuple[int, int] = (1600, 1200),
    limits: Interval | None = None,
) -> None:
    """Write a picture of one field of a map as PNG.

    Parameters
    ----------
    out : folder of a finished inspection
    file : the picture to write
    name : of the measurement; default: the first with a map
    field : a point array of the map: deviation, sigma, verdict, observed, crease, ...
    view : "iso", "front", "+x", "-y+z", ..., or (azimuth, elevation) in degrees
    size : width and height, px
    limits : values at the ends of the colour bar; default: such that suit the field

    Raises
    ------
    InputError
        The folder holds no inspection, the measurement no map, the map no such field; or the view, the size, the
        limits or the file are no good.
    """
    if file.suffix.lower() != ".png":
        raise InputError(f"{file.name} is not a PNG file: a screenshot is, so let its name end in .png.")
    if min(size) < LEAST or max(size) > 10_000:
        raise InputError(f"A picture of {size[0]} × {size[1]} px cannot be drawn; use {LEAST} to 10000 px a side.")
    if limits is not None and not (np.isfinite(limits).all() and limits[0] < limits[1]):
        raise InputError(f"The limits of the colours rise, unlike {limits[0]:g} to {limits[1]:g}.")
    viewpoint = Viewpoint.of(view)
    results = _results(out)
    name = _with_map(out, results, name)
    polydata = _map(out / f"{name}.vtp")
    values = _field(polydata, name, field)
    mesh = _mesh(polydata)
    scale = _scale(field, values, mesh, limits)
    caption = Caption(str(results["part"]["name"]), f"{name}: {_words(field)}")
    tolerance = results["part"].get("tolerance") if field == "deviation" else None
    picture = Picture(mesh, Layout(*size), caption, scale, tolerance=tuple(tolerance) if tolerance else None)
    if scale.classes:
        values = np.where(values == 0, np.nan, values)
    with scene(mesh.nodes, mesh.triangles, values, scale, picture.layout.window) as window:
        canvas = picture.taken(window, viewpoint)
    try:
        canvas.save(file)
    except OSError as error:
        raise InputError(f"{file} cannot be written ({error.strerror}): choose another place.") from error


def _results(out: Path) -> dict[str, Any]:
    try:
        results: dict[str, Any] = json.loads((out / "results.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise InputError(f"{out} holds no inspection: name the folder that `inspect3d run` wrote.") from None
    return results


def _with_map(out: Path, results: dict[str, Any], name: str | None) -> str:
    status = {key: Status(value["status"]) for key, value in results["measurements"].items()}
    with_map = [key for key, each in status.items() if each.has_map]
    if not with_map:
        raise InputError(f"No measurement in {out} has a map; results.json says why.")
    if name is None:
        return with_map[0]
    if name not in status:
        raise InputError(f"{out} holds no measurement {name!r}; it holds {', '.join(map(repr, status))}.")
    if name not in with_map:
        raise InputError(f"{name!r} has no map, as it ended {status[name].value}; results.json says why.")
    return name


def _map(file: Path) -> PolyData:
    import pyvista

    if not file.is_file():
        raise InputError(f"{file} is missing: run the inspection again.")
    polydata = pyvista.read(file)
    if not isinstance(polydata, pyvista.PolyData) or polydata.n_points == 0:
        raise InputError(f"{file} is not a map of inspect3d: run the inspection again.")
    return polydata


def _field(polydata: PolyData, name: str, field: str) -> Floats:
    fields = [key for key, values in polydata.point_data.items() if np.asarray(values).ndim == 1]
    if field not in fields:
        raise InputError(f"The map of {name!r} has no field {field!r}; it has {', '.join(fields)}.")
    return np.asarray(polydata.point_data[field], dtype=np.float64)


def _mesh(polydata: PolyData) -> InspectionMesh:
    return InspectionMesh(
        nodes=np.asarray(polydata.points, dtype=np.float64),
        triangles=np.asarray(polydata.regular_faces, dtype=np.int64),
        normals=np.asarray(polydata.point_data["Normals"], dtype=np.float64),
        crease=np.asarray(polydata.point_data["crease"], dtype=bool),
        face=np.full(polydata.n_points, -1, dtype=np.int64),
    )


def _scale(field: str, values: Floats, mesh: InspectionMesh, limits: Interval | None) -> ColourScale:
    if field == "verdict":
        return verdict_scale()
    if field in MARKS:
        return mark_scale(field.capitalize(), MARKS[field])
    shown = np.isfinite(values)
    values, areas = values[shown], mesh.areas[shown]
    if field == "deviation" or (len(values) and values.min() < 0):
        scale = deviation_scale(limits or symmetric_limits(values, areas))
        return scale if field == "deviation" else scale.renamed(field.capitalize(), "")
    title, unit = ("Uncertainty", "mm") if field == "sigma" else (field.capitalize(), "")
    return rising_scale(title, unit, limits or rising_limits(values, areas))


def _words(field: str) -> str:
    known = {
        "deviation": "deviation from the CAD model",
        "sigma": "standard uncertainty of the deviation (k = 1)",
        "verdict": "verdict of the tolerance",
    }
    return known.get(field, field)
