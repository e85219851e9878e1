"""E57, LAS and LAZ files as their own libraries write them."""

from __future__ import annotations

import struct
from pathlib import Path

import laspy
import numpy as np
import pye57
import pytest
from pye57 import libe57

from inspect3d.files.cloud import read_cloud
from inspect3d.outcome import InputError

POINTS = np.random.default_rng(7).normal(0, 10, size=(40, 3)).astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_a_las_cloud_comes_back_to_its_scale(tmp_path: Path, suffix: str) -> None:
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = np.full(3, 1e-4), np.array([600000.0, 4000000.0, 100.0])
    written = laspy.LasData(header)
    written.x, written.y, written.z = (POINTS + header.offsets).T
    written.write(tmp_path / f"a.{suffix}")
    np.testing.assert_allclose(read_cloud(tmp_path / f"a.{suffix}").points, POINTS + header.offsets, atol=5.1e-5)


@pytest.mark.parametrize(
    ("at", "kind", "value"), [(100, "<I", 2**32 - 1), (96, "<I", 2**31), (107, "<I", 10**9), (243, "<I", 2**31)]
)
def test_a_las_header_that_announces_more_than_there_is_is_refused_at_once(
    tmp_path: Path, at: int, kind: str, value: int
) -> None:
    """The number of records, where the points begin, their number, the number of extended records."""
    version = "1.4" if at > 227 else "1.2"
    written = laspy.LasData(laspy.LasHeader(point_format=0, version=version))
    written.x, written.y, written.z = POINTS.T
    written.write(tmp_path / "a.las")
    data = bytearray((tmp_path / "a.las").read_bytes())
    struct.pack_into(kind, data, at, value)
    (tmp_path / "a.las").write_bytes(data)
    with pytest.raises(InputError, match=r"a\.las"):
        read_cloud(tmp_path / "a.las")


@pytest.mark.parametrize(
    ("reference", "unit"),
    [
        ('PROJCS["p",GEOGCS["g",UNIT["degree",0.0174532925199433]],UNIT["metre",1]]', "m"),
        (
            'PROJCS["p",GEOGCS["g",UNIT["degree",0.0174532925199433]],UNIT["US survey foot",0.3048006096012192]]',
            "US survey ft",
        ),
        ('PROJCRS["p",BASEGEOGCRS["g",ANGLEUNIT["degree",0.01745]],LENGTHUNIT["foot",0.3048]]', "ft"),
        ('LOCAL_CS["rig",UNIT["rod",5.0292]]', "5.0292 m"),
        ("", None),
    ],
)
def test_the_unit_of_the_reference_system_is_told(tmp_path: Path, reference: str, unit: str | None) -> None:
    assert read_cloud(las_in(tmp_path, reference)).units == unit


def test_degrees_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="degrees of longitude"):
        read_cloud(las_in(tmp_path, 'GEOGCS["g",UNIT["degree",0.0174532925199433]]'))


def las_in(folder: Path, reference: str) -> Path:
    header = laspy.LasHeader(point_format=0, version="1.4")
    header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(reference))
    written = laspy.LasData(header)
    written.x, written.y, written.z = POINTS.T
    written.write(folder / "a.las")
    return folder / "a.las"


def e57_file(path: Path, columns: dict[str, np.ndarray], pose: tuple[list[float], list[float]]) -> Path:
    file = pye57.E57(str(path), mode="w")
    image = file.image_file
    scan, prototype = libe57.StructureNode(image), libe57.StructureNode(image)
    scan.set("guid", libe57.StringNode(image, "{1}"))
    for name, values, axes in (("rotation", pose[0], "wxyz"), ("translation", pose[1], "xyz")):
        if not scan.isDefined("pose"):
            scan.set("pose", libe57.StructureNode(image))
        node = libe57.StructureNode(image)
        for axis, value in zip(axes, values, strict=True):
            node.set(axis, libe57.FloatNode(image, value))
        scan["pose"].set(name, node)
    for name, column in columns.items():
        whole = column.dtype.kind == "i"
        prototype.set(name, libe57.IntegerNode(image, 0, 0, 2) if whole else libe57.FloatNode(image, 0.0))
    points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
    scan.set("points", points)
    file.data3d.append(scan)
    buffers = libe57.VectorSourceDestBuffer()
    for name, column in columns.items():
        buffers.append(libe57.SourceDestBuffer(image, name, column, len(column), True, True))
    writer = points.writer(buffers)
    writer.write(len(POINTS))
    writer.close()
    file.close()
    return path


def test_spherical_coordinates_of_e57_become_cartesian_and_are_placed(tmp_path: Path) -> None:
    distance = np.linalg.norm(POINTS, axis=1)
    columns = {
        "sphericalRange": distance,
        "sphericalAzimuth": np.arctan2(POINTS[:, 1], POINTS[:, 0]),
        "sphericalElevation": np.arcsin(POINTS[:, 2] / distance),
    }
    half = np.sqrt(0.5)
    found = read_cloud(e57_file(tmp_path / "Prüfling 零件.e57", columns, ([half, 0, 0, half], [1, 2, 3])))
    turned = np.column_stack([1 - POINTS[:, 1], 2 + POINTS[:, 0], 3 + POINTS[:, 2]])
    np.testing.assert_allclose(found.points, turned, atol=1e-12)


def test_points_that_e57_calls_invalid_are_dropped(tmp_path: Path) -> None:
    invalid = np.zeros(len(POINTS), dtype=np.int8)
    invalid[[3, 5]] = 1, 2
    columns = {f"cartesian{axis}": POINTS[:, i].copy() for i, axis in enumerate("XYZ")}
    columns["cartesianInvalidState"] = invalid
    found = read_cloud(e57_file(tmp_path / "a.e57", columns, ([1, 0, 0, 0], [0, 0, 0])))
    np.testing.assert_array_equal(found.points, POINTS[invalid == 0])
    assert "2 points" in found.remarks[0]
