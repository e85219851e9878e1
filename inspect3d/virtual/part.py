"""A part of the virtual rig: exact geometry, made with OpenCASCADE."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from inspect3d.outcome import InputError
from inspect3d.virtual.part_surface import PartSurface

STAMP = "2000-01-01T00:00:00"  # written instead of the time of day: the same part gives the same file


@dataclass(frozen=True)
class Part:
    """A part whose geometry is known exactly.

    Parameters
    ----------
    name : of the part and of its STEP file's product
    shape : makes the geometry, an OpenCASCADE `TopoDS_Shape` in mm, in the CAD frame
    """

    name: str
    shape: Callable[[], Any]

    def write_step(self, path: Path) -> None:
        """Write the part as a STEP file (AP214, mm); the same part gives the same bytes.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
        from OCP.IFSelect import IFSelect_RetDone
        from OCP.Interface import Interface_Static
        from OCP.Message import Message, Message_Alarm
        from OCP.StepBasic import StepBasic_Product
        from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
        from OCP.TCollection import TCollection_HAsciiString

        for printer in Message.DefaultMessenger_s().Printers():
            printer.SetTraceLevel(Message_Alarm)
        writer = STEPControl_Writer()
        Interface_Static.SetCVal_s("write.step.unit", "MM")
        writer.Transfer(self.shape(), STEPControl_AsIs)
        model, name = writer.Model(), TCollection_HAsciiString(self.name)
        for entity in (model.Value(k) for k in range(1, model.NbEntities() + 1)):
            if isinstance(entity, StepBasic_Product):
                entity.SetId(name)
                entity.SetName(name)
        header = APIHeaderSection_MakeHeader(model)
        header.SetName(name)
        header.SetTimeStamp(TCollection_HAsciiString(STAMP))
        if writer.Write(str(path)) != IFSelect_RetDone:
            raise InputError(f"{path} could not be written: check that the folder exists and can be written to.")

    def surface(self, chord: float = 2e-4) -> PartSurface:
        """Return the exact surface, ready to be measured; see `PartSurface` for `chord`."""
        return PartSurface.of_shape(self.shape(), chord)
