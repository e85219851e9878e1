"""Read a point cloud from a file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from inspect3d.arrays import Floats, floats, unit
from inspect3d.files.content import Content, opened
from inspect3d.files.e57 import read_e57
from inspect3d.files.found import Found
from inspect3d.files.las import read_las
from inspect3d.files.obj import read_obj
from inspect3d.files.off import read_off
from inspect3d.files.pcd import read_pcd
from inspect3d.files.ply import read_ply
from inspect3d.files.ptx import read_ptx
from inspect3d.files.stl import read_stl
from inspect3d.files.text import read_text
from inspect3d.files.threemf import read_3mf

_READERS = {
    "PLY": read_ply,
    "STL": read_stl,
    "OBJ": read_obj,
    "OFF": read_off,
    "3MF": read_3mf,
    "text": read_text,
    "PTS": read_text,
    "PTX": read_ptx,
    "PCD": read_pcd,
    "E57": read_e57,
    "LAS": read_las,
}


@dataclass(frozen=True, eq=False)
class CloudFile:
    """Points as a file holds them, in its units; several stations in one frame.

    Parameters
    ----------
    points : (n, 3) file units, at least one, in the order of the file
    normals : (n, 3) unit vectors as the file gives them, zero where it gives none for a point; None without normals
    parts : points per station, where the file holds several; else (n,)
    units : the unit, where the file fixes it: mm, cm, m, um, inch, or another in words; None where it does not say
    remarks : what was done to the data that the report must say, a sentence each
    """

    points: Floats
    normals: Floats | None = None
    parts: tuple[int, ...] = ()
    units: str | None = None
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", floats(self.points, "points", None, 3))
        if self.normals is not None:
            object.__setattr__(self, "normals", floats(self.normals, "normals", len(self.points), 3))


def read_cloud(path: Path) -> CloudFile:
    """Read the points of a scan; of a mesh file, its vertices.

    Known are PLY, STL, OBJ, OFF, 3MF, text (XYZ, ASC, TXT, CSV), PTS, PTX, PCD, E57 and LAS/LAZ, also packed (.gz,
    .bz2, .zip). Points whose coordinates are not finite are dropped, with a remark that counts them.

    Raises
    ------
    InputError
        The file is missing, broken, shorter than it says, or holds no points; the sentence names it and says what to
        do.
    """
    content = opened(path)
    with np.errstate(all="ignore"):  # what is not finite is counted below
        found = _READERS[content.format](content)
    if content.format == "STL":
        found = replace(found, points=_distinct(found.points))
    return _cleaned(content, found)


def _cleaned(content: Content, found: Found) -> CloudFile:
    name = content.path.name
    remarks = [*content.remarks, *found.remarks]
    finite = found.finite
    points, dropped = found.points[finite], np.count_nonzero(~finite)
    if not len(points):
        reason = f"its {dropped} points have no finite coordinates" if dropped else "it holds no points"
        raise content.refused(f"is an empty cloud: {reason}")
    if dropped:
        remarks.append(f"{name}: {dropped} of {len(finite)} points have no finite coordinates and were dropped.")
    normals = None
    if found.normals is not None:
        normals = unit(np.nan_to_num(found.normals[finite], nan=0.0, posinf=0.0, neginf=0.0))
        normals = normals if normals.any() else None
    edges = np.cumsum([0, *found.parts])
    parts = tuple(int(np.count_nonzero(finite[a:b])) for a, b in pairwise(edges))
    return CloudFile(points, normals, parts or (len(points),), found.units, tuple(remarks))


def _distinct(points: Floats) -> Floats:
    """Return each point once, in the order of its first appearance."""
    rows = np.ascontiguousarray(points + 0.0).view(np.dtype((np.void, 24))).ravel()
    _, first = np.unique(rows, return_index=True)
    return points[np.sort(first)]
