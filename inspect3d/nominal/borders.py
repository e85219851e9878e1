"""Where the faces of a B-rep border on each other."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.nominal.brep import Brep

LEAST, MOST = 6, 200


@dataclass(frozen=True, eq=False)
class Border:
    """Places along an edge that two faces share, or one face with itself at a seam.

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
    """Return the borders between some faces, by number, and their seams, with a place about every `spacing` mm."""
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
    return tuple(found)


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
    from OCP.GCPnts import GCPnts_AbscissaPoint
    from OCP.gp import gp_Pnt, gp_Vec

    count = int(np.clip(np.ceil(GCPnts_AbscissaPoint.Length_s(curve) / spacing), LEAST, MOST))
    at = np.linspace(curve.FirstParameter(), curve.LastParameter(), 2 * count + 1)[1::2]
    point, tangent = gp_Pnt(), gp_Vec()
    points, along = np.empty((count, 3)), np.empty((count, 3))
    for k, parameter in enumerate(at.tolist()):
        curve.D1(parameter, point, tangent)
        points[k], along[k] = point.Coord(), tangent.Coord()
    return points, along / np.linalg.norm(along, axis=1, keepdims=True)
