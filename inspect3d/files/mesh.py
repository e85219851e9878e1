"""Read a triangle mesh from a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inspect3d.arrays import Floats, Integers, floats, integers
from inspect3d.outcome import InputError


@dataclass(frozen=True, eq=False)
class MeshFile:
    """Triangles as a file holds them: nothing merged, nothing turned, in the units of the file.

    Parameters
    ----------
    vertices : (n, 3) file units; an STL file repeats a vertex in each of its triangles
    triangles : (m, 3) indices of vertices, at least one; polygons are cut into triangles, bodies follow one another
    units : the unit, where the format fixes it (3MF); None where the recipe must say it
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
    """Read a mesh of STL, PLY, OBJ, OFF or 3MF.

    Raises
    ------
    InputError
        The file is missing, broken, or holds no triangles; the sentence names it and says what to do.
    """
    import trimesh

    if not path.is_file():
        raise InputError(f"{path} is not a file.")
    try:
        scene = trimesh.load_scene(path, process=False)
        mesh = scene.to_mesh()
    except Exception as error:
        raise InputError(f"{path} cannot be read as a mesh: {error}.") from error
    vertices, triangles = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
    if not len(triangles) or not np.isfinite(vertices).all():
        raise InputError(f"{path} holds no triangles, or coordinates that are not numbers.")
    return MeshFile(vertices, triangles, scene.units)
