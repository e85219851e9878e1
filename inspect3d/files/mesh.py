"""Read a triangle mesh from a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inspect3d.arrays import Floats, Integers, floats, integers
from inspect3d.files.content import opened
from inspect3d.files.obj import read_obj
from inspect3d.files.off import read_off
from inspect3d.files.ply import read_ply
from inspect3d.files.stl import read_stl
from inspect3d.files.threemf import read_3mf
from inspect3d.files.triangulated import triangulated

_READERS = {"STL": read_stl, "PLY": read_ply, "OBJ": read_obj, "OFF": read_off, "3MF": read_3mf}


@dataclass(frozen=True, eq=False)
class MeshFile:
    """Triangles as a file holds them: nothing merged, nothing turned, in the units of the file.

    Parameters
    ----------
    vertices : (n, 3) file units; an STL file repeats a vertex in each of its triangles
    triangles : (m, 3) indices of vertices, at least one; polygons are cut into triangles, bodies follow one another
    units : the unit, where the format fixes it (3MF): mm, cm, m, um, inch or ft; None where the recipe must say it
    remarks : what was done to the data that the report must say, a sentence each
    """

    vertices: Floats
    triangles: Integers
    units: str | None = None
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", floats(self.vertices, "vertices", None, 3))
        object.__setattr__(self, "triangles", integers(self.triangles, "triangles", None, 3))


def read_mesh(path: Path) -> MeshFile:
    """Read a mesh of STL, PLY, OBJ, OFF or 3MF, also packed (.gz, .bz2, .zip).

    A file is read whole or refused: no face is dropped because something about it is wrong.

    Raises
    ------
    InputError
        The file is missing, broken, or holds no triangles; the sentence names it and says what to do.
    """
    content = opened(path)
    reader = _READERS.get(content.format)
    if reader is None:
        known = ", ".join(_READERS)
        raise content.refused(f"is a point cloud ({content.format}), not a mesh", f"Give a mesh: {known}.")
    with np.errstate(all="ignore"):  # what is not finite is counted below
        found = reader(content)
    if not len(found.sizes):
        what = f"holds {len(found.points)} points but no triangles" if len(found.points) else "holds no triangles"
        raise content.refused(what, "Export it as a mesh.")
    bad = np.count_nonzero(~found.finite)
    if bad:
        raise content.refused(f"has {bad} vertices whose coordinates are not finite")
    triangles = triangulated(content, found)
    return MeshFile(found.points, triangles, found.units, content.remarks + found.remarks)
