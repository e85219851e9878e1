"""PCD files of the Point Cloud Library."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from inspect3d.files.content import Content
from inspect3d.files.found import Found
from inspect3d.files.lzf import lzf_unpacked
from inspect3d.files.table import table

_DATA = re.compile(rb"^DATA[ \t]+(\w+)[ \t]*(?:\r\n|\n|\Z)", re.MULTILINE)
_TYPES = {"F4": "<f4", "F8": "<f8", "I1": "<i1", "I2": "<i2", "I4": "<i4", "I8": "<i8"} | {
    f"U{size}": f"<u{size}" for size in (1, 2, 4, 8)
}
_NORMALS = (("normal_x", "normal_y", "normal_z"), ("nx", "ny", "nz"))
_STILL = [0, 0, 0, 1, 0, 0, 0]
_MOST = 2**24
_CUT = "It was cut short, or its header is wrong: export or copy it again."


@dataclass(frozen=True)
class _Header:
    names: tuple[str, ...]
    types: tuple[str, ...]
    counts: tuple[int, ...]
    points: int
    viewpoint: list[float]


def read_pcd(content: Content) -> Found:
    """Read points and normals of an ascii, binary or binary_compressed file.

    The VIEWPOINT is where the sensor was; the library does not move the points by it, so neither does this.
    """
    data = _DATA.search(content.data)
    if data is None:
        raise content.refused("has no PCD header that ends with a DATA line")
    header = _header(content, content.data[: data.start()].decode("ascii", "replace"))
    body = content.data[data.end() :]
    match data[1].lower():
        case b"ascii":
            columns = _ascii(content, header, body, content.data[: data.end()].count(b"\n") + 1)
        case b"binary":
            columns = _binary(content, header, body)
        case b"binary_compressed":
            columns = _compressed(content, header, body)
        case other:
            raise content.refused(f"has data of the unknown kind {other.decode('ascii', 'replace')!r}")
    if not {"x", "y", "z"} <= columns.keys():
        raise content.refused(f"has the fields {' '.join(header.names)} and not x, y and z")
    normals = next((np.column_stack([columns[n] for n in names]) for names in _NORMALS if {*names} <= {*columns}), None)
    moved = f"{content.path.name}: the sensor's viewpoint in the header was not applied to the points."
    remarks = () if header.viewpoint == _STILL else (moved,)
    return Found(np.column_stack([columns[name] for name in "xyz"]), normals, remarks=remarks)


def _header(content: Content, text: str) -> _Header:
    lines = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    told = {words[0].upper(): words[1:] for words in lines}
    names = tuple(name.lower() for name in told.get("FIELDS", told.get("COLUMNS", [])))
    try:
        sizes, kinds = told["SIZE"], told["TYPE"]
        counts = tuple(int(word) for word in told.get("COUNT", ["1"] * len(names)))
        points = int(told["POINTS"][0]) if "POINTS" in told else int(told["WIDTH"][0]) * int(told["HEIGHT"][0])
        types = tuple(_TYPES[kind.upper() + size] for kind, size in zip(kinds, sizes, strict=True))
        viewpoint = [float(word) for word in told.get("VIEWPOINT", [])] or [float(word) for word in _STILL]
    except (KeyError, ValueError, IndexError) as error:
        raise content.refused(f"has a PCD header that lacks something or has a wrong value: {error}") from error
    if not len(names) == len(types) == len(counts) or points < 0 or not _plausible(counts):
        raise content.refused(
            "has a PCD header whose FIELDS, SIZE, TYPE and COUNT are not equally long or out of range"
        )
    return _Header(names, types, counts, points, viewpoint)


def _plausible(counts: tuple[int, ...]) -> bool:
    return min(counts, default=0) >= 0 and sum(counts) < _MOST


def _ascii(content: Content, header: _Header, body: bytes, first_line: int) -> dict[str, np.ndarray]:
    rows = table(content, body, first_line)
    if len(rows) != header.points or (len(rows) and rows.shape[1] != sum(header.counts)):
        what = f"declares {header.points} points of {sum(header.counts)} numbers and holds {len(rows)}"
        raise content.refused(f"{what} of {rows.shape[1]}", _CUT)
    starts = np.cumsum(header.counts) - header.counts
    return {
        name: rows[:, start]
        for name, start, n in zip(header.names, starts, header.counts, strict=True)
        if n and len(rows)
    } or dict.fromkeys(header.names, np.zeros(0))


def _binary(content: Content, header: _Header, body: bytes) -> dict[str, np.ndarray]:
    parts = enumerate(zip(header.types, header.counts, strict=True))
    row = np.dtype([(f"f{i}", kind, (count,)) for i, (kind, count) in parts])
    if header.points * row.itemsize > len(body):
        raise content.refused(f"declares {header.points} points and holds {len(body) // row.itemsize}", _CUT)
    rows = np.frombuffer(body, row, header.points)
    return {name: rows[f"f{i}"][:, 0].astype(np.float64) for i, name in enumerate(header.names) if header.counts[i]}


def _compressed(content: Content, header: _Header, body: bytes) -> dict[str, np.ndarray]:
    """Unpack; then the fields follow one another, each for all points."""
    packed, size = int.from_bytes(body[:4], "little"), int.from_bytes(body[4:8], "little")
    sizes = [np.dtype(kind).itemsize * n for kind, n in zip(header.types, header.counts, strict=True)]
    if packed > len(body) - 8 or size != header.points * sum(sizes) or size > 256 * packed:
        raise content.refused(f"declares {header.points} points, which its {len(body)} bytes do not hold", _CUT)
    data = lzf_unpacked(body[8 : 8 + packed], size)
    if data is None:
        raise content.refused("has damaged compressed data", "Export or copy it again.")
    starts = np.cumsum([0, *sizes]) * header.points
    fields = enumerate(zip(header.names, header.types, header.counts, strict=True))
    return {
        name: np.frombuffer(data, kind, header.points * n, starts[i]).reshape(header.points, n)[:, 0].astype(np.float64)
        for i, (name, kind, n) in fields
        if n
    }
