"""A picture of any field of a finished inspection, from any side."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.outcome import InputError
from inspect3d.recipe_types import Interval
from inspect3d.report.colours import (
    ColourScale,
    deviation_scale,
    mark_scale,
    rising_limits,
    rising_scale,
    symmetric_limits,
    verdict_scale,
)
from inspect3d.report.finished import open_results
from inspect3d.report.layout import Layout
from inspect3d.report.picture import Caption, Picture
from inspect3d.report.scene import scene
from inspect3d.report.viewpoint import Viewpoint

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
    finished = open_results(out)
    found = finished.map(name)
    values, mesh = found.field(field), found.mesh
    scale = field_scale(field, values, mesh, limits)
    part = finished.values["part"]
    caption = Caption(str(part["name"]), f"{found.name}: {_words(field)}")
    tolerance = part.get("tolerance") if field == "deviation" else None
    picture = Picture(mesh, Layout(*size), caption, scale, tolerance=tuple(tolerance) if tolerance else None)
    if scale.classes:
        values = np.where(values == 0, np.nan, values)
    with scene(mesh.nodes, mesh.triangles, values, scale, picture.layout.window) as window:
        canvas = picture.taken(window, viewpoint)
    try:
        canvas.save(file)
    except OSError as error:
        raise InputError(f"{file} cannot be written ({error.strerror}): choose another place.") from error


def field_scale(field: str, values: Floats, mesh: InspectionMesh, limits: Interval | None = None) -> ColourScale:
    """Return the colours of a field of a map by its name; without limits such that suit its values."""
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
