"""How the columns of a text of points are laid out."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from inspect3d.files.content import Content

_COMMENT = re.compile(r"(#|//|%|!)+\s*")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?|[-+]?(nan|inf|infinity)", re.IGNORECASE)
_INNER_COMMA = re.compile(r"[^,]*,[^,]+|[^,]+")
_UNIT = re.compile(r"\s*[\[(][^\])]*[\])]|_(mm|cm|m|um|in|inch)\b", re.IGNORECASE)
_NAMES = {
    "x": ("x", "xcoord", "coordx", "xcoordinate", "points0", "points:0", "px", "posx", "positionx", "easting"),
    "y": ("y", "ycoord", "coordy", "ycoordinate", "points1", "points:1", "py", "posy", "positiony", "northing"),
    "z": ("z", "zcoord", "coordz", "zcoordinate", "points2", "points:2", "pz", "posz", "positionz", "elevation"),
    "nx": ("nx", "normalx", "xnormal", "normals0", "normals:0"),
    "ny": ("ny", "normaly", "ynormal", "normals1", "normals:1"),
    "nz": ("nz", "normalz", "znormal", "normals2", "normals:2"),
}


@dataclass(frozen=True)
class TextLayout:
    """Where the numbers are.

    Parameters
    ----------
    delimiter : one character; None for white space
    skipped : lines before the first row
    width : columns of the first row
    places : the columns of x, y, z and perhaps nx, ny, nz, from 0; empty where the file does not name its columns
    numeric : all columns are numbers, and no delimiter ends a row
    """

    delimiter: str | None
    skipped: int
    width: int
    places: dict[str, int]
    numeric: bool


def text_layout(content: Content, lines: Iterable[bytes]) -> TextLayout:
    """Tell the layout from the first lines.

    Before the rows may stand comments (#, //, %, !) and one line that names the columns; a comment may name them too.
    White space, semicolons or commas part the columns; a comma beside white space or semicolons is the decimal point.

    Raises
    ------
    InputError
        There are no rows, or the line before them neither is a comment nor names x, y and z.
    """
    names: list[str] = []
    titled = False
    for skipped, raw in enumerate(lines):
        line = raw.decode("utf-8", "replace").strip()
        comment = _COMMENT.match(line)
        if comment:
            names = _names(line[comment.end() :]) or names
        if comment or not line:
            continue
        delimiter = _delimiter(line)
        words = _words(line, delimiter)
        numeric = all(_NUMBER.fullmatch(word if delimiter == "," else word.replace(",", ".")) for word in words)
        if not titled and not numeric:
            titled, names = True, _names(line)
            if names:
                continue
            raise content.refused(
                f"has {line[:60]!r} in line {skipped + 1}, neither numbers nor names of columns with x, y and z",
                "Points are rows of numbers x y z; put # before any other line.",
            )
        if titled and len(names) != len(words):
            raise content.refused(f"names {len(names)} columns and has {len(words)} in line {skipped + 1}")
        places = _places(names) if len(names) == len(words) else {}
        whole = numeric and len(words) == len(line.split(delimiter))
        return TextLayout(delimiter, skipped, len(words), places, whole)
    raise content.refused("has no rows of numbers", "Points are rows of numbers x y z.")


def _delimiter(line: str) -> str | None:
    """Return what parts the columns of a row; commas inside of words that white space parts are decimal points."""
    if ";" in line:
        return ";"
    words = line.split()
    if "," in line and not (len(words) >= 3 and all(_INNER_COMMA.fullmatch(word) for word in words)):
        return ","
    return "\t" if "\t" in line and all(len(field.split()) <= 1 for field in line.split("\t")) else None


def _words(line: str, delimiter: str | None) -> list[str]:
    """Return the words of a row, without the empty one behind a delimiter at its end."""
    words = [word.strip() for word in line.split(delimiter)]
    return words[:-1] if len(words) > 1 and not words[-1] else words


def _names(line: str) -> list[str]:
    """Return the names of the columns in lower case without units; nothing where x, y and z are not among them."""
    line = _UNIT.sub("", line.lower().replace('"', ""))
    delimiter = next((mark for mark in (";", ",", "\t") if mark in line), None)
    names = [re.sub(r"[\s_.-]", "", word) for word in _words(line, delimiter)]
    return names if {"x", "y", "z"} <= _places(names).keys() else []


def _places(names: list[str]) -> dict[str, int]:
    """Return the column of each axis that exactly one name stands for."""
    found = {axis: [i for i, name in enumerate(names) if name in known] for axis, known in _NAMES.items()}
    return {axis: columns[0] for axis, columns in found.items() if len(columns) == 1}
