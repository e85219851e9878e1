"""The data of the 3-D views in the report.

The view is a small WebGL program of our own in the page (`templates/surface.js`, `pane.js`, `viewer.js`): an export
through trame-vtk brings a megabyte of library with every report and shows neither uncertainty nor the value under the
pointer, whereas this one adds some 30 kB to the numbers it shows.
"""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspect3d.arrays import Floats, Integers
from inspect3d.compare.comparison import Comparison
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.record import MeasuredPart, Record
from inspect3d.report.bands import bands
from inspect3d.report.colours import (
    BACK,
    UNMEASURED,
    ColourScale,
    band_scale,
    deviation_scale,
    rising_limits,
    rising_scale,
    symmetric_limits,
)
from inspect3d.report.detail import Detail, distinct
from inspect3d.report.map_scale import map_scale
from inspect3d.report.pictures import sigma_scale, spread_scale
from inspect3d.report.reading import readings
from inspect3d.report.viewpoint import Viewpoint
from inspect3d.report.worst import worst_places

NOTHING = 65_535
"""The number that stands for no value."""


def viewer_data(record: Record, start: Viewpoint) -> str:
    """Return the maps as JSON that can stand in a script element: no character in it can end the element;
    empty where there is no map.

    Coordinates and values are whole numbers of two bytes between their smallest and largest: of a part of 100 mm they
    keep 2 µm, of a map from -0.5 to 0.5 mm they keep 0.02 µm.

    Parameters
    ----------
    record : the inspection
    start : the viewpoint at the beginning
    """
    with_map = [part for part in record.parts if part.status.has_map and part.deviation is not None]
    if not with_map:
        return ""
    mesh = record.nominal.mesh
    centre = (mesh.nodes.min(axis=0) + mesh.nodes.max(axis=0)) / 2
    labelled = [each.node for part in with_map for each in readings(mesh, part, record.recipe.report.labels)]
    worst = [place.node for place in worst_places(record)]
    detail = Detail.of(mesh, [node for node in (*labelled, *worst) if node is not None])
    maps = [_map(record, part, detail) for part in with_map]
    maps += [_pair(record, each, detail) for each in record.comparisons if each.mean is not None]
    data = {
        "centre": centre.tolist(),
        "start": start.direction.tolist(),
        "nodes": [quantised(column) for column in (mesh.nodes[detail.nodes] - centre).T],
        "triangles": _packed(detail.triangles, np.uint16),
        "edges": _packed(distinct(detail.place[sharp_edges(mesh)]), np.uint16),
        "normals": _packed(np.round(127 * mesh.normals[detail.nodes]), np.int8),
        "crease": _packed(mesh.crease[detail.nodes], np.uint8),
        "unmeasured": list(UNMEASURED),
        "back": list(BACK),
        "detail": f"The 3-D views show {detail.words}; figures and tables hold all." if detail.words else "",
        "methods": len(with_map),
        "maps": maps,
    }
    return json.dumps(data, ensure_ascii=True, allow_nan=False).replace("<", "\\u003c")


def sharp_edges(mesh: InspectionMesh) -> Integers:
    """Return the edges (k, 2) on a rim, or between facets more than 30 degrees apart."""
    corners = mesh.nodes[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    edges = np.sort(np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    key = edges[:, 0] * len(mesh) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    edges, owner, key = edges[order], order // 3, key[order]
    first = np.flatnonzero(np.r_[True, np.diff(key) != 0])
    count = np.diff(np.r_[first, len(edges)])
    partner = owner[np.minimum(first + 1, len(owner) - 1)]
    cosine = np.einsum("ij,ij->i", normals[owner[first]], normals[partner])
    return edges[first[(count != 2) | (cosine < np.cos(np.radians(30.0)))]]


def _map(record: Record, part: MeasuredPart, detail: Detail) -> dict[str, Any]:
    mesh, deviation = record.nominal.mesh, part.deviation
    if deviation is None:
        return {}
    fields = [
        _field("deviation", "deviation", deviation.value[detail.nodes], map_scale(record)),
        _field("sigma", "uncertainty (k = 1)", deviation.sigma[detail.nodes], sigma_scale(record, part)),
    ]
    if part.verdict is not None:
        classes = bands(record.recipe.part, mesh, part)[detail.nodes]
        fields.append(_field("tolerance", "tolerance", np.where(classes == 0, np.nan, classes), band_scale()))
    if part.residual is not None:
        seen = deviation.observed
        limits = rising_limits(part.residual[seen], mesh.areas[seen])
        values = np.where(seen, part.residual, np.nan)[detail.nodes]
        fields.append(_field("residual", "grey-level residual", values, rising_scale("Residual", "", limits)))
    if part.sensitivity is not None and part.sensitivity.others:
        spread = part.sensitivity.spread[detail.nodes]
        fields.append(_field("alignment", "change between alignments", spread, spread_scale(record, part)))
    labels = [
        {"name": reading.name, "node": int(detail.place[reading.node])}
        for reading in readings(mesh, part, record.recipe.report.labels)
        if reading.node is not None
    ]
    return {"name": part.name, "fields": fields, "labels": labels}


def _pair(record: Record, comparison: Comparison, detail: Detail) -> dict[str, Any]:
    common, areas = comparison.common, record.nominal.mesh.areas
    difference, sigma = comparison.difference, comparison.sigma
    scale = deviation_scale(symmetric_limits(difference[common], areas[common]))
    fields = [_field("difference", "difference", difference[detail.nodes], scale)]
    if sigma is not None and comparison.en is not None:
        limits = rising_limits(sigma[common], areas[common])
        scale = rising_scale("Uncertainty", "mm", limits)
        fields.append(_field("sigma of the difference", "uncertainty (k = 1)", sigma[detail.nodes], scale))
        fields.append(_field("E_n", "E_n", comparison.en[detail.nodes], rising_scale("E_n", "", (0.0, 2.0))))
    return {"name": f"{comparison.a} \u2212 {comparison.b}", "fields": fields, "labels": []}


def _field(key: str, title: str, values: Floats, scale: ColourScale) -> dict[str, Any]:
    return {
        "key": key,
        "title": title,
        "unit": scale.unit,
        "limits": list(scale.limits),
        "colours": scale.colours.tolist() if scale.classes else _packed(scale.colours, np.uint8),
        "classes": list(scale.classes),
        "values": quantised(values),
    }


def quantised(values: Floats) -> dict[str, Any]:
    """Return values (n,) as a lowest value, a step and whole numbers; NaN is the largest of these."""
    told = np.isfinite(values)
    low = float(values[told].min()) if told.any() else 0.0
    step = float(np.ptp(values[told])) / (NOTHING - 1) if told.any() else 0.0
    codes = np.full(len(values), NOTHING)
    codes[told] = np.round((values[told] - low) / (step or 1.0))
    return {"low": low, "step": step, "codes": _packed(codes, np.uint16)}


def _packed(values: NDArray[Any], kind: type[np.generic]) -> str:
    little = np.ascontiguousarray(values).astype(np.dtype(kind).newbyteorder("<"))
    return base64.b64encode(little.tobytes()).decode()
