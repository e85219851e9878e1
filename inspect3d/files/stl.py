"""STL files."""

from __future__ import annotations

import re

import numpy as np

from inspect3d.files.content import Content
from inspect3d.files.found import Found
from inspect3d.files.numbers import numbers

_FACET = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])
_SOLID = re.compile(rb"^[ \t]*(?:end)?solid\b[^\n]*$", re.MULTILINE | re.IGNORECASE)
_WORDS = (b"facet normal", b"outer loop", b"vertex", b"endloop", b"endfacet")
_SPACES = re.compile(rb"(facet|outer)\s+(normal|loop)")


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
    name = content.path.name
    ends = len(re.findall(rb"^[ \t]*endsolid\b", text, re.MULTILINE | re.IGNORECASE))
    body = _SPACES.sub(rb"\1 \2", _SOLID.sub(b"", text).lower())
    # `endfacet` holds `facet` and `endloop` holds `loop`, so the words are counted whole and taken out in order
    counts = [body.count(word) for word in _WORDS]
    if len({counts[0], counts[1], counts[2] / 3, counts[3], counts[4]}) > 1:
        raise content.refused(
            f"begins {counts[0]} facets, ends {counts[4]} and has {counts[2]} vertices instead of three each",
            "It was cut short or is not a triangle mesh: export or copy it again.",
        )
    for word in _WORDS:
        body = body.replace(word, b" ")
    values = numbers(content, body)
    if len(values) != 12 * counts[0]:
        raise content.refused(f"has {len(values)} numbers in {counts[0]} facets where there should be twelve each")
    unfinished = (f"{name} lacks its last line, endsolid: it may have been cut short.",) if not ends else ()
    return _soup(values.reshape(-1, 4, 3)[:, 1:].reshape(-1, 3), unfinished)


def _soup(points: np.ndarray, remarks: tuple[str, ...]) -> Found:
    sizes = np.full(len(points) // 3, 3, dtype=np.int64)
    return Found(points, corners=np.arange(len(points), dtype=np.int64), sizes=sizes, remarks=remarks)
