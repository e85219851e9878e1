"""Stage 1 in one call: from a CAD file to the part as designed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from inspect3d.nominal.inspection_mesh import mesh_on_brep, mesh_on_surface
from inspect3d.nominal.nominal import Nominal
from inspect3d.nominal.repair import repaired
from inspect3d.nominal.step_iges import IGES_SUFFIXES, STEP_SUFFIXES, read_brep
from inspect3d.nominal.surface import Surface
from inspect3d.nominal.tessellation import tessellated
from inspect3d.outcome import InputError

_ELEMENTS_PER_DIAGONAL = 60
_CHORD_PER_DIAGONAL = 1e-5
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
        The file is missing, broken, of another kind, or holds nothing to inspect.
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
    rough = tessellated(brep, 1e-3 * brep.diagonal)
    size = element_size or _default_size(rough.vertices)
    mesh = mesh_on_brep(tessellated(brep, min(1e-4 * brep.diagonal, size / 50)), size)
    chord = _CHORD_PER_DIAGONAL * brep.diagonal
    fine = tessellated(brep, chord)
    return Nominal(name, Surface(fine.vertices, fine.triangles), mesh, chord, (), brep)


def _triangulated(path: Path, name: str, units: str, element_size: float | None, flip: bool) -> Nominal:
    from inspect3d.files.mesh import read_mesh

    if units not in _MILLIMETRES:
        raise InputError(f"{units} is no unit of length here; use one of mm, cm, m, um, inch.")
    found = read_mesh(path)
    vertices, triangles, remarks = repaired(
        path.name, found.vertices * _MILLIMETRES[found.units or units], found.triangles, flip
    )
    surface = Surface(vertices, triangles)
    mesh = mesh_on_surface(surface, element_size or _default_size(vertices))
    return Nominal(name, surface, mesh, 0.0, (*found.remarks, *remarks))


def _default_size(vertices: np.ndarray) -> float:
    return float(np.linalg.norm(np.ptp(vertices, axis=0))) / _ELEMENTS_PER_DIAGONAL
