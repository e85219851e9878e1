"""The edges of a tessellated B-rep: which are sharp, where their corners lie, and exact places on them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers, unit
from inspect3d.nominal.owned import GAPE, owned
from inspect3d.nominal.remeshing import FEATURE_ANGLE
from inspect3d.nominal.sharp import corners_of_lines, sides_of
from inspect3d.nominal.tessellation import Tessellation

_OFF = 5e-7
"""An edge or a vertex that may be farther than this, mm, from the borders of its faces does not say where they meet."""

_SLIDES = np.arange(1, 11).repeat(2) / 10 * np.tile([1.0, -1.0], 10)
"""How far to slide along an edge, in shares of what is allowed, the shortest ways first."""


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


class _OnEdges(NamedTuple):
    """Places on edges: both faces, the owner first, the parameters there, mean normals, and if the faces crease."""

    faces: Integers
    uv: Floats
    normals: Floats
    crease: Booleans


@dataclass(frozen=True, eq=False)
class Lines:
    """The pieces of the edges of a tessellated B-rep.

    Parameters
    ----------
    tessellation : of the part, or of one body of it
    """

    tessellation: Tessellation

    @cached_property
    def sharp(self) -> Integers:
        """Return the segments where faces meet at more than 30 degrees or end."""
        mesh = self.tessellation
        segment = np.arange(len(mesh.segments))
        start, end = self.ends(segment)
        sides = sides_of(mesh.vertices, mesh.triangles)
        rims = sides.ends[sides.uses != 2] @ (len(mesh.vertices), 1)
        is_rim = np.isin(np.sort(mesh.segments, axis=1) @ (len(mesh.vertices), 1), rims)
        halfway = self._nearest(mesh.segment_edge, self._t(segment, np.full(len(segment), 0.5)), (start + end) / 2)
        return np.flatnonzero(is_rim | self._on_edges(mesh.segment_edge, halfway).crease)

    @cached_property
    def corners(self) -> Integers:
        """Return the vertices where sharp lines end, branch or turn, and the tips of cones."""
        lines = self.tessellation.segments[self.sharp]
        corner = corners_of_lines(self.tessellation.vertices, lines, FEATURE_ANGLE)
        tip = self._folded.copy()
        tip[lines.ravel()] = False
        return np.flatnonzero(corner | tip)

    def ends(self, segment: Integers | slice) -> tuple[Floats, Floats]:
        """Return the ends (k, 3) mm of segments."""
        pieces = self.tessellation.segments[segment]
        return self.tessellation.vertices[pieces[:, 0]], self.tessellation.vertices[pieces[:, 1]]

    def at_vertices(self, vertex: Integers) -> Placed:
        """Return the exact places of vertices, on the face of the lowest number there that holds the place."""
        around = [self._faces_around(v) for v in vertex.tolist()]
        points, face = np.empty((len(vertex), 3)), np.zeros(len(vertex), dtype=np.int64)
        brep, places = self.tessellation.brep, self.tessellation.vertices[vertex]
        for row, (faces, uv) in enumerate(around):
            off = np.linalg.norm(brep.points_at(faces[:1], uv[:1]) - places[row], axis=1) > _OFF
            points[row : row + 1], face[row : row + 1], _ = owned(brep, faces[None], uv[None], off)
        return Placed(points, self._vertex_normals[vertex], face, self._folded[vertex])

    def at_segments(self, segment: Integers, share: Floats, nodes: Floats, slide: float) -> Placed:
        """Return the exact points of edges nearest to nodes (k, 3) mm.

        Where the faces beside gape, that is where they meet, if one of them holds that place; otherwise it is on the
        face they gape from least, or of two the one with the lower number. Where they gape by more than the tolerance
        of the edge, the node slides along it to the nearest place where they do not, if there is one.

        Parameters
        ----------
        segment : (k,) near the node
        share : (k,) how far along it, to start from
        slide : mm, how far a node may slide
        """
        edge = self.tessellation.segment_edge[segment]
        tolerance = self.tessellation.brep.edge_tolerance[edge]
        t = self._nearest(edge, self._t(segment, share), nodes)
        places, off = self._at(edge, t)
        for step in (_SLIDES * slide).tolist():
            beyond = np.flatnonzero(off > tolerance)
            if not len(beyond):
                break
            tried, off[beyond] = self._at(edge[beyond], self._along(edge[beyond], t[beyond], step))
            held = off[beyond] <= tolerance[beyond]
            for target, source in zip(places, tried, strict=True):
                target[beyond[held]] = source[held]
        return places

    def across(self, segment: Integers, face: Integers) -> Integers:
        """Return the number of the face on the other side of segments, (k,); at a rim the same one."""
        beside = (self.tessellation.brep.edge_faces[e] for e in self.tessellation.segment_edge[segment].tolist())
        pairs = zip(beside, face.tolist(), strict=True)
        return np.array([next((b for b in faces if b != own), faces[0]) for faces, own in pairs], dtype=np.int64)

    def parameters(self, segment: Integers, share: Floats, face: Integers) -> Floats:
        """Return where points of segments lie in the parameters of a face beside them, (k, 2)."""
        return self._uv(self.tessellation.segment_edge[segment], face, self._t(segment, share))

    def _at(self, edge: Integers, t: Floats) -> tuple[Placed, Floats]:
        """Return places on edges at their parameters t (k,), and how far the faces beside are from them, (k,) mm."""
        on_edges = self._on_edges(edge, t)
        brep = self.tessellation.brep
        points, face, off = owned(brep, on_edges.faces, on_edges.uv, brep.edge_tolerance[edge] > _OFF)
        return Placed(points, on_edges.normals, face, on_edges.crease), off

    def _nearest(self, edge: Integers, start: Floats, nodes: Floats) -> Floats:
        """Return the parameters (k,) of the points of edges nearest to nodes (k, 3) mm, from those to start from."""
        rows = zip(edge.tolist(), start.tolist(), nodes, strict=True)
        return np.array([_closest_on_curve(self.tessellation.brep.curves[e], at, node) for e, at, node in rows])

    def _along(self, edge: Integers, t: Floats, step: float) -> Floats:
        """Return the parameters (k,) about `step` mm along edges, or the same ones where that is beyond their ends."""
        from OCP.gp import gp_Pnt, gp_Vec

        point, velocity, result = gp_Pnt(), gp_Vec(), t.copy()
        for row, (e, at) in enumerate(zip(edge.tolist(), t.tolist(), strict=True)):
            curve = self.tessellation.brep.curves[e]
            curve.D1(at, point, velocity)
            there = at + step / max(velocity.Magnitude(), 1e-300)
            if curve.FirstParameter() < there < curve.LastParameter():
                result[row] = there
        return result

    def _on_edges(self, edge: Integers, t: Floats) -> _OnEdges:
        brep = self.tessellation.brep
        rows = zip(edge.tolist(), t.tolist(), strict=True)
        on_curve = np.array([brep.curves[e].Value(at).Coord() for e, at in rows]).reshape(-1, 3)
        ends = np.array(
            [(brep.edge_faces[e][0], brep.edge_faces[e][-1]) for e in edge.tolist()], dtype=np.int64
        ).reshape(-1, 2)
        uvs = [self._border(edge, face, t, on_curve) for face in ends.T]
        gapes = [np.linalg.norm(brep.points_at(f, uv) - on_curve, axis=1) for f, uv in zip(ends.T, uvs, strict=True)]
        second = gapes[1] < gapes[0] - GAPE
        one, other = (brep.normals_at(face, uv) for face, uv in zip(ends.T, uvs, strict=True))
        both = unit(one + other)
        return _OnEdges(
            faces=np.where(second[:, None], ends[:, ::-1], ends),
            uv=np.where(second[:, None, None], np.stack(uvs[::-1], axis=1), np.stack(uvs, axis=1)),
            normals=np.where(both.any(axis=1, keepdims=True), both, one),
            crease=(one * other).sum(axis=1) < np.cos(FEATURE_ANGLE),
        )

    def _faces_around(self, vertex: int) -> tuple[Integers, Floats]:
        """Return the numbers (k,) of the faces around a vertex, the lowest first, and its parameters (k, 2) there."""
        mesh = self.tessellation
        triangle, corner = np.nonzero(mesh.triangles == vertex)
        faces, first = np.unique(mesh.face[triangle], return_index=True)
        return faces, mesh.uv[triangle[first], corner[first]]

    @cached_property
    def _curves(self) -> dict[tuple[int, int], Any]:
        return {}

    @cached_property
    def _corner_normals(self) -> Floats:
        mesh = self.tessellation
        return mesh.brep.normals_at(np.repeat(mesh.face, 3), mesh.uv.reshape(-1, 2)).reshape(-1, 3, 3)

    @cached_property
    def _vertex_normals(self) -> Floats:
        """Return the exact normals of the faces around each vertex, weighted by their angles there, (n, 3)."""
        mesh = self.tessellation
        corners = mesh.vertices[mesh.triangles]
        ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
        angle = np.arctan2(np.linalg.norm(np.cross(ahead, behind), axis=2), (ahead * behind).sum(axis=2))
        weighted = (self._corner_normals * angle[:, :, None]).reshape(-1, 3)
        at, n = mesh.triangles.ravel(), len(mesh.vertices)
        return unit(np.stack([np.bincount(at, weighted[:, k], minlength=n) for k in range(3)], axis=1))

    @cached_property
    def _folded(self) -> Booleans:
        """Tell around which vertices (n,) faces are more than 30 degrees apart: one is half of that off their mean."""
        triangles = self.tessellation.triangles
        agreement = (self._corner_normals * self._vertex_normals[triangles]).sum(axis=2)
        least = np.ones(len(self.tessellation.vertices))
        np.minimum.at(least, triangles.ravel(), agreement.ravel())
        return least < np.cos(FEATURE_ANGLE / 2)

    def _t(self, segment: Integers, share: Floats) -> Floats:
        ends = self.tessellation.segment_t[segment]
        return ends[:, 0] + share * (ends[:, 1] - ends[:, 0])

    def _uv(self, edge: Integers, face: Integers, t: Floats) -> Floats:
        rows = zip(edge.tolist(), face.tolist(), t.tolist(), strict=True)
        return np.array([self._curve_on(e, f).Value(at).Coord() for e, f, at in rows]).reshape(-1, 2)

    def _border(self, edge: Integers, face: Integers, t: Floats, points: Floats) -> Floats:
        """Return the parameters (k, 2) of the points of the border of faces that are nearest to points of its edges.

        By the book those are at the same parameter t of the edge, but not in every file.
        """
        from OCP.BRepAdaptor import BRepAdaptor_Curve

        brep = self.tessellation.brep
        uv = self._uv(edge, face, t)
        apart = np.flatnonzero(np.linalg.norm(brep.points_at(face, uv) - points, axis=1) > GAPE)
        nearest = t.copy()
        for k in apart.tolist():
            border = BRepAdaptor_Curve(brep.edges[edge[k]], brep.faces[face[k] - 1])
            nearest[k] = _closest_on_curve(border, float(t[k]), points[k])
        uv[apart] = self._uv(edge[apart], face[apart], nearest[apart])
        return uv

    def _curve_on(self, edge: int, face: int) -> Any:
        from OCP.BRepAdaptor import BRepAdaptor_Curve2d

        if (edge, face) not in self._curves:
            brep = self.tessellation.brep
            self._curves[edge, face] = BRepAdaptor_Curve2d(brep.edges[edge], brep.faces[face - 1])
        return self._curves[edge, face]


def _closest_on_curve(curve: Any, start: float, point: Floats) -> float:
    """Minimise |C(t) - p| from a start by Newton's method, within the ends of the curve."""
    from OCP.gp import gp_Pnt, gp_Vec

    at, first, second = gp_Pnt(), gp_Vec(), gp_Vec()
    low, high = curve.FirstParameter(), curve.LastParameter()
    t = start
    for _ in range(10):
        curve.D2(t, at, first, second)
        r, speed = np.array(at.Coord()) - point, np.array(first.Coord())
        speed2 = speed @ speed
        if speed2 == 0:
            break
        curvature = speed2 + r @ np.array(second.Coord())
        t, before = min(max(t - (r @ speed) / (curvature if curvature > 0 else speed2), low), high), t
        if abs(t - before) * np.sqrt(speed2) < 1e-10:
            break
    return t
