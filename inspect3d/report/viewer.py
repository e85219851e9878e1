"""The data of the 3-D view in the report.

The view is a small WebGL program of our own in the page (`templates/viewer.js`): an export through trame-vtk brings
a megabyte of library with every report and shows neither uncertainty nor the value under the pointer, whereas this
one adds some 15 kB to the numbers it shows.
"""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspect3d.arrays import Integers
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.record import MeasuredPart, Record
from inspect3d.report.bands import bands
from inspect3d.report.colours import BACK, UNMEASURED, ColourScale, band_scale
from inspect3d.report.pictures import map_scale, sigma_scale
from inspect3d.report.reading import readings
from inspect3d.report.viewpoint import Viewpoint


def viewer_data(record: Record, start: Viewpoint) -> str:
    """Return the maps as JSON that can stand in a script element: no character in it can end the element;
    empty where there is no map.

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
    data = {
        "centre": centre.tolist(),
        "start": start.direction.tolist(),
        "nodes": _packed(mesh.nodes - centre, np.float32),
        "triangles": _packed(mesh.triangles, np.uint32),
        "edges": _packed(sharp_edges(mesh), np.uint32),
        "normals": _packed(np.round(127 * mesh.normals), np.int8),
        "crease": _packed(mesh.crease, np.uint8),
        "unmeasured": list(UNMEASURED),
        "back": list(BACK),
        "maps": [_map(record, part) for part in with_map],
    }
    return json.dumps(data, ensure_ascii=True, allow_nan=False).replace("<", "\\u003c")


def sharp_edges(mesh: InspectionMesh) -> Integers:
    """Return the edges (k, 2) on a rim, or between facets more than 30 degrees apart."""
    corners = mesh.nodes[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    edges = np.sort(np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    owner = np.repeat(np.arange(len(mesh.triangles)), 3)
    order = np.lexsort(edges.T)
    edges, owner = edges[order], owner[order]
    first = np.flatnonzero(np.r_[True, (np.diff(edges, axis=0) != 0).any(axis=1)])
    count = np.diff(np.r_[first, len(edges)])
    partner = owner[np.minimum(first + 1, len(owner) - 1)]
    cosine = np.einsum("ij,ij->i", normals[owner[first]], normals[partner])
    return edges[first[(count != 2) | (cosine < np.cos(np.radians(30.0)))]]


def _map(record: Record, part: MeasuredPart) -> dict[str, Any]:
    if part.deviation is None:
        return {}
    mesh = record.nominal.mesh
    fields = [
        {"title": "deviation", "values": _packed(part.deviation.value, np.float32)} | _scale(map_scale(record, part)),
        {"title": "uncertainty (k = 1)", "values": _packed(part.deviation.sigma, np.float32)}
        | _scale(sigma_scale(record, part)),
    ]
    if part.verdict is not None:
        classes = bands(record.recipe.part, mesh, part)
        fields.append({"title": "tolerance", "values": _packed(classes, np.float32)} | _scale(band_scale()))
    found = readings(mesh, part, record.recipe.report.labels)
    labels = [{"name": reading.name, "node": reading.node} for reading in found if reading.node is not None]
    return {"name": part.name, "fields": fields, "labels": labels}


def _scale(scale: ColourScale) -> dict[str, Any]:
    return {
        "unit": scale.unit,
        "limits": list(scale.limits),
        "colours": scale.colours.tolist() if scale.classes else _packed(scale.colours, np.uint8),
        "classes": list(scale.classes),
    }


def _packed(values: NDArray[Any], kind: type[np.generic]) -> str:
    little = np.ascontiguousarray(values).astype(np.dtype(kind).newbyteorder("<"))
    return base64.b64encode(little.tobytes()).decode()
