"""Where the faces of a B-rep border on each other."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from inspect3d.arrays import Floats
from inspect3d.nominal.brep import Brep
from inspect3d.nominal.sewing import GAP

LEAST, MOST = 6, 200


@dataclass(frozen=True, eq=False)
class Border:
    """Places along an edge that two faces share, or one face with itself at a seam; or along two edges that coincide.

    Parameters
    ----------
    faces : numbers of the two
    points : (s, 3) mm, on the edge
    along : (2, s, 3), unit, along the edge, such that each face lies to the left, seen from outside
    """

    faces: tuple[int, int]
    points: Floats
    along: Floats


def borders(brep: Brep, faces: Collection[int], spacing: float) -> tuple[Border, ...]:
    """Return the borders between some faces, by number, and their seams, with a place about every `spacing` mm.

    Faces that do not share an edge border on each other where one of theirs runs all along another, nearer than what is
    sewn in an IGES file.
    """
    sides: dict[int, list[tuple[int, bool]]] = {}
    for number in faces:
        for edge, reversed_there in _sides(brep, number):
            sides.setdefault(edge, []).append((number, reversed_there))
    found = []
    for edge, both in sorted(sides.items()):
        curve = brep.curves[edge]
        if len(both) == 2 and curve is not None:
            points, along = _placed(curve, spacing)
            turned = np.stack([-along if reversed_there else along for _, reversed_there in both])
            found.append(Border((both[0][0], both[1][0]), points, turned))
    rims = {edge: both[0] for edge, both in sides.items() if len(both) == 1 and len(brep.edge_faces[edge]) == 1}
    return (*found, *_touching(brep, rims, spacing))


def _touching(brep: Brep, rims: dict[int, tuple[int, bool]], spacing: float) -> Iterator[Border]:
    """Yield the borders of faces along rims that coincide; of each rim its face, and whether it is turned round."""
    placed = {}
    for edge, (_, reversed_there) in rims.items():
        if (curve := brep.curves[edge]) is not None:
            points, along = _placed(curve, spacing)
            placed[edge] = points, -along if reversed_there else along
    trees = {edge: cKDTree(points) for edge, (points, _) in placed.items()}
    for one, other in combinations(placed, 2):
        shorter, longer = sorted((one, other), key=lambda edge: _length(brep.curves[edge]))
        points, along = placed[shorter]
        away, nearest = trees[longer].query(points)
        if away.max() < spacing + GAP * brep.diagonal and _farthest(points, brep.edges[longer]) < GAP * brep.diagonal:
            same = np.sign((along * placed[longer][1][nearest]).sum(axis=1, keepdims=True))
            yield Border((rims[shorter][0], rims[longer][0]), points, np.stack([along, same * along]))


def _farthest(points: Floats, edge: Any) -> float:
    """Return the largest distance of points (s, 3) from an edge, mm."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.gp import gp_Pnt

    vertices = (BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex() for point in points.tolist())
    return max(BRepExtrema_DistShapeShape(vertex, edge).Value() for vertex in vertices)


def _length(curve: Any) -> float:
    from OCP.GCPnts import GCPnts_AbscissaPoint

    return float(GCPnts_AbscissaPoint.Length_s(curve))


def _sides(brep: Brep, number: int) -> list[tuple[int, bool]]:
    """Return the edges of a face, and whether it lies to the left of each only if that is turned round."""
    from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    found = []
    explorer = TopExp_Explorer(brep.faces[number - 1], TopAbs_ShapeEnum.TopAbs_EDGE)
    while explorer.More():
        edge = explorer.Current()
        found.append((brep.edge_numbers.FindIndex(edge) - 1, edge.Orientation() == TopAbs_Orientation.TopAbs_REVERSED))
        explorer.Next()
    return found


def _placed(curve: Any, spacing: float) -> tuple[Floats, Floats]:
    """Return points (s, 3) mm and unit tangents all along a curve."""
    from OCP.gp import gp_Pnt, gp_Vec

    count = int(np.clip(np.ceil(_length(curve) / spacing), LEAST, MOST))
    at = np.linspace(curve.FirstParameter(), curve.LastParameter(), 2 * count + 1)[1::2]
    point, tangent = gp_Pnt(), gp_Vec()
    points, along = np.empty((count, 3)), np.empty((count, 3))
    for k, parameter in enumerate(at.tolist()):
        curve.D1(parameter, point, tangent)
        points[k], along[k] = point.Coord(), tangent.Coord()
    return points, along / np.linalg.norm(along, axis=1, keepdims=True)
