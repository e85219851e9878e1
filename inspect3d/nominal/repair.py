"""Repair of triangle meshes where it is safe."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.nominal.features import welded
from inspect3d.nominal.sharp import sides_of
from inspect3d.nominal.winding import wound
from inspect3d.outcome import InputError

_FLAT = 1e-12


class Repaired(NamedTuple):
    """A mesh fit for use.

    Parameters
    ----------
    vertices : (n, 3) mm, each at a place of its own and used
    triangles : (m, 3), wound alike, closed bodies outside out
    remarks : what was done and what is left, a sentence each
    """

    vertices: Floats
    triangles: Integers
    remarks: tuple[str, ...]


def repaired(name: str, vertices: Floats, triangles: Integers, flip: bool = False) -> Repaired:
    """Return a usable, consistently wound mesh, outside out.

    Vertices at one place become one; degenerate and duplicate triangles go, and with them vertices that no triangle
    needs; the winding is made consistent where the surface has two sides. No hole is filled.

    Parameters
    ----------
    name : of the file, for messages
    vertices : (n, 3) mm
    triangles : (m, 3)
    flip : turn what is open; a closed body needs no hint

    Raises
    ------
    InputError
        No proper triangle is left, or a vertex is not finite.
    """
    if not len(triangles):
        raise InputError(f"{name} holds no triangles; export the part as a mesh, not as points or lines.")
    if not np.isfinite(vertices[triangles]).all():
        raise InputError(f"{name} has vertices that are not finite numbers; export it again.")
    remarks: list[str] = []
    joined = welded(vertices)[triangles]
    flat = _degenerate(vertices, joined)
    if flat.all():
        raise InputError(
            f"All triangles of {name} are degenerate; export it again, with more digits or in other units."
        )
    joined = joined[~flat]
    twice = _duplicate(joined)
    found = wound(vertices, joined[~twice], flip)
    sides = sides_of(vertices, found.triangles)
    rims, branches = int((sides.uses == 1).sum()), int((sides.uses > 2).sum())
    _remark(remarks, flat.sum(), "degenerate triangle was dropped.", "degenerate triangles were dropped.")
    _remark(remarks, twice.sum(), "duplicate triangle was dropped.", "duplicate triangles were dropped.")
    _remark(
        remarks,
        found.disagreeing,
        "triangle was turned to agree with its neighbours.",
        "triangles were turned to agree with their neighbours.",
    )
    _remark(
        remarks,
        found.inverted,
        "triangle of a closed body was turned outside out.",
        "triangles of closed bodies were turned outside out.",
    )
    if rims:
        side = "was turned by the recipe's flip" if flip else "says which side is outside; flip = true turns it"
        remarks.append(f"The mesh is open ({rims} rim edges); its winding {side}.")
    _remark(
        remarks,
        branches,
        "edge has more than two triangles: the mesh is not a manifold there.",
        "edges have more than two triangles: the mesh is not a manifold there.",
    )
    if not found.two_sided:
        remarks.append("The mesh has a one-sided sheet, like a Möbius strip: outside cannot be told everywhere.")
    if flip and not found.open.any():
        remarks.append("The mesh is closed, so its outside is known and flip = true did nothing.")
    used, compact = np.unique(found.triangles, return_inverse=True)
    return Repaired(vertices[used], compact.reshape(-1, 3), tuple(remarks))


def _remark(remarks: list[str], count: int, one: str, many: str) -> None:
    if count:
        remarks.append(f"{count} {one if count == 1 else many}")


def _degenerate(vertices: Floats, triangles: Integers) -> Booleans:
    corners = vertices[triangles]
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    area2 = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return area2 <= _FLAT * longest**2


def _duplicate(triangles: Integers) -> Booleans:
    first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)[1]
    duplicate = np.ones(len(triangles), dtype=bool)
    duplicate[first] = False
    return duplicate
