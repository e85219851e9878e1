"""Triangles and NURBS patches of an OpenCASCADE shape."""

from __future__ import annotations

from typing import Any

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.virtual.patch import Patch


def tessellated(
    shape: Any, chord: float, chord_inside: float
) -> tuple[tuple[Patch, ...], Floats, Floats, Integers, Integers]:
    """Return the patches, vertices, parameters, triangles and faces that make a `PartSurface`.

    Parameters
    ----------
    shape : TopoDS_Shape, mm
    chord, chord_inside : mm, of the edges and of the faces
    """
    from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IMeshTools import IMeshTools_Parameters
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    exact = BRepBuilderAPI_NurbsConvert(shape, True).Shape()
    fineness = IMeshTools_Parameters()
    fineness.Deflection, fineness.DeflectionInterior = chord, chord_inside
    fineness.Angle = fineness.AngleInterior = 0.3
    BRepMesh_IncrementalMesh(exact, fineness)

    patches, vertices, parameters, triangles, faces = [], [], [], [], []
    count = 0
    explorer = TopExp_Explorer(exact, TopAbs_FACE)
    while explorer.More():
        patch, at, corners = _face(TopoDS.Face_s(explorer.Current()))
        patches.append(patch)
        vertices.append(patch(at)[0])
        parameters.append(at)
        triangles.append(corners + count)
        faces.append(np.full(len(corners), len(patches) - 1))
        count += len(at)
        explorer.Next()
    return (
        tuple(patches),
        np.concatenate(vertices),
        np.concatenate(parameters),
        np.concatenate(triangles),
        np.concatenate(faces),
    )


def _face(face: Any) -> tuple[Patch, Floats, Integers]:
    from OCP.BRep import BRep_Tool
    from OCP.Geom import Geom_BSplineSurface
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopLoc import TopLoc_Location

    turned = face.Orientation() == TopAbs_REVERSED
    surface = BRep_Tool.Surface_s(face)
    if not isinstance(surface, Geom_BSplineSurface):
        raise TypeError(f"a face of the part is a {type(surface).__name__}, not a B-spline")
    mesh = BRep_Tool.Triangulation_s(face, TopLoc_Location())
    nodes = (mesh.UVNode(k + 1) for k in range(mesh.NbNodes()))
    at = np.array([(node.X(), node.Y()) for node in nodes])
    corners = np.array([mesh.Triangle(k + 1).Get() for k in range(mesh.NbTriangles())]) - 1
    return _patch(surface, turned), at, corners[:, ::-1] if turned else corners


def _patch(surface: Any, turned: bool) -> Patch:
    surface.SetUNotPeriodic()
    surface.SetVNotPeriodic()
    rows, columns = range(1, surface.NbUPoles() + 1), range(1, surface.NbVPoles() + 1)
    points = np.array([[(p.X(), p.Y(), p.Z()) for p in (surface.Pole(i, j) for j in columns)] for i in rows])
    weights = np.array([[surface.Weight(i, j) for j in columns] for i in rows])[..., None]
    poles = np.concatenate([weights * points, weights], axis=2)
    knots_u, knots_v = surface.UKnotSequence(), surface.VKnotSequence()
    return Patch(poles, np.array(list(knots_u)), np.array(list(knots_v)), turned)
