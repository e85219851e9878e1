"""PTX files: stations of a laser scanner, each with its pose."""

from __future__ import annotations

import numpy as np

from inspect3d.files.content import Content
from inspect3d.files.found import Found
from inspect3d.files.table import table

_HEADER = 10
_WIDTHS = (3, 4, 7)
_DIGITS = 18
_CUT = "It was cut short: export or copy it again."


def read_ptx(content: Content) -> Found:
    """Read all stations into one frame.

    A station is ten lines and its rows: columns and rows of the grid, the scanner's position and axes, and a matrix
    that acts on row vectors, (x y z 1) M; then x y z, and perhaps intensity and colour. A row 0 0 0 is a direction
    without a point and is dropped.
    """
    text = content.text().rstrip() + b"\n"
    starts = np.append(0, np.flatnonzero(np.frombuffer(text, np.uint8) == ord("\n")) + 1)
    points, dropped, line = [], 0, 0
    while line < len(starts) - 1:
        if line + _HEADER >= len(starts):
            raise content.refused(f"ends within the ten lines of a station that starts in line {line + 1}", _CUT)
        lines = [text[starts[i] : starts[i + 1]] for i in range(line, line + _HEADER)]
        grid = [word.strip() for word in lines[:2]]
        if not all(word.isdigit() and len(word) < _DIGITS for word in grid):
            raise content.refused(f"has {grid[0][:40]!r} in line {line + 1} where the size of a station is expected")
        matrix = table(content, b"".join(lines[6:]), line + 7)
        if matrix.shape != (4, 4) or not np.allclose(matrix[:, 3], [0, 0, 0, 1]) or not np.isfinite(matrix).all():
            raise content.refused(f"has no matrix of a pose, 4 by 4, in lines {line + 7} to {line + 10}")
        first, count = line + _HEADER, int(grid[0]) * int(grid[1])
        if first + count >= len(starts):
            raise content.refused(f"declares {count} points in line {line + 1} and ends before them", _CUT)
        rows = table(content, text[starts[first] : starts[first + count]], first + 1)
        if len(rows) != count or (count and rows.shape[1] not in _WIDTHS):
            raise content.refused(f"has rows that are no points x y z between lines {first + 1} and {first + count}")
        hit = rows[:, :3].any(axis=1)
        dropped += int(np.count_nonzero(~hit))
        points.append(rows[hit, :3] @ matrix[:3, :3] + matrix[3, :3])
        line = first + count
    name = content.path.name
    remarks = (f"{name}: {dropped} directions without a point (0 0 0) were dropped.",) if dropped else ()
    parts = tuple(len(part) for part in points) if len(points) > 1 else ()
    return Found(np.concatenate([*points, np.zeros((0, 3))]), parts=parts, remarks=remarks)
