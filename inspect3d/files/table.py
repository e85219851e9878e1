"""Rows of numbers in a text."""

from __future__ import annotations

import io
import warnings

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.files.content import Content


def table(
    content: Content,
    text: bytes,
    first_line: int,
    delimiter: str | None = None,
    columns: tuple[int, ...] | None = None,
) -> Floats:
    """Return the numbers of a text, a row per line, (rows, columns); blank lines are passed over.

    Parameters
    ----------
    text : UTF-8
    first_line : the number of its first line in the file, for messages
    delimiter : one character between the columns; None for white space
    columns : those wanted, from 0; None for all, and then every row has equally many

    Raises
    ------
    InputError
        A row has a word that is not a number, or another number of columns; names the line.
    """
    if not text.strip():
        return np.zeros((0, len(columns) if columns else 3))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return np.loadtxt(
                io.BytesIO(text), comments=None, delimiter=delimiter, usecols=columns, ndmin=2, encoding="utf-8"
            )
    except ValueError as error:
        raise content.refused(_what_is_wrong(text, first_line, delimiter, columns)) from error


def _what_is_wrong(text: bytes, first_line: int, delimiter: str | None, columns: tuple[int, ...] | None) -> str:
    width = 0
    for number, line in enumerate(text.decode("utf-8", "replace").split("\n"), start=first_line):
        words = line.strip().split(delimiter)
        if not line.strip():
            continue
        width = width or len(words)
        if (columns is None and len(words) != width) or (columns and max(columns) >= len(words)):
            return f"has {len(words)} columns in line {number} and {width} in the lines before it"
        for column in columns or range(width):
            try:
                float(words[column])
            except ValueError:
                return f"has {words[column][:40]!r} in line {number} where a number is expected"
    return "has a line that is not numbers"
