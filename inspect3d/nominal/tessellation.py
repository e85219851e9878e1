"""Triangles on the faces of a B-rep, joined along its edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from inspect3d.arrays import Floats, Integers, unit
from inspect3d.nominal.brep import Brep
from inspect3d.outcome import InputError

_SAMPLE, _WORST = 200_000, 2000


@dataclass(frozen=True, eq=False)
class Tessellation:
    """Triangles whose corners lie on exact faces and know where.

    Parameters
    ----------
    brep : the exact part
    vertices : (n, 3) mm, one for all triangles around it, across faces
    triangles : (m, 3) indices, counter-clockwise seen from outside
    face : (m,) number of the face
    uv : (m, 3, 2) parameters of the corners on that face
    segments : (k, 2) vertices, the pieces of the edges, each edge once
    segment_edge : (k,) index of the edge
    segment_t : (k, 2) parameters of the edge at both ends of the piece
    """

    brep: Brep
    vertices: Floats
    triangles: Integers
    face: Integers
    uv: Floats
    segments: Integers
    segment_edge: Integers
    segment_t: Floats

    @cached_property
    def chord(self) -> float:
        """Return the largest distance from the middle of a triangle to its exact face, mm, over an even sample."""
        return float(self._worst.max())

    def share_beyond(self, distance: float) -> float:
        """Return the share of triangles, up to 1 %, whose middle is farther than `distance` mm from the exact face."""
        return np.count_nonzero(self._worst > distance) / min(len(self.triangles), _SAMPLE)

    @cached_property
    def _worst(self) -> Floats:
        """Return the distances to the exact faces of those triangles of the sample that seem to be farthest."""
        sample = np.linspace(0, len(self.triangles) - 1, min(len(self.triangles), _SAMPLE)).astype(np.int64)
        corners, guess = self.vertices[self.triangles[sample]], self.uv[sample].mean(axis=1)
        normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        exact = self.brep.points_at(self.face[sample], guess)
        rise = np.abs(((exact - corners[:, 0]) * normals).sum(axis=1))
        worst = np.argsort(rise)[-max(_WORST, len(rise) // 100) :]
        middles = corners[worst].mean(axis=1)
        feet, _ = self.brep.project(middles, self.face[sample[worst]], guess[worst])
        return np.linalg.norm(feet - middles, axis=1)


def tessellated(brep: Brep, deflection: float, angle: float = 0.3) -> Tessellation:
    """Triangulate the faces with chords below `deflection` mm and turns below `angle` rad, and join them along edges.

    Faces that meet in an edge share its discretisation, so that the triangles close where the model closes. A face
    that cannot be triangulated is missing. Chords may be longer where the model gapes along its edges.

    Raises
    ------
    InputError
        No face can be triangulated.
    """
    # Delabella is several times quicker and makes fewer folds; where it fails, the other algorithm usually does not.
    quick = _joined(brep, deflection, angle, "Delabella")
    allowed = 2 * deflection + brep.edge_tolerance.max(initial=0.0)
    if quick is not None and _faces(quick) == len(brep.faces) and quick.share_beyond(allowed) < 0.001:
        return quick
    tried = [mesh for mesh in (quick, _joined(brep, deflection, angle, "Watson")) if mesh is not None]
    if not tried:
        raise InputError("None of the model's faces can be triangulated; export it again from the CAD system.")
    return max(tried, key=lambda mesh: (_faces(mesh), -mesh.chord))


def _faces(mesh: Tessellation) -> int:
    return len(np.unique(mesh.face))


def _joined(brep: Brep, deflection: float, angle: float, algorithm: str) -> Tessellation | None:
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools
    from OCP.IMeshTools import IMeshTools_MeshAlgoType, IMeshTools_Parameters
    from OCP.Message import Message_ProgressRange

    parameters = IMeshTools_Parameters()
    parameters.Deflection, parameters.Angle, parameters.MinSize = deflection, angle, deflection
    parameters.MeshAlgo = getattr(IMeshTools_MeshAlgoType, f"IMeshTools_MeshAlgoType_{algorithm}")
    parameters.InParallel = True
    BRepTools.Clean_s(brep.shape)
    BRepMesh_IncrementalMesh(brep.shape, parameters, Message_ProgressRange())
    joined = _Join(brep)
    for number in range(1, len(brep.faces) + 1):
        joined.add(number)
    BRepTools.Clean_s(brep.shape)
    return joined.tessellation() if joined.triangles else None


class _Join:
    """Gathers the triangulations of the faces and gives common vertices one index."""

    def __init__(self, brep: Brep) -> None:
        from OCP.TopAbs import TopAbs_ShapeEnum
        from OCP.TopExp import TopExp
        from OCP.TopTools import TopTools_IndexedMapOfShape

        self.brep = brep
        self.edge_map = TopTools_IndexedMapOfShape()
        self.vertex_map = TopTools_IndexedMapOfShape()
        TopExp.MapShapes_s(brep.shape, TopAbs_ShapeEnum.TopAbs_EDGE, self.edge_map)
        TopExp.MapShapes_s(brep.shape, TopAbs_ShapeEnum.TopAbs_VERTEX, self.vertex_map)
        self.along: dict[tuple[int, int], list[int]] = {}
        self.corners: dict[int, int] = {}
        self.points: list[tuple[float, float, float]] = []
        self.triangles: list[tuple[Integers, Integers, Floats]] = []
        self.segments: list[tuple[Integers, Integers, Floats]] = []

    def add(self, number: int) -> None:
        """Take in the triangles of a face, if it has any."""
        from OCP.BRep import BRep_Tool
        from OCP.TopAbs import TopAbs_Orientation
        from OCP.TopLoc import TopLoc_Location

        face = self.brep.faces[number - 1]
        location = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face, location)
        if mesh is None or mesh.NbTriangles() == 0:
            return
        motion = location.Transformation()
        local = range(1, mesh.NbNodes() + 1)
        nodes = (mesh.Node(k) for k in local)
        points = [(node if location.IsIdentity() else node.Transformed(motion)).Coord() for node in nodes]
        uv = np.array([mesh.UVNode(k).Coord() for k in local])
        index = np.full(len(points), -1)
        poles = self._join_edges(face, mesh, location, points, index)
        for k in np.flatnonzero(index < 0):
            index[k] = self._new(points[k])
        corners = np.array([mesh.Triangle(k).Get() for k in range(1, mesh.NbTriangles() + 1)]) - 1
        if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED:
            corners = corners[:, ::-1]
        triangles = index[corners]
        whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
        self.triangles.append((triangles[whole], np.full(whole.sum(), number), _at_poles(corners, uv, poles)[whole]))

    def tessellation(self) -> Tessellation:
        empty = (np.empty((0, 2), dtype=np.int64), np.empty(0, dtype=np.int64), np.empty((0, 2)))
        columns = [np.concatenate(column) for column in zip(*self.triangles, strict=True)]
        columns += [np.concatenate(column) for column in zip(empty, *self.segments, strict=True)]
        return Tessellation(self.brep, np.array(self.points), *columns)

    def _new(self, point: tuple[float, float, float]) -> int:
        self.points.append(point)
        return len(self.points) - 1

    def _join_edges(self, face: Any, mesh: Any, location: Any, points: list, index: Integers) -> list[tuple]:
        """Give nodes along the edges of a face the index they have in the next one; return what `_at_poles` needs."""
        from OCP.BRep import BRep_Tool
        from OCP.BRepAdaptor import BRepAdaptor_Curve2d
        from OCP.TopAbs import TopAbs_ShapeEnum
        from OCP.TopExp import TopExp, TopExp_Explorer
        from OCP.TopoDS import TopoDS

        poles = []
        explorer = TopExp_Explorer(face, TopAbs_ShapeEnum.TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge_s(explorer.Current())
            explorer.Next()
            polygon = BRep_Tool.PolygonOnTriangulation_s(edge, mesh, location)
            if polygon is None:
                continue
            nodes = [polygon.Node(k) - 1 for k in range(1, polygon.NbNodes() + 1)]
            first = self._corner(TopExp.FirstVertex_s(edge), points[nodes[0]])
            last = self._corner(TopExp.LastVertex_s(edge), points[nodes[-1]])
            if BRep_Tool.Degenerated_s(edge):
                index[nodes] = first
                along = BRepAdaptor_Curve2d(edge, face)
                start, end = (np.array(along.Value(t()).Coord()) for t in (along.FirstParameter, along.LastParameter))
                poles.append((nodes, int(np.abs(end - start).argmax())))
                continue
            which = self.edge_map.FindIndex(edge) - 1
            if (which, len(nodes)) not in self.along:
                vertices = [first, *(self._new(points[k]) for k in nodes[1:-1]), last]
                t = np.array([polygon.Parameter(k) for k in range(1, len(nodes) + 1)])
                pieces = np.stack([vertices[:-1], vertices[1:]], axis=1)
                self.segments.append((pieces, np.full(len(pieces), which), np.stack([t[:-1], t[1:]], axis=1)))
                self.along[which, len(nodes)] = vertices
            index[nodes] = self.along[which, len(nodes)]
        return poles

    def _corner(self, vertex: Any, point: tuple[float, float, float]) -> int:
        which = self.vertex_map.FindIndex(vertex)
        if which == 0:
            return self._new(point)
        if which not in self.corners:
            self.corners[which] = self._new(point)
        return self.corners[which]


def _at_poles(corners: Integers, uv: Floats, poles: list[tuple[list[int], int]]) -> Floats:
    """Return the parameters of the corners (m, 3, 2); at a pole the one that it leaves open is that of the triangle.

    Parameters
    ----------
    corners : (m, 3) nodes of the triangles
    uv : (n, 2) of the nodes
    poles : nodes at a pole, and which parameter runs round it
    """
    at = uv[corners]
    for nodes, axis in poles:
        pole = np.isin(corners, nodes)
        single = pole.sum(axis=1) == 1
        others = np.where(pole, 0.0, at[:, :, axis]).sum(axis=1) / 2
        at[:, :, axis] = np.where(pole & single[:, None], others[:, None], at[:, :, axis])
    return at
