"""Points as rows of numbers: XYZ, ASC, TXT, CSV, PTS."""

from __future__ import annotations

import re

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.files.content import Content
from inspect3d.files.found import Found
from inspect3d.files.table import table
from inspect3d.files.text_layout import text_layout

_COMMENTS = re.compile(rb"^[ \t]*(#|//|%|!)[^\n]*$", re.MULTILINE)
_COUNT = re.compile(rb"\s*(\d{1,17})[ \t]*\r?(\n|$)")
_NAMED = ("x", "y", "z", "nx", "ny", "nz")
_CUT = "It was cut short, or its count is wrong: export or copy it again."


def read_text(content: Content) -> Found:
    """Read x, y, z of each row, and normals where the columns are named or the last three are unit vectors.

    A line with one whole number announces that many rows (PTS); several such blocks are the stations of one scan.
    Columns without names are x y z, then intensity, colour or normals; a first column that merely counts the rows,
    with x y z behind it, is passed over.
    """
    text = content.text()
    count = _COUNT.match(text)
    if count is None:
        return _rows(content, text, 1)
    blocks: list[Found] = []
    line = 1
    while count is not None:
        wanted = int(count[1])
        line += text[: count.end()].count(b"\n")
        text = text[count.end() :]
        end = _end_of_line(text, wanted)
        block = _rows(content, text[:end], line) if wanted else Found(np.zeros((0, 3)))
        if len(block.points) != wanted:
            raise content.refused(f"declares {wanted} points and holds {len(block.points)}", _CUT)
        blocks.append(block)
        line += wanted
        text = text[end:]
        count = _COUNT.match(text)
    if text.strip():
        raise content.refused(f"goes on after the {wanted} points it declares, in line {line}", "Correct the count.")
    return _joined(blocks)


def _rows(content: Content, text: bytes, first_line: int) -> Found:
    layout = text_layout(content, text[: 2**16].split(b"\n"))
    text = text[_end_of_line(text, layout.skipped) :]
    if _COMMENTS.search(text):
        text = _COMMENTS.sub(b"", text)
    text = text.replace(b'"', b"")
    if layout.delimiter != ",":
        text = text.replace(b",", b".")
    if layout.width < 3:
        raise content.refused(f"has {layout.width} columns where x, y and z are expected", "Export it with x y z.")
    wanted = tuple(layout.places[name] for name in _NAMED if name in layout.places) or tuple(range(layout.width))
    line = first_line + layout.skipped
    if layout.numeric:
        rows = table(content, text, line, layout.delimiter)[:, wanted]
    else:
        rows = table(content, text, line, layout.delimiter, wanted)
    if layout.places:
        return Found(rows[:, :3].copy(), rows[:, 3:6].copy() if rows.shape[1] == 6 else None)
    remarks: tuple[str, ...] = ()
    if rows.shape[1] > 3 and len(rows) > 3 and _counts(rows[:, 0]):
        rows = rows[:, 1:]
        remarks = (f"{content.path.name}: the first column counts the rows and was not taken for x.",)
    return Found(rows[:, :3].copy(), _normals(rows), remarks=remarks)


def _counts(column: Floats) -> bool:
    """Tell whether a column is 0, 1, 2, ... or 1, 2, 3, ..."""
    return column[0] in (0, 1) and np.array_equal(column, column[0] + np.arange(len(column)))


def _normals(rows: Floats) -> Floats | None:
    """Return the last three columns if they are unit vectors, within 1 %, or zero."""
    if rows.shape[1] < 6 or not len(rows):
        return None
    normals = rows[:, -3:]
    length = np.linalg.norm(normals, axis=1)
    unit = np.abs(length - 1) < 0.01
    return normals.copy() if unit.any() and (unit | (length == 0) | np.isnan(length)).all() else None


def _joined(blocks: list[Found]) -> Found:
    normals = [block.normals for block in blocks if block.normals is not None]
    return Found(
        np.concatenate([block.points for block in blocks]),
        np.concatenate(normals) if len(normals) == len(blocks) else None,
        parts=tuple(len(block.points) for block in blocks) if len(blocks) > 1 else (),
        remarks=tuple(remark for block in blocks for remark in block.remarks),
    )


def _end_of_line(text: bytes, lines: int) -> int:
    """Return where the given number of lines ends, or the end of the text."""
    if not lines:
        return 0
    ends = np.flatnonzero(np.frombuffer(text, np.uint8) == ord("\n"))
    return int(ends[lines - 1]) + 1 if len(ends) >= lines else len(text)
