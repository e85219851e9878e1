"""How far a node on an edge is from the faces beside, measured with OpenCASCADE and SciPy only."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from inspect3d.nominal.brep import Brep
from inspect3d.nominal.closest_parameters import closest_parameters

CREASED = 2.5
"""Two faces at 30 degrees may meet two tolerances of their edge off it."""


class Beside(NamedTuple):
    """A face beside a node on an edge.

    Parameters
    ----------
    off : mm, from the node to the trimmed face
    tolerance : mm, of the edge; of the vertex where the node lies on one
    """

    off: float
    tolerance: float


def beside(part: Brep, face: int, node: np.ndarray, near: float = CREASED) -> list[Beside]:
    """Return the faces that share with a face an edge on which a node (3,) mm lies; none at a seam, a rim or a tip."""
    found = []
    for edge in edges_at(part, face, node, near):
        t = _parameter(part, edge, node)
        for other in set(part.edge_faces[edge]) - {face}:
            found.append(Beside(_off(part, edge, other, t, node), _foot(part, edge, node)[1]))
    return found


def edges_at(part: Brep, face: int, node: np.ndarray, near: float = CREASED) -> list[int]:
    """Return the edges of a face on which a node lies, within `near` tolerances of it."""
    own = [edge for edge, faces in enumerate(part.edge_faces) if face in faces]
    feet = [_foot(part, edge, node) for edge in own]
    return [edge for edge, (distance, tolerance) in zip(own, feet, strict=True) if distance < near * tolerance + 1e-6]


def _foot(part: Brep, edge: int, node: np.ndarray) -> tuple[float, float]:
    """Return the distance of a node from an edge, and the tolerance there."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.gp import gp_Pnt

    distance, vertex = _end(part, edge, node)
    tolerance = float(part.edge_tolerance[edge])
    if part.curves[edge] is None or distance <= max(BRep_Tool.Tolerance_s(vertex), 1e-6):
        return distance, max(tolerance, BRep_Tool.Tolerance_s(vertex))
    point = BRepBuilderAPI_MakeVertex(gp_Pnt(*node.tolist())).Vertex()
    return BRepExtrema_DistShapeShape(point, part.edges[edge]).Value(), tolerance


def _end(part: Brep, edge: int, node: np.ndarray) -> tuple[float, Any]:
    """Return the distance of a node from the nearer end of an edge, and that vertex."""
    from OCP.BRep import BRep_Tool
    from OCP.gp import gp_Pnt
    from OCP.TopExp import TopExp

    ends = [TopExp.FirstVertex_s(part.edges[edge]), TopExp.LastVertex_s(part.edges[edge])]
    return min(((BRep_Tool.Pnt_s(end).Distance(gp_Pnt(*node.tolist())), end) for end in ends), key=lambda pair: pair[0])


def _parameter(part: Brep, edge: int, node: np.ndarray) -> float:
    """Return the parameter of the point of an edge nearest to a node."""
    curve = part.curves[edge]
    return 0.0 if curve is None else _nearest(curve, node, curve.FirstParameter(), curve.LastParameter())


def _nearest(curve: Any, node: np.ndarray, first: float, last: float) -> float:
    """Return the parameter between two of the point of a curve nearest to a node, of 40 arcs the best."""

    def distance(t: float) -> float:
        return float(np.linalg.norm(np.array(curve.Value(t).Coord()) - node))

    samples = np.linspace(first, last, 41).tolist()
    step = samples[1] - samples[0]
    found = list(samples)
    for start in sorted(samples, key=distance)[:2]:
        bounds = max(first - start, -step), min(last - start, step)
        at = minimize_scalar(lambda s, start=start: distance(start + s), bounds=bounds, options={"xatol": 1e-12})
        found.append(start + float(at.x))
    return min(found, key=distance)


def _on_border(part: Brep, edge: int, face: int, t: float, point: np.ndarray) -> np.ndarray:
    """Return the point of the border of a face, near the parameter of its edge, that is nearest to a point."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve

    border = BRepAdaptor_Curve(part.edges[edge], part.faces[face - 1])
    first, last = border.FirstParameter(), border.LastParameter()
    reach = 0.05 * (last - first)
    nearest = _nearest(border, point, max(first, t - reach), min(last, t + reach))
    return np.array(border.Value(nearest).Coord())


def _off(part: Brep, edge: int, face: int, t: float, node: np.ndarray) -> float:
    """Return the distance of a node from a trimmed face: from its surface, or from its border if the foot is beyond."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve2d

    guess = np.array([BRepAdaptor_Curve2d(part.edges[edge], part.faces[face - 1]).Value(t).Coord()])
    uv = closest_parameters(part.surfaces[face - 1], node[None], guess)
    number = np.array([face])
    if part.inside(number, uv)[0]:
        return float(np.linalg.norm(part.points_at(number, uv)[0] - node))
    return float(np.linalg.norm(_on_border(part, edge, face, t, node) - node))
