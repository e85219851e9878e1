"""Repair of triangle meshes where it is safe, and their outside."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.nominal.features import welded
from inspect3d.outcome import InputError


def repaired(
    name: str, vertices: Floats, triangles: Integers, flip: bool = False
) -> tuple[Floats, Integers, tuple[str, ...]]:
    """Return vertices and triangles of a usable, consistently wound mesh, outside out, and what was done, a sentence each.

    Vertices at one place become one; degenerate and duplicate triangles go, and with them vertices that no triangle needs; the winding
    is made consistent where the surface has two sides. A closed body is turned to positive volume, a void in it inwards; an open mesh
    keeps its winding, or is turned by `flip`. No hole is filled.

    Parameters
    ----------
    name : of the file, for messages
    vertices : (n, 3) mm
    triangles : (m, 3)

    Raises
    ------
    InputError
        No triangle is left, or a vertex is not finite.
    """
    if len(triangles) == 0:
        raise InputError(f"{name} holds no triangles; export the part as a mesh, not as points or lines.")
    if not np.isfinite(vertices[triangles]).all():
        raise InputError(f"{name} has vertices that are not finite numbers; export it again.")
    remarks: list[str] = []
    joined = welded(vertices)[triangles]
    joined = _without(joined, _degenerate(vertices, joined), "degenerate", remarks)
    if len(joined) == 0:
        raise InputError(
            f"All triangles of {name} are degenerate; export it again, perhaps with more digits or other units."
        )
    joined = _without(joined, _duplicate(joined), "duplicate", remarks)
    used, compact = np.unique(joined, return_inverse=True)
    vertices, triangles = vertices[used], compact.reshape(-1, 3)
    return vertices, triangles, tuple(remarks)


def _without(triangles: Integers, bad: np.ndarray, what: str, remarks: list[str]) -> Integers:
    count = int(bad.sum())
    if count:
        remarks.append(f"{count} {what} triangle{'s were' if count > 1 else ' was'} dropped.")
    return triangles[~bad]


def _degenerate(vertices: Floats, triangles: Integers) -> np.ndarray:
    corners = vertices[triangles]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    area2 = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return area2 <= 1e-12 * sides.max(axis=1) ** 2


def _duplicate(triangles: Integers) -> np.ndarray:
    first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)[1]
    duplicate = np.ones(len(triangles), dtype=bool)
    duplicate[first] = False
    return duplicate
