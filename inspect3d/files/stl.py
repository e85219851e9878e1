"""STL files, through trimesh.

trimesh gives half of a part whose second solid is cut off, and makes four triangles of three quadrilaterals; so the
facets are counted here first.
"""

from __future__ import annotations

import io
import re

import numpy as np

from inspect3d.files.content import Content
from inspect3d.files.found import Found

_CUT = "It was cut short or is not a triangle mesh: export or copy it again."


def read_stl(content: Content) -> Found:
    """Read the triangles of a binary or ascii STL file; several solids follow one another."""
    data = content.data
    declared = int.from_bytes(data[80:84], "little")
    size = 84 + 50 * declared
    if len(data) >= 84 and len(data) == size:
        return _loaded(content, data, declared, ())
    text = content.text()
    if text.lstrip()[:5].lower() == b"solid" and re.search(rb"facet|endsolid", text, re.IGNORECASE):
        return _ascii(content, text)
    if len(data) < 84:
        raise content.refused(f"has {len(data)} bytes, fewer than the header of a binary STL file")
    if len(data) > size > 84:
        ignored = f"{content.path.name}: {len(data) - size} bytes after the last triangle were ignored."
        return _loaded(content, data[:size], declared, (ignored,))
    held = (len(data) - 84) // 50
    raise content.refused(
        f"declares {declared} triangles and holds {held}", "It was cut short: export or copy it again."
    )


def _ascii(content: Content, text: bytes) -> Found:
    body, ends = _without_names(text.lower())
    begun, ended = len(re.findall(rb"\bfacet\b", body)), body.count(b"endfacet")
    if begun != ended:
        raise content.refused(f"begins {begun} facets and ends {ended}", _CUT)
    if any(facet.count(b"vertex") != 3 for facet in body.split(b"endfacet")[:-1]):
        raise content.refused("has a facet that is not a triangle", _CUT)
    unfinished = f"{content.path.name} lacks its last line, endsolid: it may have been cut short."
    return _loaded(content, b"solid\n" + body + b"\nendsolid\n", ended, () if ends else (unfinished,))


def _loaded(content: Content, data: bytes, facets: int, remarks: tuple[str, ...]) -> Found:
    import trimesh

    if not facets:
        return Found(np.zeros((0, 3)), remarks=remarks)
    try:
        mesh = trimesh.load_mesh(io.BytesIO(data), file_type="stl", process=False)
        points = np.array(mesh.vertices, dtype=np.float64)
    except ValueError:
        points = np.zeros((0, 3))
    if len(points) != 3 * facets:
        raise content.refused("has a corner without three numbers", _CUT)
    corners, sizes = np.arange(len(points), dtype=np.int64), np.full(facets, 3, dtype=np.int64)
    return Found(points, corners=corners, sizes=sizes, remarks=remarks)


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
