"""The header of a PLY file."""

from __future__ import annotations

import re
from dataclasses import dataclass

from inspect3d.files.content import Content

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_DIGITS = 18
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_END = re.compile(rb"[\r\n]end_header[ \t]*(\r\n|\n|\r|$)")


@dataclass(frozen=True)
class Property:
    """A column of an element; `count` is the type of the length of a list, None for a single number."""

    name: str
    type: str
    count: str | None = None


@dataclass(frozen=True)
class Element:
    """A table of the file: its name, its number of rows, its columns."""

    name: str
    rows: int
    properties: tuple[Property, ...]


@dataclass(frozen=True)
class PlyHeader:
    """What a PLY file says about itself.

    Parameters
    ----------
    order : "<" or ">" of binary numbers, empty for ascii
    elements : in the order of the file
    length : bytes up to the data
    """

    order: str
    elements: tuple[Element, ...]
    length: int


def read_ply_header(content: Content) -> PlyHeader:
    """Read the header.

    Raises
    ------
    InputError
        It does not end, or has a line that is not PLY; the line is quoted.
    """
    end = _END.search(content.data)
    if not content.data.startswith(b"ply") or end is None:
        raise content.refused("does not start with a PLY header from `ply` to `end_header`")
    returns_only = end[1] == b"\r\n" and b"\n" not in content.data[: end.start()]
    length = end.end() - 1 if returns_only else end.end()
    order: str | None = None
    elements: list[Element] = []
    for number, line in enumerate(content.data[: end.start()].decode("ascii", "replace").splitlines(), start=1):
        words = line.split()
        match words:
            case [] | ["ply", *_] | ["comment", *_] | ["obj_info", *_]:
                continue
            case ["format", name, "1.0"] if name in _ORDERS and order is None:
                order = _ORDERS[name]
            case ["element", name, rows] if (
                rows.isdecimal() and len(rows) < _DIGITS and name not in [known.name for known in elements]
            ):
                elements.append(Element(name, int(rows), ()))
            case ["property", "list", count, kind, name] if elements and count in _TYPES and kind in _TYPES:
                elements[-1] = _widened(elements[-1], Property(name.lower(), _TYPES[kind], _TYPES[count]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1] = _widened(elements[-1], Property(name.lower(), _TYPES[kind]))
            case _:
                raise content.refused(f"has a header whose line {number} is not PLY: {line[:60]!r}")
    if order is None:
        raise content.refused("has a header without a format line")
    return PlyHeader(order, tuple(elements), length)


def _widened(element: Element, column: Property) -> Element:
    return Element(element.name, element.rows, (*element.properties, column))
