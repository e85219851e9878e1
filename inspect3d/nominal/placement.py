"""Put nodes exactly on a B-rep: corners on corners, nodes of sharp edges on their curves, all others on their faces."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers, unit
from inspect3d.nominal.brep import Brep
from inspect3d.nominal.facing import closest_facing
from inspect3d.nominal.remeshing import FEATURE_ANGLE
from inspect3d.nominal.sharp import corners_of_lines, nearest_nodes, nearest_on_segments, sides_of
from inspect3d.nominal.surface import Surface
from inspect3d.nominal.tessellation import Tessellation


class Placed(NamedTuple):
    """Nodes on the exact part.

    Parameters
    ----------
    points : (n, 3) mm
    normals : (n, 3), unit
    face : (n,) number of the face that owns the node
    crease : (n,) faces around the node are more than 30 degrees apart
    """

    points: Floats
    normals: Floats
    face: Integers
    crease: Booleans


def placed(tessellation: Tessellation, nodes: Floats, normals: Floats, feature: Booleans, size: float) -> Placed:
    """Return nodes near a tessellated B-rep at their places on it.

    A node on a line where faces meet or end lies on the face of the lowest number there, at the parameters of its border, and so within
    the edge's tolerance of the others.

    Parameters
    ----------
    tessellation : of the part, or of one body of it
    nodes : (n, 3) mm, near the part
    normals : (n, 3) of the mesh they make, to tell the sides of a thin wall apart
    feature : (n,) the node belongs to a sharp edge or rim of that mesh
    size : edge length of that mesh, mm
    """
    lines = _Lines(tessellation)
    result = Placed(
        nodes.copy(), normals.copy(), np.zeros(len(nodes), dtype=np.int64), np.zeros(len(nodes), dtype=bool)
    )
    on_line = nearest_on_segments(nodes, *lines.ends(lines.sharp), size / 4)
    sharp = feature & (on_line.distance < size / 2)
    corner, which = nearest_nodes(nodes, tessellation.vertices[lines.corners], size / 10)
    sharp[corner] = False
    inside = ~sharp
    inside[corner] = False
    _assign(result, corner, lines.at_vertices(lines.corners[which]))
    _assign(result, sharp, lines.at_segments(lines.sharp[on_line.segment[sharp]], on_line.share[sharp], nodes[sharp]))
    _assign(result, inside, _on_faces(tessellation, lines, nodes[inside], normals[inside], size))
    return result


def _assign(all_nodes: Placed, where: Booleans | Integers, some: Placed) -> None:
    for target, source in zip(all_nodes, some, strict=True):
        target[where] = source


def _on_faces(tessellation: Tessellation, lines: _Lines, nodes: Floats, normals: Floats, size: float) -> Placed:
    """Project nodes onto the face whose facet is nearest; over a border onto the neighbour, or else onto the border."""
    brep = tessellation.brep
    feet, triangle = closest_facing(Surface(tessellation.vertices, tessellation.triangles), nodes, normals)
    weights = _barycentric(tessellation.vertices[tessellation.triangles[triangle]], feet)
    face = tessellation.face[triangle]
    points, uv = brep.project(feet, face, np.einsum("ij,ijk->ik", weights, tessellation.uv[triangle]))
    outside = np.flatnonzero(~brep.inside(face, uv) | (np.linalg.norm(points - feet, axis=1) > size))
    if not len(outside):
        return Placed(points, brep.normals_at(face, uv), face, np.zeros(len(nodes), dtype=bool))
    border = nearest_on_segments(feet[outside], *lines.ends(slice(None)), size / 4)
    segment, share = border.segment, border.share
    other = lines.across(segment, face[outside])
    guess = lines.parameters(segment, share, other)
    over, uv_over = brep.project(feet[outside], other, guess)
    reached = brep.inside(other, uv_over) & (np.linalg.norm(over - feet[outside], axis=1) < size)
    there, back = outside[reached], ~reached
    points[there], uv[there], face[there] = over[reached], uv_over[reached], other[reached]
    result = Placed(points, brep.normals_at(face, uv), face, np.zeros(len(nodes), dtype=bool))
    on_border = np.zeros(len(nodes), dtype=bool)
    on_border[outside[back]] = True
    _assign(result, on_border, lines.at_segments(segment[back], share[back], feet[outside[back]]))
    return result


def _barycentric(corners: Floats, points: Floats) -> Floats:
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    area2 = np.maximum((normal**2).sum(axis=1), 1e-300)
    beta = (np.cross(points - a, c - a) * normal).sum(axis=1) / area2
    gamma = (np.cross(b - a, points - a) * normal).sum(axis=1) / area2
    return np.clip(np.stack([1 - beta - gamma, beta, gamma], axis=1), 0.0, 1.0)


class _Lines:
    """The edges of a tessellated B-rep: which are sharp, where their corners lie, and what is beside them."""

    def __init__(self, tessellation: Tessellation) -> None:
        self.tessellation = tessellation
        self.brep: Brep = tessellation.brep
        self.curve_on = lru_cache(maxsize=None)(self._curve_on)
        triangles, vertices = tessellation.triangles, tessellation.vertices
        self.corner_normals = self.brep.normals_at(
            np.repeat(tessellation.face, 3), tessellation.uv.reshape(-1, 2)
        ).reshape(-1, 3, 3)
        self.vertex_normals = self._summed(self.corner_normals * _angles(vertices[triangles])[:, :, None])
        away = (self.corner_normals * self.vertex_normals[triangles]).sum(axis=2)
        spread = np.ones(len(vertices))
        np.minimum.at(spread, triangles.ravel(), away.ravel())
        self.folded = spread < np.cos(FEATURE_ANGLE / 2)
        self.sharp = np.flatnonzero(self._is_sharp())
        self.corners = self._corners()

    def ends(self, which: Integers | slice) -> tuple[Floats, Floats]:
        """Return the ends (k, 3) mm of segments."""
        pieces = self.tessellation.segments[which]
        return self.tessellation.vertices[pieces[:, 0]], self.tessellation.vertices[pieces[:, 1]]

    def at_vertices(self, vertex: Integers) -> Placed:
        """Return the exact places of vertices of the tessellation, on the face of the lowest number there."""
        tessellation = self.tessellation
        last_first = np.argsort(-tessellation.face, kind="stable")
        owner = np.zeros((len(tessellation.vertices), 2), dtype=np.int64)
        owner[tessellation.triangles[last_first].ravel()] = np.stack(
            [np.repeat(last_first, 3), np.tile(np.arange(3), len(last_first))], axis=1
        )
        triangle, corner_of = owner[vertex].T
        face = tessellation.face[triangle]
        points = self.brep.points_at(face, tessellation.uv[triangle, corner_of])
        return Placed(points, self.vertex_normals[vertex], face, self.folded[vertex])

    def at_segments(self, segment: Integers, share: Floats, nodes: Floats) -> Placed:
        """Return the nearest exact points of the edges of segments, on their faces of the lowest number."""
        edge = self.tessellation.segment_edge[segment]
        t = np.array(
            [
                _closest_on_curve(self.brep.curves[e], start, point)
                for e, start, point in zip(edge.tolist(), self._t(segment, share).tolist(), nodes, strict=True)
            ]
        )
        face = np.array([self.brep.edge_faces[e][0] for e in edge.tolist()], dtype=np.int64)
        last = np.array([self.brep.edge_faces[e][-1] for e in edge.tolist()], dtype=np.int64)
        uv = self._uv(edge, face, t)
        one, other = self.brep.normals_at(face, uv), self.brep.normals_at(last, self._uv(edge, last, t))
        normals = unit(one + other)
        return Placed(
            self.brep.points_at(face, uv),
            np.where(normals.any(axis=1, keepdims=True), normals, one),
            face,
            (one * other).sum(axis=1) < np.cos(FEATURE_ANGLE),
        )

    def across(self, segment: Integers, face: Integers) -> Integers:
        """Return the number of the face on the other side of segments, (k,); at a rim the same one."""
        beside = [self.brep.edge_faces[e] for e in self.tessellation.segment_edge[segment].tolist()]
        return np.array(
            [next((b for b in faces if b != own), faces[0]) for faces, own in zip(beside, face.tolist(), strict=True)],
            dtype=np.int64,
        )

    def parameters(self, segment: Integers, share: Floats, face: Integers) -> Floats:
        """Return where points of segments lie in the parameters of a face beside them, (k, 2)."""
        return self._uv(self.tessellation.segment_edge[segment], face, self._t(segment, share))

    def _t(self, segment: Integers, share: Floats) -> Floats:
        ends = self.tessellation.segment_t[segment]
        return ends[:, 0] + share * (ends[:, 1] - ends[:, 0])

    def _uv(self, edge: Integers, face: Integers, t: Floats) -> Floats:
        rows = zip(edge.tolist(), face.tolist(), t.tolist(), strict=True)
        return np.array([self.curve_on(e, f).Value(at).Coord() for e, f, at in rows]).reshape(-1, 2)

    def _curve_on(self, edge: int, face: int) -> Any:
        from OCP.BRepAdaptor import BRepAdaptor_Curve2d

        return BRepAdaptor_Curve2d(self.brep.edges[edge], self.brep.faces[face - 1])

    def _is_sharp(self) -> Booleans:
        segment = np.arange(len(self.tessellation.segments))
        places = self.at_segments(segment, np.full(len(segment), 0.5), sum(self.ends(slice(None))) / 2)
        sides = sides_of(self.tessellation.vertices, self.tessellation.triangles)
        n = len(self.tessellation.vertices)
        rims = sides.ends[sides.uses != 2]
        pieces = np.sort(self.tessellation.segments, axis=1)
        return places.crease | np.isin(pieces[:, 0] * n + pieces[:, 1], rims[:, 0] * n + rims[:, 1])

    def _corners(self) -> Integers:
        lines = self.tessellation.segments[self.sharp]
        corner = corners_of_lines(self.tessellation.vertices, lines, FEATURE_ANGLE)
        on_line = np.zeros(len(corner), dtype=bool)
        on_line[lines.ravel()] = True
        return np.flatnonzero(corner | (self.folded & ~on_line))

    def _summed(self, at_corners: Floats) -> Floats:
        at, n = self.tessellation.triangles.ravel(), len(self.tessellation.vertices)
        return unit(np.stack([np.bincount(at, at_corners[..., k].ravel(), minlength=n) for k in range(3)], axis=1))


def _angles(corners: Floats) -> Floats:
    """Return the angle (m, 3) rad at each corner of triangles (m, 3, 3)."""
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    return np.arctan2(np.linalg.norm(np.cross(ahead, behind), axis=2), (ahead * behind).sum(axis=2))


def _closest_on_curve(curve: Any, start: float, point: Floats) -> float:
    """Minimise |C(t) - p| from a start by Newton's method, within the ends of the curve."""
    from OCP.gp import gp_Pnt, gp_Vec

    at, first, second = gp_Pnt(), gp_Vec(), gp_Vec()
    low, high = curve.FirstParameter(), curve.LastParameter()
    t = start
    for _ in range(10):
        curve.D2(t, at, first, second)
        r = np.array(at.Coord()) - point
        speed = np.array(first.Coord())
        curvature = speed @ speed + r @ np.array(second.Coord())
        step = -(r @ speed) / (curvature if curvature > 0 else speed @ speed)
        t, before = min(max(t + step, low), high), t
        if abs(t - before) * np.sqrt(speed @ speed) < 1e-10:
            break
    return t
