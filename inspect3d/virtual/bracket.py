"""A machined L-bracket: planes, two holes, fillets, a boss; no symmetry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from inspect3d.virtual.part import Part


@dataclass(frozen=True)
class BracketSizes:
    """The sizes of the bracket, mm; `length` runs along x, `width` along y, `height` along z.

    The base lies on z = 0 and the wall stands on x = 0. The base hole is drilled along z, the wall hole along x.
    """

    length: float = 100.0
    width: float = 80.0
    height: float = 60.0
    thickness: float = 12.0
    corner: float = 8.0  # radius of the fillet between base and wall
    rounding: tuple[float, float] = (6.0, 14.0)  # radii of the free corners of the base, at y = 0 and y = width
    base_hole: tuple[float, float, float] = (72.0, 24.0, 9.0)  # x, y, radius
    wall_hole: tuple[float, float, float] = (54.0, 40.0, 5.5)  # y, z, radius
    boss: tuple[float, float, float, float] = (66.0, 57.0, 12.0, 10.0)  # x, y, radius, height above the base
    boss_foot: float = 2.5  # radius of the fillet around the foot of the boss


def bracket(sizes: BracketSizes | None = None) -> Part:
    """Return the bracket, by default about 100 x 80 x 60 mm."""
    chosen = sizes or BracketSizes()
    return Part("bracket", lambda: _shape(chosen))


def _shape(sizes: BracketSizes) -> Any:
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
    from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    base = BRepPrimAPI_MakeBox(sizes.length, sizes.width, sizes.thickness).Shape()
    wall = BRepPrimAPI_MakeBox(sizes.thickness, sizes.width, sizes.height).Shape()
    x, y, radius, height = sizes.boss
    boss_axis = gp_Ax2(gp_Pnt(x, y, 0.0), gp_Dir(0, 0, 1))
    boss = BRepPrimAPI_MakeCylinder(boss_axis, radius, sizes.thickness + height).Shape()
    body = _unified(BRepAlgoAPI_Fuse(BRepAlgoAPI_Fuse(base, wall).Shape(), boss).Shape())

    fillets = BRepFilletAPI_MakeFillet(body)
    near, far = sizes.rounding
    fillets.Add(sizes.corner, _edge_at(body, (sizes.thickness, sizes.width / 2, sizes.thickness)))
    fillets.Add(near, _edge_at(body, (sizes.length, 0.0, sizes.thickness / 2)))
    fillets.Add(far, _edge_at(body, (sizes.length, sizes.width, sizes.thickness / 2)))
    fillets.Add(sizes.boss_foot, _edge_at(body, (x - radius, y, sizes.thickness)))
    body = fillets.Shape()

    x, y, radius = sizes.base_hole
    base_drill = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, -1.0), gp_Dir(0, 0, 1)), radius, sizes.thickness + 2.0)
    y, z, radius = sizes.wall_hole
    wall_drill = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(-1.0, y, z), gp_Dir(1, 0, 0)), radius, sizes.thickness + 2.0)
    return BRepAlgoAPI_Cut(BRepAlgoAPI_Cut(body, base_drill.Shape()).Shape(), wall_drill.Shape()).Shape()


def _unified(shape: Any) -> Any:
    from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain

    unify = ShapeUpgrade_UnifySameDomain(shape, True, True, True)
    unify.Build()
    return unify.Shape()


def _edge_at(shape: Any, point: tuple[float, float, float]) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.gp import gp_Pnt
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopExp import TopExp
    from OCP.TopoDS import TopoDS
    from OCP.TopTools import TopTools_IndexedMapOfShape

    edges = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, TopAbs_EDGE, edges)
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex()
    every = [TopoDS.Edge_s(edges(k)) for k in range(1, edges.Extent() + 1)]
    return min(every, key=lambda edge: BRepExtrema_DistShapeShape(vertex, edge).Value())
