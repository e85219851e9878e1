"""Stage 1 in one call: from a CAD file to the part as designed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from inspect3d.nominal.brep import Brep
from inspect3d.nominal.inspection_mesh import mesh_on_brep, mesh_on_surface
from inspect3d.nominal.nominal import Nominal
from inspect3d.nominal.repair import repaired
from inspect3d.nominal.step_iges import IGES_SUFFIXES, STEP_SUFFIXES, read_brep
from inspect3d.nominal.surface import Surface
from inspect3d.nominal.tessellation import Tessellation, tessellated
from inspect3d.outcome import InputError

_ELEMENTS_PER_DIAGONAL = 60
_CHORD_PER_DIAGONAL = 1e-5
_CHORDS_PER_ELEMENT = 50
_FEW_TRIANGLES, _MOST_TRIANGLES = 60_000, 2_000_000
_MOST_NODES = 5e6  # of an inspection mesh: more take hours, and tens of gigabytes
_FINER = 8.0  # by which a surface of few triangles is made finer: the number grows in proportion at the most
_MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 0.001, "inch": 25.4, "ft": 304.8}


def load_nominal(
    path: Path, *, name: str | None = None, units: str = "mm", element_size: float | None = None, flip: bool = False
) -> Nominal:
    """Return the part of a CAD file: a fine surface and an inspection mesh.

    Parameters
    ----------
    path : STEP or IGES, read exactly; STL, PLY, OBJ, OFF or 3MF, read as they are
    name : of the part; the file's by default
    units : of a mesh file: mm, cm, m, um or inch; STEP, IGES and 3MF carry theirs
    element_size : wanted edge length of the inspection mesh, mm; a sixtieth of the bounding box's diagonal by default
    flip : turn an open mesh whose winding shows the inside

    Raises
    ------
    InputError
        The file is missing, broken, of another kind, or holds nothing to inspect; or the elements are far too small.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path.name} is a folder; name a CAD file in it.")
    if not path.is_file():
        raise InputError(f"There is no CAD file {path}; paths in a recipe start at the recipe's folder.")
    if element_size is not None and not (np.isfinite(element_size) and element_size > 0):
        raise InputError(f"The element size is a positive length in mm, not {element_size}.")
    name = path.stem if name is None else name
    if path.suffix.lower() in STEP_SUFFIXES | IGES_SUFFIXES:
        return _exact(path, name, element_size, flip)
    return _triangulated(path, name, units, element_size, flip)


def _exact(path: Path, name: str, element_size: float | None, flip: bool) -> Nominal:
    brep = read_brep(path)
    fine = _fine(brep)
    is_open = not Surface(fine.vertices, fine.triangles).closed
    if flip and is_open:
        brep = brep.turned()
        fine = _fine(brep)
    surface = Surface(fine.vertices, fine.triangles)
    size = _element_size(surface, element_size)
    mesh, remarks = mesh_on_brep(tessellated(brep, size / _CHORDS_PER_ELEMENT), size)
    remarks += _remarks_on(brep, fine, is_open, flip)
    return Nominal(name, surface, mesh, fine.chord, remarks, brep, fine.face)


def _element_size(surface: Surface, wanted: float | None) -> float:
    """Return the edge length of the inspection mesh, mm; each node of equilateral triangles has √3/2 of its square."""
    size = wanted or surface.diagonal / _ELEMENTS_PER_DIAGONAL
    least = float(np.sqrt(surface.areas.sum() / (np.sqrt(0.75) * _MOST_NODES)))
    if size < least:
        raise InputError(
            f"element_size = {size:g} mm makes more than {_MOST_NODES / 1e6:g} million nodes: this part takes "
            f"{least:.2g} mm or more."
        )
    return size


def _fine(brep: Brep) -> Tessellation:
    """Return a tessellation fine enough to stand for the exact surface, but not of unwieldy size."""
    deflection = _CHORD_PER_DIAGONAL * brep.diagonal
    fine = tessellated(brep, deflection)
    if len(fine.triangles) < _FEW_TRIANGLES:
        return tessellated(brep, deflection / _FINER)
    while len(fine.triangles) > _MOST_TRIANGLES:
        deflection *= 2 * len(fine.triangles) / _MOST_TRIANGLES
        fine = tessellated(brep, deflection)
    return fine


def _remarks_on(brep: Brep, fine: Tessellation, is_open: bool, flip: bool) -> tuple[str, ...]:
    remarks = []
    missing = np.setdiff1d(np.arange(1, len(brep.faces) + 1), fine.face)
    if len(missing):
        numbers = ", ".join(map(str, missing[:10])) + (" and others" if len(missing) > 10 else "")
        remarks.append(f"{len(missing)} of {len(brep.faces)} faces cannot be triangulated and are missing: {numbers}.")
    if is_open:
        side = "turned by the recipe's flip" if flip else "taken from the file; flip = true turns it"
        remarks.append(f"The model is open, a sheet and not a solid; its outside is {side}.")
    elif flip:
        remarks.append("The model is closed, so its outside is known and flip = true did nothing.")
    return tuple(remarks)


def _triangulated(path: Path, name: str, units: str, element_size: float | None, flip: bool) -> Nominal:
    from inspect3d.files.mesh import read_mesh

    if units not in _MILLIMETRES:
        raise InputError(f"{units} is no unit of length here; use one of mm, cm, m, um, inch.")
    found = read_mesh(path)
    millimetres = _MILLIMETRES[found.units or units]
    mended = repaired(path.name, found.vertices * millimetres, found.triangles, flip)
    surface = Surface(mended.vertices, mended.triangles)
    mesh, remarks = mesh_on_surface(surface, _element_size(surface, element_size))
    return Nominal(name, surface, mesh, 0.0, (*found.remarks, *mended.remarks, *remarks))
