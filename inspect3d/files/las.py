"""LAS and LAZ files, COPC included."""

from __future__ import annotations

import io
import re
import struct
from typing import Any

import numpy as np

from inspect3d.files.content import Content
from inspect3d.files.found import Found

_CHUNK = 1_000_000
_RECORD, _EXTENDED_RECORD = 54, 60
_GEO_KEYS, _WKT = 34735, 2112
_MODEL, _GEOGRAPHIC, _LINEAR_UNIT = 1024, 2, 3076
_UNITS = {9001: "m", 9002: "ft", 9003: "US survey ft"}
_WKT_UNIT = re.compile(r'(?:LENGTH)?UNIT\s*\[\s*"([^"]*)"\s*,\s*([0-9.eE+-]+)')
_ANGLES = ("DEG", "RAD", "GRAD")
_DEGREES = "Project it to coordinates in metres first, for example with PDAL (filters.reprojection)."


def read_las(content: Content) -> Found:
    """Read x, y, z: the whole numbers of the file times its scale, plus its offset, in double precision.

    The unit is that of the file's coordinate reference system; coordinates in degrees are refused.
    """
    import laspy

    if not _is_whole(content.data):
        raise content.refused("has no LAS header that fits its size", "Export or copy it again.")
    try:
        # laspy and its decompressor report a damaged file through many types of exception, so all are taken for one
        with laspy.open(io.BytesIO(content.data)) as file:
            header = file.header
            units, degrees = _reference(header)
            size = header.point_format.size * header.point_count
            uncompressed = not header.are_points_compressed
            if uncompressed and size > len(content.data) - header.offset_to_point_data:
                held = (len(content.data) - header.offset_to_point_data) // header.point_format.size
                raise ValueError(f"it declares {header.point_count} points and holds {held}")
            chunks = [_coordinates(chunk) for chunk in file.chunk_iterator(_CHUNK)] if header.point_count else []
    except Exception as error:
        raise content.refused(f"cannot be read as LAS: {error}", "Export or copy it again.") from error
    points = np.concatenate([*chunks, np.zeros((0, 3))])
    if len(points) != header.point_count:
        raise content.refused(f"declares {header.point_count} points and holds {len(points)}", "Export it again.")
    if degrees:
        raise content.refused("is in degrees of longitude and latitude", _DEGREES)
    return Found(points, units=units)


def _is_whole(data: bytes) -> bool:
    """Tell whether the records that the header announces fit into the file; laspy would look for them one by one."""
    if len(data) < 227:
        return False
    minor, size, points_at, records = data[25], *struct.unpack_from("<HII", data, 94)
    if not size + _RECORD * records <= points_at <= len(data):
        return False
    if minor < 4 or size < 375:
        return minor < 4
    start, extended = struct.unpack_from("<QI", data, 235)
    return not extended or points_at <= start <= len(data) - _EXTENDED_RECORD * extended


def _coordinates(chunk: Any) -> np.ndarray:
    return np.column_stack([np.asarray(axis, dtype=np.float64) for axis in (chunk.x, chunk.y, chunk.z)])


def _reference(header: Any) -> tuple[str | None, bool]:
    """Return the unit of the coordinate reference system, and whether it is one of degrees."""
    records = [*header.vlrs, *(header.evlrs or [])]
    for record in records:
        text = getattr(record, "string", "").upper()
        if record.record_id == _WKT and text.strip("\0 "):
            projected = "PROJC" in text or "GEOCCS" in text
            units = [float(unit[2]) for unit in _WKT_UNIT.finditer(text) if not unit[1].startswith(_ANGLES)]
            return (_named(units[0]) if units else None), "GEOG" in text and not projected
        if record.record_id == _GEO_KEYS:
            keys = {key.id: key.value_offset for key in record.geo_keys}
            return _UNITS.get(keys.get(_LINEAR_UNIT, 0)), keys.get(_MODEL) == _GEOGRAPHIC
    return None, False


def _named(metres: float) -> str:
    names = {1.0: "m", 0.3048: "ft", 0.3048006096: "US survey ft", 0.001: "mm", 0.01: "cm", 0.0254: "inch"}
    nearest = min(names, key=lambda known: abs(known / metres - 1))
    return names[nearest] if abs(nearest / metres - 1) < 1e-9 else f"{metres:g} m"
