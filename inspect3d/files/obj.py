"""Wavefront OBJ files.

Not through trimesh, which drops the face without corners of assimp's `malformed2.obj` and covers `concave_polygon.obj`
thirteen times over.
"""

from __future__ import annotations

import re

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.files.content import Content
from inspect3d.files.found import Found
from inspect3d.files.numbers import numbers

_MORE_THAN_INDEX = re.compile(rb"/[^\s]*")


def read_obj(content: Content) -> Found:
    """Read vertices and faces; the normals of a file of points; lines, textures, groups and materials are passed over.

    A face may count vertices from the end (negative). Free-form curves and surfaces are refused.
    """
    text = content.text().replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    lines = [line.strip() for line in text.split(b"\n")]
    kinds = np.array([line[:2].rstrip() for line in lines], dtype="S2")
    wanted = {kind: np.flatnonzero(kinds == kind) for kind in (b"v", b"vn", b"f", b"su")}
    if len(wanted[b"su"]):
        raise content.refused("holds free-form surfaces", "Export it as a mesh, or the CAD model as STEP.")
    points = _rows(content, lines, wanted[b"v"], (3, 4, 6, 7))
    corners, sizes = _faces(content, lines, wanted[b"f"], wanted[b"v"])
    point_normals = len(wanted[b"vn"]) == len(points) and not len(sizes)
    normals = _rows(content, lines, wanted[b"vn"], (3,)) if point_normals else None
    return Found(points, normals, corners, sizes)


def _rows(content: Content, lines: list[bytes], at: Integers, widths: tuple[int, ...]) -> Floats:
    """Return x, y, z of the lines; behind them may follow a weight or a colour."""
    if not len(at):
        return np.zeros((0, 3))
    words = np.array([len(lines[i].split()) - 1 for i in at])
    wrong = np.flatnonzero((words != words[0]) | ~np.isin(words, widths))
    if len(wrong):
        line = at[wrong[0]]
        raise content.refused(f"has {words[wrong[0]]} numbers in line {line + 1}, {_shown(lines[line])}")
    rows = numbers(content, b"\n".join(lines[i][2:] for i in at)).reshape(len(at), words[0])
    return rows[:, :3].copy()


def _faces(content: Content, lines: list[bytes], at: Integers, vertices_at: Integers) -> tuple[Integers, Integers]:
    sizes = np.array([len(lines[i].split()) - 1 for i in at], dtype=np.int64)
    few = np.flatnonzero(sizes < 3)
    if len(few):
        raise content.refused(f"has a face of {sizes[few[0]]} corners in line {at[few[0]] + 1}")
    joined = b"\n".join(lines[i][2:] for i in at)
    given = numbers(content, _MORE_THAN_INDEX.sub(b"", joined))
    if len(given) != sizes.sum():
        raise content.refused("has a face with a corner that has no vertex")
    before = np.repeat(np.searchsorted(vertices_at, at), sizes)
    corners = np.where(given < 0, before + given, given - 1)
    outside = np.flatnonzero((corners < 0) | (corners >= len(vertices_at)) | (corners != np.floor(corners)))
    if len(outside):
        line = np.repeat(at, sizes)[outside[0]]
        where = f"in line {line + 1}, {_shown(lines[line])}"
        raise content.refused(f"refers to vertex {given[outside[0]]:g} of {len(vertices_at)} {where}")
    return corners.astype(np.int64), sizes


def _shown(line: bytes) -> str:
    return repr(line[:60].decode("utf-8", "replace"))
