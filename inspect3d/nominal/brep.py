"""The exact part: the trimmed faces and edges of a boundary representation (STEP, IGES)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers, floats, unit
from inspect3d.nominal.closest_parameters import closest_parameters

_OWNED = 5e-7
_POLE = 1e-10
_BORDER = 1e-6
_COMPASS = np.stack([np.cos(np.arange(8) * np.pi / 4), np.sin(np.arange(8) * np.pi / 4)], axis=1)
_HAIRS = (np.zeros(2), *(length * direction for length in (1e-6, 1e-5, 1e-4, 1e-3, 2e-2) for direction in _COMPASS))
"""Steps in mm to try from a border, the shortest first."""


@dataclass(frozen=True, eq=False)
class Brep:
    """Exact faces and edges in mm, as OpenCASCADE holds them.

    Faces are numbered from 1 in the order of the file (`TopExp::MapShapes`), as a recipe names them; edges from 0.

    Parameters
    ----------
    shape : `TopoDS_Shape` that holds everything
    faces : `TopoDS_Face`, number 1 first
    edges : `TopoDS_Edge`
    edge_faces : for each edge the numbers of the faces it bounds; one at a rim or a seam
    edge_tolerance : (number of edges,) mm, how far faces may gape along an edge by the model's own word
    """

    shape: Any
    faces: tuple[Any, ...]
    edges: tuple[Any, ...]
    edge_faces: tuple[tuple[int, ...], ...]
    edge_tolerance: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "edge_tolerance", floats(self.edge_tolerance, "edge_tolerance", len(self.edges)))

    @cached_property
    def surfaces(self) -> tuple[Any, ...]:
        """Return a `BRepAdaptor_Surface` for each face."""
        from OCP.BRepAdaptor import BRepAdaptor_Surface

        return tuple(BRepAdaptor_Surface(face) for face in self.faces)

    @cached_property
    def curves(self) -> tuple[Any | None, ...]:
        """Return a `BRepAdaptor_Curve` for each edge; None where the edge is a point (the pole of a sphere)."""
        from OCP.BRep import BRep_Tool
        from OCP.BRepAdaptor import BRepAdaptor_Curve

        return tuple(None if BRep_Tool.Degenerated_s(edge) else BRepAdaptor_Curve(edge) for edge in self.edges)

    @cached_property
    def edge_numbers(self) -> Any:
        """Return an indexed map in which the number of an edge is its place in `edges`, from 1."""
        from OCP.TopTools import TopTools_IndexedMapOfShape

        numbers = TopTools_IndexedMapOfShape()
        for edge in self.edges:
            numbers.Add(edge)
        return numbers

    @cached_property
    def diagonal(self) -> float:
        """Return the diagonal of a box that holds the part, mm; up to a few percent too long."""
        from OCP.Bnd import Bnd_Box
        from OCP.BRepBndLib import BRepBndLib

        box = Bnd_Box()
        BRepBndLib.Add_s(self.shape, box, False)
        return box.CornerMin().Distance(box.CornerMax())

    def turned(self) -> Brep:
        """Return the same part with inside and outside exchanged."""
        from OCP.TopoDS import TopoDS

        return replace(
            self, shape=self.shape.Reversed(), faces=tuple(TopoDS.Face_s(face.Reversed()) for face in self.faces)
        )

    def points_at(self, face: Integers, uv: Floats) -> Floats:
        """Return the points (n, 3) mm at the parameters uv (n, 2) of the faces numbered `face` (n,)."""
        return self._by_face(face, uv, _points)

    def normals_at(self, face: Integers, uv: Floats) -> Floats:
        """Return the unit normals (n, 3), out of the material, at the parameters uv (n, 2) of the faces `face` (n,)."""
        from OCP.TopAbs import TopAbs_Orientation

        reversed_face = np.array([f.Orientation() == TopAbs_Orientation.TopAbs_REVERSED for f in self.faces])
        normals = self._by_face(face, uv, _natural_normals)
        return np.where(reversed_face[face - 1, None], -normals, normals)

    def project(self, points: Floats, face: Integers, guess: Floats | None = None) -> tuple[Floats, Floats]:
        """Return the closest points of given faces, disregarding their trimming, and their parameters.

        Parameters
        ----------
        points : (n, 3) mm
        face : (n,) number of the face for each point
        guess : (n, 2) parameters to start from; found by a global search, slowly, where there is none

        Returns
        -------
        feet (n, 3) mm, exactly on the surface of the face, and their parameters (n, 2)
        """
        if guess is None:
            guess = self._search(points, face)
        uv = np.array(guess, dtype=float)
        for number, members in _groups(face):
            uv[members] = closest_parameters(self.surfaces[number - 1], points[members], uv[members])
        return self.points_at(face, uv), uv

    def inside(self, face: Integers, uv: Floats) -> Booleans:
        """Tell which parameters (n, 2) lie within the trimmed region of their face, its border included."""
        from OCP.gp import gp_Pnt2d
        from OCP.TopAbs import TopAbs_State

        within = np.zeros(len(uv), dtype=bool)
        for number, members in _groups(face):
            region = self._region(number)
            states = [region.Perform(gp_Pnt2d(u, v)) for u, v in uv[members].tolist()]
            within[members] = [state != TopAbs_State.TopAbs_OUT for state in states]
        return within

    def _region(self, number: int) -> Any:
        """Return what tells the inside of a face, made once: that takes longer than asking it."""
        from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d

        if number not in self._regions:
            self._regions[number] = BRepTopAdaptor_FClass2d(self.faces[number - 1], 1e-9)
        return self._regions[number]

    @cached_property
    def _regions(self) -> dict[int, Any]:
        return {}

    def clearly_inside(self, face: Integers, uv: Floats) -> Booleans:
        """Tell which parameters (n, 2) lie within the trimmed region of their face, off its border; slower, surer."""
        from OCP.BRepClass import BRepClass_FaceClassifier
        from OCP.gp import gp_Pnt2d
        from OCP.TopAbs import TopAbs_State

        rows = zip(face.tolist(), map(self._in_range, face.tolist(), uv.tolist()), strict=True)
        regions = (BRepClass_FaceClassifier(self.faces[number - 1], gp_Pnt2d(*at), _BORDER) for number, at in rows)
        return np.array([region.State() == TopAbs_State.TopAbs_IN for region in regions], dtype=bool)

    def owned(self, face: int, uv: Floats) -> Floats:
        """Return the point (3,) at the parameters uv (2,) on the border of a face, or one a hair within the face."""
        at = self.held(face, uv)
        return self.points_at(np.array([face]), uv[None])[0] if at is None else at

    def held(self, face: int, uv: Floats) -> Floats | None:
        """Return the first point (3,) around the parameters uv (2,) that OpenCASCADE finds on a trimmed face.

        Where a face gapes from its edges, OpenCASCADE measures from a point on its border to the edge, not to the face,
        and finds only points a hair within the face.
        """
        from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
        from OCP.BRepExtrema import BRepExtrema_DistShapeShape
        from OCP.gp import gp_Pnt, gp_Vec

        surface, point, along_u, along_v = self.surfaces[face - 1], gp_Pnt(), gp_Vec(), gp_Vec()
        surface.D1(uv[0], uv[1], point, along_u, along_v)
        per_millimetre = 1.0 / np.maximum([along_u.Magnitude(), along_v.Magnitude()], 1e-12)
        for step in _HAIRS:
            near = surface.Value(*(uv + step * per_millimetre))
            vertex = BRepBuilderAPI_MakeVertex(near).Vertex()
            if BRepExtrema_DistShapeShape(vertex, self.faces[face - 1]).Value() < _OWNED:
                return np.array(near.Coord())
        return None

    def _in_range(self, face: int, uv: list[float]) -> tuple[float, float]:
        """Return the parameters less whole periods, so that they lie in the range of the face."""
        surface = self.surfaces[face - 1]
        u, v = uv
        if surface.IsUPeriodic():
            u -= np.floor((u - surface.FirstUParameter()) / surface.UPeriod()) * surface.UPeriod()
        if surface.IsVPeriodic():
            v -= np.floor((v - surface.FirstVParameter()) / surface.VPeriod()) * surface.VPeriod()
        return float(u), float(v)

    def _by_face(self, face: Integers, uv: Floats, evaluate: Callable[[Any, list], np.ndarray]) -> Floats:
        values = np.empty((len(uv), 3))
        for number, members in _groups(face):
            values[members] = evaluate(self.surfaces[number - 1], uv[members].tolist())
        return values

    def _search(self, points: Floats, face: Integers) -> Floats:
        from OCP.BRep import BRep_Tool
        from OCP.gp import gp_Pnt
        from OCP.ShapeAnalysis import ShapeAnalysis_Surface

        uv = np.empty((len(points), 2))
        for number, members in _groups(face):
            surface = ShapeAnalysis_Surface(BRep_Tool.Surface_s(self.faces[number - 1]))
            uv[members] = [surface.ValueOfUV(gp_Pnt(*point), 1e-9).Coord() for point in points[members].tolist()]
        return uv


def _groups(labels: Integers) -> list[tuple[int, Integers]]:
    order = np.argsort(labels, kind="stable")
    values, starts = np.unique(labels[order], return_index=True)
    return list(zip(values.tolist(), np.split(order, starts[1:]), strict=True)) if len(order) else []


def _points(surface: Any, uv: Sequence[tuple[float, float]]) -> np.ndarray:
    return np.array([surface.Value(u, v).Coord() for u, v in uv])


def _natural_normals(surface: Any, uv: Sequence[tuple[float, float]]) -> np.ndarray:
    """Return S_u x S_v at length one; at a pole its limit."""
    from OCP.gp import gp_Pnt, gp_Vec

    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    rows = np.empty((len(uv), 2, 3))
    for row, (u, v) in zip(rows, uv, strict=True):
        surface.D1(u, v, point, along_u, along_v)
        row[0], row[1] = along_u.Coord(), along_v.Coord()
    lengths = np.linalg.norm(rows, axis=2)
    normals = np.cross(unit(rows[:, 0]), unit(rows[:, 1]))
    singular = (lengths.min(axis=1) < _POLE * lengths.max(axis=1)) | (np.linalg.norm(normals, axis=1) < _POLE)
    for pole in np.flatnonzero(singular).tolist():
        normals[pole] = _limit_normal(surface, *uv[pole])
    return unit(normals)


def _limit_normal(surface: Any, u: float, v: float) -> np.ndarray:
    """Return the normal at a pole, where a derivative vanishes: the limit along the line that runs into it."""
    from OCP.gp import gp_Pnt, gp_Vec

    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    surface.D1(u, v, point, along_u, along_v)
    into_u, into_v = along_v.Magnitude() <= along_u.Magnitude(), along_u.Magnitude() <= along_v.Magnitude()
    middle_u = (surface.FirstUParameter() + surface.LastUParameter()) / 2
    middle_v = (surface.FirstVParameter() + surface.LastVParameter()) / 2
    near = np.empty((2, 3))
    for row, share in zip(near, (1e-4, 2e-4), strict=True):
        surface.D1(u + into_u * share * (middle_u - u), v + into_v * share * (middle_v - v), point, along_u, along_v)
        row[:] = along_u.Crossed(along_v).Coord()
    near = unit(near)
    return 2 * near[0] - near[1]
