"""Faces that know nothing of each other, joined where their edges meet."""

from __future__ import annotations

from typing import Any

GAP = 1e-4
"""Edges nearer than this share of the diagonal are one."""


def sewn(shape: Any, faces: list[Any], diagonal: float) -> tuple[Any, list[Any]]:
    """Return a `TopoDS_Shape` with common edges, its closed shells outside out, and its faces in the order of `faces`.

    Parameters
    ----------
    shape : `TopoDS_Shape`, all of it
    faces : its `TopoDS_Face`, in the order of the file
    diagonal : mm, of the box around it
    """
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing

    sewing = BRepBuilderAPI_Sewing(GAP * diagonal)
    sewing.Load(shape)
    sewing.Perform()
    result = _outside_out(sewing.SewedShape())
    oriented = _faces_by_identity(result)
    images = (sewing.ModifiedSubShape(face) for face in faces)
    return result, [oriented.FindKey(at) for image in images if (at := oriented.FindIndex(image))]


def _outside_out(shape: Any) -> Any:
    """Make solids of the closed shells, with their normals out of the material."""
    from OCP.BRep import BRep_Builder, BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeSolid
    from OCP.BRepLib import BRepLib
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS, TopoDS_Compound

    builder, whole = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(whole)
    shells = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_SHELL)
    while shells.More():
        shell = TopoDS.Shell_s(shells.Current())
        if BRep_Tool.IsClosed_s(shell):
            solid = BRepBuilderAPI_MakeSolid(shell).Solid()
            BRepLib.OrientClosedSolid_s(solid)
            builder.Add(whole, solid)
        else:
            builder.Add(whole, shell)
        shells.Next()
    loose = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE, TopAbs_ShapeEnum.TopAbs_SHELL)
    while loose.More():
        builder.Add(whole, loose.Current())
        loose.Next()
    return whole


def _faces_by_identity(shape: Any) -> Any:
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp
    from OCP.TopTools import TopTools_IndexedMapOfShape

    faces = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, TopAbs_ShapeEnum.TopAbs_FACE, faces)
    return faces
