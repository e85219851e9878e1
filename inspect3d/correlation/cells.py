"""The elements: facets of the inspection mesh, cut along edges of the CAD."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.correlation.evaluation import EvaluationPoints
from inspect3d.nominal.brep import Brep
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.sheets import Pieces, edges_between, sheets
from inspect3d.nominal.surface import Feet

SMALLEST = 0.2  # share of a facet that makes a cell
PIECES = 0.25  # lengths of the mesh's edges
NO_EDGES = Pieces(np.zeros((0, 2, 3)), np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class Cells:
    """Facets of the inspection mesh, cut where a sheet of the CAD ends, and their nodes.

    Faces that meet at an edge are machined one by one, and the part may jump from one to the next. A facet across such
    an edge makes a cell of each sheet, with the points that lie on it and corners of its own: nodes are there once for
    each sheet around them, and move by what that sheet does, beyond its edge as well.

    Parameters
    ----------
    node : (n,) number in the inspection mesh of each node; those that a mesh node is made of stand side by side
    sheet : (n,) number of the sheet that it moves with, see `inspect3d.nominal.sheets`
    normals : (n, 3), unit, of that sheet
    own : (n,), whether the mesh node lies on that sheet
    triangles : (f, 3) nodes of each cell
    facet : (f,) number in the inspection mesh of the facet that it is part of
    part : (f,) share of the facet's points
    points : of the cells, one after the other
    edges : where the sheets meet
    """

    node: Integers
    sheet: Integers
    normals: Floats
    own: Booleans
    triangles: Integers
    facet: Integers
    part: Floats
    points: EvaluationPoints
    edges: Pieces = NO_EDGES


def whole_facets(mesh: InspectionMesh, points: EvaluationPoints) -> Cells:
    """Return the facets as they are."""
    n, f = len(mesh), len(mesh.triangles)
    alike, every = np.zeros(n, dtype=np.int64), np.ones(n, dtype=bool)
    return Cells(np.arange(n), alike, mesh.normals, every, mesh.triangles, np.arange(f), np.ones(f), points)


def cut_facets(nominal: Nominal, points: EvaluationPoints, feet: Feet) -> Cells:
    """Return the facets of a part, cut where its sheets end; see `inspect3d.nominal.sheets`.

    Parameters
    ----------
    points : of all facets
    feet : of the points on `nominal.surface`
    """
    mesh = nominal.mesh
    if not isinstance(nominal.exact, Brep) or nominal.surface_face is None:
        return whole_facets(mesh, points)
    of_face = sheets(nominal.exact)
    if np.ptp(of_face[1:]) == 0:
        return whole_facets(mesh, points)
    edges = edges_between(nominal.surface, of_face[nominal.surface_face], PIECES * mesh.edge_length)
    count = int(of_face.max()) + 1
    key = points.facet * count + of_face[nominal.surface_face[feet.triangle]]
    order = np.argsort(key, kind="stable")
    cell, starts = np.unique(key[order], return_index=True)
    facet, sheet = np.divmod(cell, count)
    copy, triangles = np.unique(mesh.triangles[facet] * count + sheet[:, None], return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    node, side = np.divmod(copy, count)
    starts = np.append(starts, len(order))
    cut = EvaluationPoints(points.places[order], points.shapes[order], starts, points.chord)
    own = of_face[mesh.face[node]] == side
    normals = mesh.normals[node]
    other = ~own | mesh.crease[node]
    normals[other] = _nearest(cut, triangles, feet.normals[order], len(node))[other]
    part = np.diff(starts) / np.bincount(points.facet, minlength=len(mesh.triangles))[facet]
    return Cells(node, side, normals, own, triangles, facet, part, cut, edges)


def _nearest(points: EvaluationPoints, triangles: Integers, normals: Floats, count: int) -> Floats:
    """Return for each node the mean of the normals (p, 3) of the points nearest to it in the cells around it."""
    sums = np.zeros((count, 3))
    for corner in range(3):
        closeness = points.shapes[:, corner]
        most = np.maximum.reduceat(closeness, points.starts[:-1])
        nearest = np.flatnonzero(closeness == most[points.facet])
        _, first = np.unique(points.facet[nearest], return_index=True)
        np.add.at(sums, triangles[:, corner], normals[nearest[first]])
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return sums / np.maximum(lengths, np.finfo(np.float64).tiny)
