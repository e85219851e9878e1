"""OFF files (ascii).

Not through trimesh, which folds concave faces over (`dart.off` in tests/test_files_roundtrip.py), misses faces that the
header declares and drops normals.
"""

from __future__ import annotations

import re

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.files.content import Content
from inspect3d.files.found import Found
from inspect3d.files.numbers import numbers

_KEYWORD = re.compile(rb"(?:ST|C|N)*OFF\b", re.IGNORECASE)
_DIGITS = 18
_CUT = "It was cut short, or its counts are wrong: export or copy it again."


def read_off(content: Content) -> Found:
    """Read vertices, their normals (NOFF), and faces; colours and texture coordinates are passed over."""
    text = content.text()
    if b"#" in text:
        text = re.sub(rb"#[^\n]*", b"", text)
    lines = [line for line in map(bytes.strip, text.split(b"\n")) if line]
    keyword = _KEYWORD.match(lines[0]) if lines else None
    if keyword is None:
        raise content.refused("does not start with OFF, as a three-dimensional OFF file does")
    counts = lines[0][keyword.end() :].split()
    body = 1
    if not counts and len(lines) > 1:
        counts, body = lines[1].split(), 2
    if len(counts) not in (2, 3) or not all(count.isdigit() and len(count) < _DIGITS for count in counts):
        raise content.refused("does not start with the counts of vertices, faces and edges (binary OFF is not read)")
    vertices, faces = int(counts[0]), int(counts[1])
    if vertices + faces > len(lines) - body:
        held = len(lines) - body
        raise content.refused(f"declares {vertices} vertices and {faces} faces and has {held} lines of them", _CUT)
    if vertices + faces < len(lines) - body:
        raise content.refused(f"has more lines than the {vertices} vertices and {faces} faces it declares", _CUT)
    points = _rows(content, lines[body : body + vertices])
    has_normals = b"N" in keyword[0].upper() and points.shape[1] >= 6
    corners, sizes = _faces(content, lines[body + vertices :])
    return Found(points[:, :3].copy(), points[:, 3:6].copy() if has_normals else None, corners, sizes)


def _faces(content: Content, lines: list[bytes]) -> tuple[Integers, Integers]:
    """Return the corners, flat, and their number for each face; what follows them in a line is a colour."""
    if not lines:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    widths = np.array([len(line.split()) for line in lines])
    values = numbers(content, b" ".join(lines))
    starts = np.cumsum(widths) - widths
    sizes = values[starts]
    wrong = np.flatnonzero((sizes < 1) | (sizes >= widths) | (sizes != np.floor(sizes)))
    if len(wrong):
        raise content.refused(f"has a face whose corners are not as many as it says: {_shown(lines[wrong[0]])}")
    sizes = sizes.astype(np.int64)
    within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    corners = values[np.repeat(starts + 1, sizes) + within]
    if not np.array_equal(corners, np.floor(corners)):
        raise content.refused("has a face whose corners are not whole numbers")
    return corners.astype(np.int64), sizes


def _rows(content: Content, lines: list[bytes]) -> Floats:
    if not lines:
        return np.zeros((0, 3))
    width = len(lines[0].split())
    for line in lines:
        if len(line.split()) != width or width < 3:
            raise content.refused(f"has a vertex unlike the first or without x, y, z: {_shown(line)}")
    return numbers(content, b" ".join(lines)).reshape(len(lines), width)


def _shown(line: bytes) -> str:
    return repr(line[:60].decode("utf-8", "replace"))
