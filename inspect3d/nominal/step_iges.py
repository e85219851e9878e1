"""Read STEP and IGES files through OpenCASCADE."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from inspect3d.nominal.brep import Brep
from inspect3d.nominal.sewing import sewn
from inspect3d.nominal.survived import survived
from inspect3d.outcome import InputError

STEP_SUFFIXES = frozenset({".step", ".stp"})
IGES_SUFFIXES = frozenset({".iges", ".igs"})
_GEOMETRY = ("StepGeom_", "StepShape_")
_SECONDS, _SECONDS_PER_BYTE = 20, 1e-5
"""Files of real parts take 2.5e-7 s of processor time a byte."""


def read_brep(path: Path) -> Brep:
    """Return the faces of a STEP or IGES file in mm; the unit is the file's own.

    Assemblies come with every part in its place. The faces of an IGES file, which know nothing of each other, are sewn
    where they meet.

    Raises
    ------
    InputError
        The file is not what its name says, is cut off, or holds no faces.
    """
    is_step = path.suffix.lower() in STEP_SUFFIXES
    if is_step:
        _require_step(path)
    else:
        _require_iges(path)
    shape = _transferred(path, is_step)
    faces = [] if shape.IsNull() else _mapped(shape, "face")
    if not faces:
        raise InputError(f"{path.name} holds no faces, perhaps only curves; export the part as a solid or as surfaces.")
    part = brep_of(shape, faces)
    return part if is_step else brep_of(*sewn(shape, faces, part.diagonal))


def brep_of(shape: Any, faces: list[Any]) -> Brep:
    """Return the faces of a `TopoDS_Shape` in mm, numbered as they come, and its edges.

    Raises
    ------
    InputError
        An edge lies infinitely far from its faces.
    """
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp
    from OCP.TopoDS import TopoDS
    from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape, TopTools_IndexedMapOfShape

    beside = TopTools_IndexedDataMapOfShapeListOfShape()
    kinds = TopAbs_ShapeEnum.TopAbs_EDGE, TopAbs_ShapeEnum.TopAbs_FACE
    TopExp.MapShapesAndUniqueAncestors_s(shape, *kinds, beside)
    numbers = TopTools_IndexedMapOfShape()
    for face in faces:
        numbers.Add(face)
    edges = [TopoDS.Edge_s(edge) for edge in _mapped(shape, "edge")]
    tolerances = np.array([BRep_Tool.Tolerance_s(edge) for edge in edges])
    if not np.isfinite(tolerances).all():
        raise InputError("An edge of the model lies infinitely far from its faces; export it again.")
    return Brep(
        shape=shape,
        faces=tuple(TopoDS.Face_s(face) for face in faces),
        edges=tuple(edges),
        edge_faces=tuple(tuple(sorted(map(numbers.FindIndex, beside.FindFromKey(edge)))) for edge in edges),
        edge_tolerance=tolerances,
    )


def _mapped(shape: Any, kind: str) -> list[Any]:
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp
    from OCP.TopTools import TopTools_IndexedMapOfShape

    members = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, getattr(TopAbs_ShapeEnum, f"TopAbs_{kind.upper()}"), members)
    return [members.FindKey(k) for k in range(1, members.Extent() + 1)]


def _require_step(path: Path) -> None:
    text = path.read_bytes()
    if b"ISO-10303-21" not in text[:1024]:
        raise InputError(f"{path.name} is not a STEP file: it does not begin with ISO-10303-21.")
    if b"END-ISO-10303-21" not in text[-1024:] or b"ENDSEC" not in text:
        raise InputError(f"{path.name} is cut off: its last line END-ISO-10303-21 is missing; export or copy it again.")
    # OpenCASCADE crashes on references that lead nowhere.
    data = re.sub(rb"'[^']*'", b"", text)
    missing = set(re.findall(rb"#(\d+)", data)) - set(re.findall(rb"#(\d+)\s*=", data))
    if missing:
        first = min(map(int, missing))
        raise InputError(f"{path.name} is damaged: it refers to #{first}, which it does not define; export it again.")


def _require_iges(path: Path) -> None:
    """Check the sections: column 73 of each 80-column line names its section, and the last line counts their lines."""
    lines = [line for line in path.read_bytes().splitlines() if line.strip()]
    sections = "".join(chr(line[72]) if len(line) > 72 else "?" for line in lines)
    if not sections.startswith("S") or "G" not in sections:
        raise InputError(f"{path.name} is not an IGES file in the fixed 80-column form.")
    counts = lines[-1].decode("ascii", "replace")
    announced = {counts[k]: counts[k + 1 : k + 8].strip() for k in range(0, 32, 8)} if sections.endswith("T") else {}
    if any(announced.get(letter, "").lstrip("0") != str(sections.count(letter)) for letter in "SGDP"):
        raise InputError(f"{path.name} is cut off: its last line does not count the others; export or copy it again.")


def _transferred(path: Path, is_step: bool) -> Any:
    """Return what a file holds; the work is left to a child process, for OpenCASCADE crashes on damage it overlooks."""
    from OCP.BinTools import BinTools
    from OCP.TopoDS import TopoDS_Shape

    with TemporaryDirectory() as folder:
        handed = Path(folder) / "shape"

        def hand_over() -> None:
            if BinTools.Write_s(_translated(path, is_step), f"{handed}.part"):
                Path(f"{handed}.part").rename(handed)

        if not survived(hand_over, _SECONDS + int(path.stat().st_size * _SECONDS_PER_BYTE)):
            raise InputError(f"{path.name} is damaged: OpenCASCADE crashes or hangs on it; export it again.")
        if not handed.exists():
            return _translated(path, is_step)  # which says what is wrong
        shape = TopoDS_Shape()
        BinTools.Read_s(shape, str(handed))
        return shape


def _translated(path: Path, is_step: bool) -> Any:
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.IGESControl import IGESControl_Reader
    from OCP.STEPControl import STEPControl_Reader

    silence()
    reader: Any = STEPControl_Reader() if is_step else IGESControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise InputError(f"{path.name} cannot be read as {'STEP' if is_step else 'IGES'}; export it again.")
    if is_step:
        _require_sound(path, reader.StepModel())
    reader.TransferRoots()
    return reader.OneShape()


def _require_sound(path: Path, model: Any) -> None:
    """Refuse geometry of a wrong type, on which OpenCASCADE crashes; what is wrong with colours does not matter."""
    for number in range(1, model.NbEntities() + 1):
        check = model.Check(number, True)
        kind = model.Value(number).DynamicType().Name()
        if check.HasFailed() and kind.startswith(_GEOMETRY):
            kind, what = kind.partition("_")[2], check.CFail(1)
            raise InputError(f"{path.name} is damaged: it holds a wrong {kind} ({what}); export it again.")


def silence() -> None:
    """Take the printers from OpenCASCADE's messenger: nothing here prints."""
    from OCP.Message import Message

    messenger = Message.DefaultMessenger_s()
    for printer in list(messenger.Printers()):
        messenger.RemovePrinter(printer)
