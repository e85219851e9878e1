"""PLY files: ascii and binary, meshes, clouds and range grids.

Not through trimesh, which takes vertex -1 for the last one and misses faces that the header declares (`idx.ply` and
`cut.ply` among the broken meshes of tests/test_files_awkward.py).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.files.content import Content
from inspect3d.files.found import Found
from inspect3d.files.numbers import numbers
from inspect3d.files.ply_header import Element, PlyHeader, read_ply_header
from inspect3d.files.ply_tape import AsciiTape, BinaryTape, Tape
from inspect3d.outcome import InputError

_CUT = "It was cut short, or its header is wrong: export or copy it again."
_DIGITS = 18
_NO_LISTS = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))


def read_ply(content: Content) -> Found:
    """Read vertices, their normals, and faces; other elements are walked over, so that a file cut short is noticed.

    Faces are the lists `vertex_indices` (or `vertex_index`) of the element `face`.
    """
    header = read_ply_header(content)
    if not header.order:
        return _ascii(content, header)
    tape = BinaryTape(content.data, header.order, header.length)
    tables = {element.name: _table(content, element, tape) for element in header.elements}
    remarks = (f"{content.path.name}: {tape.left()} bytes after the last element were ignored.",) if tape.left() else ()
    return _found(content, tables, remarks)


def _ascii(content: Content, header: PlyHeader) -> Found:
    """Read the stream of numbers; where it does not fit the header, but each row has its line, the lines."""
    text = content.data[header.length :]
    try:
        return _from_numbers(content, header, text, ())
    except InputError:
        lines = [line.split() for line in text.splitlines() if line.strip()]
        rows = [element for element in header.elements for _ in range(min(element.rows, len(lines) + 1))]
        if len(rows) != len(lines):
            raise
        trimmed = b"\n".join(b" ".join(_declared(row, line)) for row, line in zip(rows, lines, strict=True))
        surplus = f"{content.path.name}: numbers at the end of rows that its header does not declare were ignored."
        return _from_numbers(content, header, trimmed, (surplus,))


def _declared(element: Element, words: list[bytes]) -> list[bytes]:
    """Return the words of a row that the header declares."""
    end = 0
    for column in element.properties:
        counted = column.count and end < len(words) and words[end].isdigit() and len(words[end]) < _DIGITS
        end += 1 + int(words[end]) if counted else 1
    return words[:end]


def _from_numbers(content: Content, header: PlyHeader, text: bytes, remarks: tuple[str, ...]) -> Found:
    tape = AsciiTape(numbers(content, text))
    tables = {element.name: _table(content, element, tape) for element in header.elements}
    if tape.left():
        raise content.refused(f"has {tape.left()} numbers more than its header declares")
    return _found(content, tables, remarks)


def _found(content: Content, tables: dict[str, dict[str, Any]], remarks: tuple[str, ...]) -> Found:
    vertex, face = tables.get("vertex", {}), tables.get("face", {})
    single = {name for name, column in vertex.items() if not isinstance(column, tuple)}
    if not {"x", "y", "z"} <= single:
        raise content.refused("has no element `vertex` with the properties x, y and z")
    normals = _columns(vertex, "nx", "ny", "nz") if {"nx", "ny", "nz"} <= single else None
    listed = {name: column for name, column in face.items() if isinstance(column, tuple)}
    corners, sizes = listed.get("vertex_indices", listed.get("vertex_index", _NO_LISTS))
    return Found(_columns(vertex, "x", "y", "z"), normals, corners, sizes, remarks=remarks)


def _columns(table: dict[str, Any], *names: str) -> Floats:
    return np.column_stack([np.asarray(table[name], dtype=np.float64) for name in names])


def _table(content: Content, element: Element, tape: Tape) -> dict[str, Any]:
    """Take an element from the tape: a column is an array, or (numbers, lengths) where it holds lists."""
    least = element.rows * sum(tape.least(column) for column in element.properties)
    try:
        if least > tape.left():
            raise EOFError
        start = tape.position
        table = _alike(element, tape) if element.rows else _row_by_row(element, tape)
        if table is None:
            tape.position = start
            table = _row_by_row(element, tape)
    except EOFError as error:
        raise content.refused(f"ends before the {element.rows} rows of `{element.name}` it declares", _CUT) from error
    except _BadLength as error:
        raise content.refused(f"has a list of {error} numbers in the element `{element.name}`", _CUT) from error
    return table


def _alike(element: Element, tape: Tape) -> dict[str, Any] | None:
    """Take all rows at once, if the lists in them are as long as those in the first; None if they are not."""
    start = tape.position
    lengths = []
    for column in element.properties:
        lengths.append(_length(tape, column.count) if column.count else 1)
        tape.take(column.type, lengths[-1])
    tape.position = start
    try:
        columns = iter(tape.rows(element, lengths))
    except EOFError:
        return None
    table: dict[str, Any] = {}
    for column, length in zip(element.properties, lengths, strict=True):
        if column.count:
            if not (next(columns) == length).all():
                return None
            values = _indices(next(columns).ravel())
            table[column.name] = values, np.full(element.rows, length, dtype=np.int64)
        else:
            table[column.name] = next(columns)
    return table


def _row_by_row(element: Element, tape: Tape) -> dict[str, Any]:
    values: dict[str, list[float]] = {column.name: [] for column in element.properties}
    lengths: dict[str, list[int]] = {column.name: [] for column in element.properties}
    for _ in range(element.rows):
        for column in element.properties:
            length = _length(tape, column.count) if column.count else 1
            values[column.name] += tape.take(column.type, length)
            lengths[column.name].append(length)
    return {
        column.name: (_indices(np.array(values[column.name])), np.array(lengths[column.name], dtype=np.int64))
        if column.count
        else np.array(values[column.name])
        for column in element.properties
    }


def _length(tape: Tape, kind: str) -> int:
    (length,) = tape.take(kind, 1)
    if not float(length).is_integer() or length < 0:
        raise _BadLength(f"{length:g}")
    return int(length)


def _indices(values: Any) -> Integers:
    """Return whole numbers; what is none becomes -1, which no vertex has."""
    whole = np.isfinite(values) & (np.abs(values) < 2**62) & (values == np.floor(values))
    return np.where(whole, values, -1).astype(np.int64)


class _BadLength(ValueError):
    """A length of a list that is no count."""
