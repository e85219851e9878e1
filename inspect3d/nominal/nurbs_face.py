"""The faces of a B-rep as NURBS, and NURBS as faces of a STEP file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.nominal.brep import Brep
from inspect3d.nominal.nurbs import Nurbs
from inspect3d.nominal.step_iges import silence
from inspect3d.outcome import InputError

TOLERANCE = 1e-6  # mm, of the faces of a file that is written


def nurbs_of(brep: Brep, number: int, refine: int = 0, degree: int = 0) -> Nurbs:
    """Return a face of a B-rep as a NURBS surface, trimming disregarded; what is none is converted exactly.

    Parameters
    ----------
    number : of the face, from 1
    refine : how often every span between two knots is halved
    degree : to raise the surface to in both directions, where it is lower

    Raises
    ------
    InputError
        OpenCASCADE cannot convert the face.
    """
    from OCP.TopAbs import TopAbs_Orientation

    surface = _spline(brep, number)
    surface.IncreaseDegree(max(surface.UDegree(), degree), max(surface.VDegree(), degree))
    for _ in range(refine):
        _halve(surface)
    rows, columns = range(1, surface.NbUPoles() + 1), range(1, surface.NbVPoles() + 1)
    turned = brep.faces[number - 1].Orientation() == TopAbs_Orientation.TopAbs_REVERSED
    return Nurbs(
        np.array([[surface.Pole(i, j).Coord() for j in columns] for i in rows]),
        np.array([[surface.Weight(i, j) for j in columns] for i in rows]),
        np.array(list(surface.UKnotSequence())),
        np.array(list(surface.VKnotSequence())),
        turned,
    )


def write_step(surfaces: Sequence[Nurbs], path: Path) -> None:
    """Write surfaces as the faces of a STEP file (mm), as far as their knots reach: not trimmed.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    from OCP.BRep import BRep_Builder
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
    from OCP.TopoDS import TopoDS_Compound

    silence()
    together, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(together)
    for nurbs in surfaces:
        face = BRepBuilderAPI_MakeFace(surface_of(nurbs), TOLERANCE).Face()
        builder.Add(together, face.Reversed() if nurbs.reversed else face)
    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    writer.Transfer(together, STEPControl_StepModelType.STEPControl_AsIs)
    if writer.Write(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise InputError(f"{path} could not be written: check that the folder exists and can be written to.")


def surface_of(nurbs: Nurbs) -> Any:
    """Return a NURBS surface as OpenCASCADE's `Geom_BSplineSurface`."""
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array2OfPnt
    from OCP.TColStd import TColStd_Array2OfReal

    across, along = nurbs.weights.shape
    poles, weights = TColgp_Array2OfPnt(1, across, 1, along), TColStd_Array2OfReal(1, across, 1, along)
    for i in range(across):
        for j in range(along):
            poles.SetValue(i + 1, j + 1, gp_Pnt(*nurbs.poles[i, j].tolist()))
            weights.SetValue(i + 1, j + 1, float(nurbs.weights[i, j]))
    (knots_u, times_u), (knots_v, times_v) = _counted(nurbs.knots_u), _counted(nurbs.knots_v)
    return Geom_BSplineSurface(poles, weights, knots_u, knots_v, times_u, times_v, *nurbs.degrees, False, False)


def _spline(brep: Brep, number: int) -> Any:
    """Return a face's surface as a clamped B-spline in the frame of the part."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
    from OCP.Geom import Geom_BSplineSurface, Geom_RectangularTrimmedSurface
    from OCP.TopoDS import TopoDS

    try:
        converted = BRepBuilderAPI_NurbsConvert(brep.faces[number - 1], True).Shape()
        surface = BRep_Tool.Surface_s(TopoDS.Face_s(converted))
        if isinstance(surface, Geom_RectangularTrimmedSurface):
            surface = surface.BasisSurface()
    except Exception as error:  # whatever OpenCASCADE throws: its types are not Python's
        raise InputError(f"Face {number} cannot be converted to a NURBS surface ({error}).") from error
    if not isinstance(surface, Geom_BSplineSurface):
        raise InputError(f"Face {number} cannot be converted to a NURBS surface: leave it out of `faces`.")
    surface = surface.Copy()  # the part keeps its own
    surface.SetUNotPeriodic()
    surface.SetVNotPeriodic()
    return surface


def _halve(surface: Any) -> None:
    """Insert a knot into the middle of every span."""
    from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

    for knots, insert in ((surface.UKnots(), surface.InsertUKnots), (surface.VKnots(), surface.InsertVKnots)):
        at = np.array(list(knots))
        middles = (at[1:] + at[:-1]) / 2
        values, times = TColStd_Array1OfReal(1, len(middles)), TColStd_Array1OfInteger(1, len(middles))
        for k, middle in enumerate(middles.tolist(), start=1):
            values.SetValue(k, middle)
            times.SetValue(k, 1)
        insert(values, times, 0.0, True)


def _counted(knots: Floats) -> tuple[Any, Any]:
    """Return the distinct knots and how often each is repeated, as OpenCASCADE wants them."""
    from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

    distinct, times = np.unique(knots, return_counts=True)
    values, counts = TColStd_Array1OfReal(1, len(distinct)), TColStd_Array1OfInteger(1, len(distinct))
    for k, (knot, count) in enumerate(zip(distinct.tolist(), times.tolist(), strict=True), start=1):
        values.SetValue(k, knot)
        counts.SetValue(k, count)
    return values, counts
