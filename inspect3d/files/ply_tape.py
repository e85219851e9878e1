"""The data of a PLY file as a tape that is read from front to back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.files.ply_header import Element, Property

Column = Any


class Tape(Protocol):
    """Numbers in the order of the file; reading beyond the end raises EOFError."""

    position: int

    def take(self, kind: str, count: int) -> list[float]:
        """Return the next numbers of one type, and go on behind them."""

    def rows(self, element: Element, lengths: list[int]) -> list[Column]:
        """Return every row of an element at once, its lists all of the given lengths, and go on behind them.

        The columns are those of `flat(element)`; those of a list's numbers are (rows, length).
        """

    def left(self) -> int:
        """Return how much is left, in the units of `least`."""

    def least(self, column: Property) -> int:
        """Return the least that a row takes for a column."""


@dataclass
class AsciiTape:
    """Numbers that were words."""

    values: Floats
    position: int = 0

    def take(self, kind: str, count: int) -> list[float]:
        """Return the next numbers."""
        if count > self.left():
            raise EOFError
        self.position += count
        return self.values[self.position - count : self.position].tolist()

    def rows(self, element: Element, lengths: list[int]) -> list[Column]:
        """Return every row of an element at once."""
        widths = [width for column, n in zip(element.properties, lengths, strict=True) for width in _widths(column, n)]
        count = element.rows * sum(widths)
        if count > self.left():
            raise EOFError
        table = self.values[self.position : self.position + count].reshape(element.rows, sum(widths))
        self.position += count
        columns = np.split(table, np.cumsum(widths)[:-1], axis=1)
        singles = [single for column in element.properties for single in _singles(column)]
        return [column[:, 0] if single else column for column, single in zip(columns, singles, strict=True)]

    def left(self) -> int:
        """Return how many numbers are left."""
        return len(self.values) - self.position

    def least(self, column: Property) -> int:
        """Return one: a number, or the length of a list."""
        return 1


@dataclass
class BinaryTape:
    """Numbers as bytes, `order` "<" or ">"."""

    data: bytes
    order: str
    position: int

    def take(self, kind: str, count: int) -> list[float]:
        """Return the next numbers of one type."""
        size = np.dtype(kind).itemsize * count
        if size > self.left():
            raise EOFError
        values = np.frombuffer(self.data, self.order + kind, count, self.position)
        self.position += size
        return values.tolist()

    def rows(self, element: Element, lengths: list[int]) -> list[Column]:
        """Return every row of an element at once."""
        fields: list[Any] = []
        for column, n in zip(element.properties, lengths, strict=True):
            if column.count:
                fields.append((f"f{len(fields)}", self.order + column.count))
            shape = (n,) if column.count else ()
            fields.append((f"f{len(fields)}", self.order + column.type, shape))
        row = np.dtype(fields)
        if element.rows * row.itemsize > self.left():
            raise EOFError
        table = np.frombuffer(self.data, row, element.rows, self.position)
        self.position += element.rows * row.itemsize
        return [table[name] for name in row.names or ()]

    def left(self) -> int:
        """Return how many bytes are left."""
        return len(self.data) - self.position

    def least(self, column: Property) -> int:
        """Return the bytes of a number, or of the length of a list."""
        return np.dtype(column.count or column.type).itemsize


def _widths(column: Property, length: int) -> list[int]:
    return [1, length] if column.count else [1]


def _singles(column: Property) -> list[bool]:
    return [True, False] if column.count else [True]
