"""STL files."""

from __future__ import annotations

import re

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.files.content import Content
from inspect3d.files.found import Found
from inspect3d.files.numbers import numbers

_FACET = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])
_POINT = (b"vertex", b"", b"", b"")
_FACET_WORDS = (b"facet", b"normal", b"", b"", b"", b"outer", b"loop", *_POINT * 3, b"endloop", b"endfacet")
_COORDINATES = (8, 9, 10, 12, 13, 14, 16, 17, 18)
_PIECE = 2**22


def read_stl(content: Content) -> Found:
    """Read the triangles of a binary or ascii STL file; several solids follow one another."""
    data = content.data
    declared = int.from_bytes(data[80:84], "little")
    if len(data) >= 84 and len(data) == 84 + 50 * declared:
        return _binary(content, declared)
    text = content.text()
    if text.lstrip()[:5].lower() == b"solid" and re.search(rb"facet|endsolid", text, re.IGNORECASE):
        return _ascii(content, text)
    if len(data) < 84:
        raise content.refused(f"has {len(data)} bytes, fewer than the header of a binary STL file")
    if len(data) > 84 + 50 * declared > 84:
        extra = len(data) - 84 - 50 * declared
        return _binary(
            content, declared, (f"{content.path.name}: {extra} bytes after the last triangle were ignored.",)
        )
    held = (len(data) - 84) // 50
    raise content.refused(
        f"declares {declared} triangles and holds {held}", "It was cut short: export or copy it again."
    )


def _binary(content: Content, count: int, remarks: tuple[str, ...] = ()) -> Found:
    facets = np.frombuffer(content.data, _FACET, count, offset=84)
    return _soup(facets["points"].astype(np.float64).reshape(-1, 3), remarks)


def _ascii(content: Content, text: bytes) -> Found:
    body, ends = _without_names(text.lower())
    pieces = []
    start = 0
    while start < len(body):
        stop = body.find(b"endfacet", start + _PIECE)
        stop = len(body) if stop < 0 else stop + len(b"endfacet")
        pieces.append(_facets(content, body[start:stop].split()))
        start = stop
    unfinished = (
        (f"{content.path.name} lacks its last line, endsolid: it may have been cut short.",) if not ends else ()
    )
    return _soup(np.concatenate([*pieces, np.zeros((0, 3))]), unfinished)


def _facets(content: Content, words: list[bytes]) -> Floats:
    """Return the corners (3 n, 3) of facets that are written word by word as the format wants them."""
    if len(words) % len(_FACET_WORDS) or any(
        word and not set(words[i :: len(_FACET_WORDS)]) <= {word} for i, word in enumerate(_FACET_WORDS)
    ):
        begun, ended = words.count(b"facet"), words.count(b"endfacet")
        what = f"begins {begun} facets and ends {ended}" if begun != ended else "has a facet that is not a triangle"
        raise content.refused(what, "It was cut short or is not a triangle mesh: export or copy it again.")
    corners = [words[i :: len(_FACET_WORDS)] for i in _COORDINATES]
    return np.column_stack([numbers(content, b" ".join(column)) for column in corners]).reshape(-1, 3)


def _without_names(text: bytes) -> tuple[bytes, int]:
    """Return the text without the lines `solid` and `endsolid`, whose names may be any words; and count the latter."""
    kept, ends, start = [], 0, 0
    while (at := text.find(b"solid", start)) >= 0:
        line = text.rfind(b"\n", 0, at) + 1
        kept.append(text[start:line])
        ends += text[line:at].strip() == b"end"
        end = text.find(b"\n", at)
        start = len(text) if end < 0 else end
    return b"".join([*kept, text[start:]]), ends


def _soup(points: Floats, remarks: tuple[str, ...]) -> Found:
    sizes = np.full(len(points) // 3, 3, dtype=np.int64)
    return Found(points, corners=np.arange(len(points), dtype=np.int64), sizes=sizes, remarks=remarks)
