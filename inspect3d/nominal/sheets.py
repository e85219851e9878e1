"""Sheets: faces of a B-rep that run smoothly into each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from inspect3d.arrays import Floats, Integers, unit
from inspect3d.nominal.brep import Brep
from inspect3d.nominal.surface import Surface

SMOOTH = np.radians(1.0)


def sheets(brep: Brep) -> Integers:
    """Return the number of the sheet of each face, (faces + 1,), by the face's number; the first entry is of none.

    Faces belong to one sheet where they share an edge along which their normals differ by less than a degree. A real
    part may jump from one sheet to the next: they are machined one by one.
    """
    from OCP.BRepLib import BRepLib
    from OCP.GeomAbs import GeomAbs_Shape

    pairs = [
        pair
        for edge, pair in zip(brep.edges, brep.edge_faces, strict=True)
        if len(pair) == 2
        and BRepLib.ContinuityOfFaces_s(edge, *(brep.faces[n - 1] for n in pair), SMOOTH) != GeomAbs_Shape.GeomAbs_C0
    ]
    ends = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    count = len(brep.faces) + 1
    joined = sparse.coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    return connected_components(joined, directed=False)[1].astype(np.int64)


class Pieces(NamedTuple):
    """Straight pieces of lines on a surface: their ends (k, 2, 3) mm, and the mean normals (k, 3) beside them."""

    ends: Floats
    normals: Floats


def edges_between(surface: Surface, sheet: Integers, longest: float) -> Pieces:
    """Return the lines along which sheets meet, in pieces of at most `longest` mm.

    Parameters
    ----------
    sheet : (m,) of each triangle of the surface
    """
    ends = np.sort(np.stack([surface.triangles, np.roll(surface.triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    order = np.lexsort(ends.T)
    same = (ends[order[1:]] == ends[order[:-1]]).all(axis=1)
    one, other = order[:-1][same] // 3, order[1:][same] // 3
    apart = sheet[one] != sheet[other]
    one, other = one[apart], other[apart]
    start, end = (surface.vertices[ends[order[:-1][same][apart], k]] for k in (0, 1))
    count = np.maximum(1, np.ceil(np.linalg.norm(end - start, axis=1) / longest).astype(int))
    of = np.repeat(np.arange(len(count)), count)
    step = ((end - start) / count[:, None])[of]
    first = start[of] + (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count))[:, None] * step
    normals = unit(surface.face_normals[one] + surface.face_normals[other])
    return Pieces(np.stack([first, first + step], axis=1), normals[of])
