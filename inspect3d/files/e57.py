"""E57 files (ASTM E2807)."""

from __future__ import annotations

from typing import Any

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.files.content import Content
from inspect3d.files.found import Found

_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_NORMALS = ("nor:normalX", "nor:normalY", "nor:normalZ")


def read_e57(content: Content) -> Found:
    """Read all scans into the frame of the file, in metres; points that the scanner calls invalid are dropped.

    Spherical coordinates are turned into cartesian ones. Nothing but coordinates, their validity and normals is read.
    """
    import pye57

    name = content.path.name
    try:
        # libE57 reports a damaged file through many types of exception, so all are taken for one
        file = pye57.E57(str(content.path))
        scans = [_scan(file, index) for index in range(file.scan_count)]
        file.close()
    except Exception as error:
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise content.refused(f"cannot be read as E57: {reason}", "Export or copy it again.") from error
    if any(scan is None for scan in scans):
        raise content.refused("has a scan with neither cartesian nor spherical coordinates")
    kept = [scan for scan in scans if scan is not None]
    normals = [scan[1] for scan in kept if scan[1] is not None]
    dropped = sum(scan[2] for scan in kept)
    return Found(
        np.concatenate([*(scan[0] for scan in kept), np.zeros((0, 3))]),
        np.concatenate(normals) if normals and len(normals) == len(kept) else None,
        parts=tuple(len(scan[0]) for scan in kept) if len(kept) > 1 else (),
        units="m",
        remarks=(f"{name}: {dropped} points that the scanner calls invalid were dropped.",) if dropped else (),
    )


def _scan(file: Any, index: int) -> tuple[Floats, Floats | None, int] | None:
    """Return points, normals and the number of points dropped; None where there are no coordinates."""
    header = file.get_header(index)
    fields = set(header.point_fields)
    if {*_CARTESIAN} <= fields:
        names, state = _CARTESIAN, "cartesianInvalidState"
    elif {*_SPHERICAL} <= fields:
        names, state = _SPHERICAL, "sphericalInvalidState"
    else:
        return None
    wanted = [*names, *(name for name in (state, *_NORMALS) if name in fields)]
    columns = _columns(file, header, wanted)
    points = np.column_stack([columns[name] for name in names])
    if names is _SPHERICAL:
        points = _cartesian(*points.T)
    normals = np.column_stack([columns[name] for name in _NORMALS]) if {*_NORMALS} <= fields else None
    valid = columns[state] == 0 if state in fields else np.ones(len(points), dtype=bool)
    rotation, translation = _pose(header.node)
    turned = None if normals is None else normals[valid] @ rotation.T
    return points[valid] @ rotation.T + translation, turned, int(np.count_nonzero(~valid))


def _columns(file: Any, header: Any, names: list[str]) -> dict[str, Floats]:
    from pye57 import libe57

    count = header.point_count
    columns = {name: np.zeros(count) for name in names}
    if count:
        buffers = libe57.VectorSourceDestBuffer()
        for name, column in columns.items():
            buffers.append(libe57.SourceDestBuffer(file.image_file, name, column, count, True, True))
        reader = header.points.reader(buffers)
        read = reader.read()
        reader.close()
        if read != count:
            raise ValueError(f"it declares {count} points in a scan and holds {read}")
    return columns


def _cartesian(distance: Floats, azimuth: Floats, elevation: Floats) -> Floats:
    level = distance * np.cos(elevation)
    return np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)])


def _pose(scan: Any) -> tuple[Floats, Floats]:
    """Return rotation (3, 3) and translation (3,) m of a scan; what the file leaves out is the identity."""
    from scipy.spatial.transform import Rotation

    rotation, translation = np.eye(3), np.zeros(3)
    if scan.isDefined("pose/rotation"):
        x, y, z, w = (scan[f"pose/rotation/{name}"].value() for name in "xyzw")
        rotation = Rotation.from_quat([x, y, z, w]).as_matrix()
    if scan.isDefined("pose/translation"):
        translation = np.array([scan[f"pose/translation/{name}"].value() for name in "xyz"])
    return rotation, translation
