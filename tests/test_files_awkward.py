"""Awkward inputs are refused with a sentence, or read with a remark; nothing hangs, crashes or passes unseen."""

from __future__ import annotations

import os
import struct
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from inspect3d.files.cloud import read_cloud
from inspect3d.files.mesh import read_mesh
from inspect3d.outcome import InputError

PLY = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
BINARY_PLY = PLY.replace("ascii", "binary_little_endian")
FACES = "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
PCD = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {0}\nHEIGHT 1\nPOINTS {0}\nDATA {1}\n"
STATION = "2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
HUGE = 10**15


def saved(folder: Path, name: str, data: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.ply", PLY.format(HUGE) + "1 2 3\n", f"before the {HUGE} rows"),
        ("a.ply", BINARY_PLY.format(HUGE).encode() + bytes(36), f"before the {HUGE} rows"),
        ("a.ply", BINARY_PLY.format(4).encode() + bytes(40), "before the 4 rows"),
        ("a.ply", PLY.format(1) + "1 2 3\n4 5 6\n", "3 numbers more"),
        ("a.ply", PLY.format(1) + "1 2 three\n", "'three'"),
        ("a.ply", PLY.format(0), "is an empty cloud"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "x, y and z"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex -1\nproperty float x\nend_header\n1\n", "line 3 is not PLY"),
        ("a.pts", f"{HUGE}\n1 2 3\n4 5 6\n", f"declares {HUGE} points and holds 2"),
        ("a.pts", "1\n1 2 3\n4 5 6\n", "goes on after the 1 points"),
        ("a.ptx", STATION + "1 2 3\n4 5 6\n", "declares 4 points"),
        ("a.ptx", STATION[:20], "ends within the ten lines"),
        ("a.ptx", "1 2 3\n" * 20, "size of a station"),
        ("a.pcd", PCD.format(HUGE, "ascii") + "1 2 3\n", f"declares {HUGE} points"),
        ("a.pcd", PCD.format(HUGE, "binary").encode() + bytes(36), f"declares {HUGE} points and holds 3"),
        (
            "a.pcd",
            PCD.format(HUGE, "binary_compressed").encode() + struct.pack("<II", 4, 2**32 - 1) + bytes(4),
            "points",
        ),
        ("a.pcd", PCD.format(2, "binary_compressed").encode() + struct.pack("<II", 4, 24) + b"\xff" * 4, "damaged"),
        ("a.pcd", PCD.format(1, "zipped") + "1 2 3\n", "'zipped'"),
        ("a.off", f"OFF\n{HUGE} 1 0\n0 0 0\n", f"declares {HUGE} vertices"),
        ("a.las", b"LASF" + bytes(400), "cannot be read as LAS"),
        ("a.e57", b"ASTM-E57" + bytes(2000), "cannot be read as E57"),
        ("a.e57", b"hello", "cannot be read as E57"),
        ("a.xyz", "1 2 3\n4 5\n", "2 columns in line 2 and 3 in the lines before"),
        ("a.xyz", "# a\n\n1 2 3\n4 five 6\n", "'five' in line 4"),
        ("a.xyz", "1 2\n3 4\n", "2 columns where x, y and z"),
        ("a.csv", "a,b,c\n1,2,3\n", "neither numbers nor names"),
        ("a.csv", "x,y,z\n1,2,3,4\n", "names 3 columns and has 4"),
        ("a.xyz", "3\nwater\nO 0 0 0\nH 1 0 0\nH 0 1 0\n", "neither numbers nor names"),
        ("a.xyz", "# only a comment\n", "no rows of numbers"),
        ("a.xyz", b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "neither numbers nor names"),
        ("a.xyz", b"\xff\xfe1\x00 ", "starts as utf-16 text"),
        ("a.xyz", "", "is empty"),
        ("a.xyz", " \n \n", "is empty"),
        ("a.xyz", "nan nan nan\ninf 1 2\n", "its 2 points have no finite coordinates"),
        ("a.step", "ISO-10303-21;", "no known format"),
        ("a.ply.gz", b"\x1f\x8b\x08\x00", "cannot be unpacked"),
        ("a.zip", b"PK\x03\x04 and no more", "cannot be unpacked"),
        ("a.3mf", b"PK\x03\x04 and no more", "cannot be unpacked"),
    ],
)
def test_a_broken_cloud_is_refused_with_a_sentence(tmp_path: Path, name: str, data: bytes | str, words: str) -> None:
    with pytest.raises(InputError) as refusal:
        read_cloud(saved(tmp_path, name, data))
    sentence = str(refusal.value)
    assert words in sentence
    assert name in sentence
    assert sentence.endswith(".")
    assert "\n" not in sentence


LOOP = "outer loop\nvertex 0 0 0\nvertex {} 0 0\nvertex 0 1 0\n{}endloop"
FACET = f"solid a\nfacet normal 0 0 1\n{LOOP}\nendfacet\nendsolid a\n"
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
MODEL = (
    '<model unit="{0}"><resources><object id="1"><mesh><vertices>{1}</vertices><triangles>{2}</triangles></mesh>{3}'
    "</object></resources><build>{4}</build></model>"
)
CORNERS = '<vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>'
TRIANGLE = '<triangle v1="0" v2="1" v3="2"/>'
ITEM = '<item objectid="1"/>'


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.obj", SQUARE + "f 1 2 3 4 9\n", "refers to vertex 9 of 4 in line 5"),
        ("a.obj", SQUARE + "f 0 1 2\n", "refers to vertex 0 of 4"),
        ("a.obj", SQUARE + "f -5 1 2\n", "refers to vertex -5 of 4"),
        ("a.obj", SQUARE + "f 1 2.5 3\n", "refers to vertex 2.5"),
        ("a.obj", SQUARE + "f 1 2\n", "2 corners in line 5"),
        ("a.obj", SQUARE + "f 1 2 nan\n", "vertex nan"),
        ("a.obj", SQUARE + "v 1 2\nf 1 2 3\n", "2 numbers in line 5"),
        ("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "1 vertices whose coordinates are not finite"),
        ("a.obj", SQUARE + "v 2 2 0\nf 1 3 2 4 5\n", "crosses itself"),
        ("a.obj", SQUARE, "4 points but no triangles"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "refers to vertex 7 in face 1"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n", "of 2 corners"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "not as many as it says"),
        ("a.off", "OFF BINARY\n3 1 0\n", "binary OFF"),
        (
            "a.ply",
            PLY.format(3).replace("end_header\n", FACES.format(1)) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
            "vertex 3",
        ),
        (
            "idx.ply",
            PLY.format(3).replace("end_header\n", FACES.format(1)) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n",
            "vertex -1",
        ),
        (
            "cut.ply",
            PLY.format(3).replace("end_header\n", FACES.format(9)) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
            "9 rows",
        ),
        (
            "a.stl",
            "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n",
            "begins 1 facets and ends 0",
        ),
        ("two.stl", FACET.format(1, "") + FACET.format(2, "")[:-20], "begins 2 facets and ends 1"),
        ("quad.stl", 3 * FACET.format(1, "vertex 1 1 0\n"), "a facet that is not a triangle"),
        ("word.stl", FACET.format("one", ""), "a corner without three numbers"),
        ("a.stl", bytes(80) + struct.pack("<I", 2**31) + bytes(100), "declares 2147483648 triangles and holds 2"),
        ("a.stl", b"no STL", "fewer than the header"),
    ],
)
def test_a_broken_mesh_is_refused_with_a_sentence(tmp_path: Path, name: str, data: bytes | str, words: str) -> None:
    with pytest.raises(InputError) as refusal:
        read_mesh(saved(tmp_path, name, data))
    assert words in str(refusal.value)
    assert name in str(refusal.value)


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (MODEL.format("inch", CORNERS, TRIANGLE, "", ""), "nothing to build"),
        (MODEL.format("cubit", CORNERS, TRIANGLE, "", ITEM), "unknown unit 'cubit'"),
        (MODEL.format("inch", CORNERS, TRIANGLE.replace('"2"', '"3"'), "", ITEM), "not there"),
        (MODEL.format("inch", CORNERS.replace('x="1" ', ""), TRIANGLE, "", ITEM), "lacks something"),
        (MODEL.format("inch", CORNERS.replace("1", "one"), TRIANGLE, "", ITEM), "'one'"),
        (MODEL.format("inch", CORNERS, TRIANGLE, "", '<item objectid="2"/>'), "object 2, which is not in it"),
        (MODEL.format("inch", CORNERS, TRIANGLE, '<component objectid="1"/>', ITEM), "without end"),
        (MODEL.format("inch", CORNERS, TRIANGLE, "", ITEM)[:-9], "not XML"),
        (MODEL.format("inch", "", "", "", ITEM), "holds no triangles"),
    ],
)
def test_a_broken_3mf_is_refused_with_a_sentence(tmp_path: Path, model: str, words: str) -> None:
    with zipfile.ZipFile(tmp_path / "a.3mf", "w") as archive:
        archive.writestr("3D/3dmodel.model", model)
    with pytest.raises(InputError) as refusal:
        read_mesh(tmp_path / "a.3mf")
    assert words in str(refusal.value)


def test_a_missing_file_a_folder_and_a_pipe_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.ply")
    for read in (read_cloud, read_mesh):
        for name, words in (("none.ply", "does not exist"), ("", "is a folder"), ("pipe.ply", "not a regular file")):
            with pytest.raises(InputError, match=words):
                read(tmp_path / name)


def test_a_file_without_permission_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    path = saved(tmp_path, "a.xyz", "1 2 3\n")
    monkeypatch.setattr(Path, "open", forbidden)
    with pytest.raises(InputError, match=r"Permission denied\. Check its permissions"):
        read_cloud(path)


def test_an_archive_of_two_scans_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("a.xyz", "1 2 3\n")
        archive.writestr("b.xyz", "1 2 3\n")
    with pytest.raises(InputError, match="2 files of known formats"):
        read_cloud(tmp_path / "a.zip")


@pytest.mark.parametrize("missing", [np.nan, np.inf, -np.inf, 3.4e38])
def test_points_that_are_not_finite_are_dropped_and_counted(tmp_path: Path, missing: float) -> None:
    points = np.arange(15, dtype="<f4").reshape(5, 3)
    points[2, 1] = missing
    whole = np.delete(points, 2, axis=0)
    text = "\n".join(" ".join(map(str, row)) for row in points)
    files = {
        "a.ply": BINARY_PLY.format(5).encode() + points.tobytes(),
        "b.ply": PLY.format(5).encode() + text.encode(),
        "a.pcd": PCD.format(5, "binary").encode() + points.tobytes(),
        "a.pts": f"5\n{text}".encode(),
        "a.xyz": text.encode(),
    }
    for name, data in files.items():
        found = read_cloud(saved(tmp_path, name, data))
        np.testing.assert_array_equal(found.points, whole)
        assert "1 of 5 points" in found.remarks[-1]


def test_a_cloud_of_three_points_is_read(tmp_path: Path) -> None:
    assert len(read_cloud(saved(tmp_path, "a.xyz", "1 2 3\n4 5 6\n7 8 9")).points) == 3


def test_contents_decide_where_the_suffix_says_otherwise(tmp_path: Path) -> None:
    found = read_cloud(saved(tmp_path, "a.xyz", PLY.format(1) + "1 2 3\n"))
    assert found.points.tolist() == [[1, 2, 3]]
    assert found.remarks == ("a.xyz is PLY by its contents and was read as such.",)


def test_numbers_too_many_in_a_row_are_ignored_with_a_remark(tmp_path: Path) -> None:
    head = PLY.format(3).replace("end_header\n", FACES.format(1))
    found = read_mesh(saved(tmp_path, "a.ply", head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 7 7 7\n"))
    assert found.triangles.tolist() == [[0, 1, 2]]
    assert "does not declare" in found.remarks[0]


HEADS = [
    PLY.format(3).encode(),
    PLY.format(3).replace("end_header\n", FACES.format(2)).encode(),
    BINARY_PLY.format(3).replace("end_header\n", FACES.format(2)).encode(),
    PCD.format(3, "binary_compressed").encode(),
    PCD.format(3, "ascii").encode(),
    STATION.encode(),
    b"OFF\n3 1 0\n",
    b"solid a\nfacet normal 0 0 1\n",
    SQUARE.encode() + b"f ",
    b"x,y,z\n",
    b"",
]


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    head=st.sampled_from(HEADS),
    body=st.one_of(st.binary(max_size=80), st.text("0123456789 .,;-e\n\t/#xnaf", max_size=80).map(str.encode)),
    suffix=st.sampled_from(["ply", "stl", "obj", "off", "pcd", "ptx", "pts", "xyz", "csv"]),
)
def test_noise_is_read_or_refused_but_never_breaks_the_reader(
    tmp_path: Path, head: bytes, body: bytes, suffix: str
) -> None:
    path = saved(tmp_path, f"a.{suffix}", head + body)
    for read in (read_cloud, read_mesh):
        with suppress(InputError):
            found = read(path)
            assert found.units is None
