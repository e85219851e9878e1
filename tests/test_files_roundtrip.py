"""What a program writes is what the readers find: every format and encoding, written here by its rules."""

from __future__ import annotations

import bz2
import gzip
import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from inspect3d.files.cloud import read_cloud
from inspect3d.files.mesh import read_mesh

POINTS = np.random.default_rng(7).normal(0, 10, size=(40, 3)).astype(np.float32).astype(np.float64)
NORMALS = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
# a cube, its corners and its faces turned outwards
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = [piece for a, b, c, d in QUADS for piece in ((a, b, c), (a, c, d))]


def saved(folder: Path, name: str, data: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def rows(*columns: np.ndarray, between: str = " ") -> str:
    return "".join(between.join(repr(float(value)) for value in row) + "\n" for row in np.column_stack(columns))


def volume(path: Path) -> float:
    found = read_mesh(path)
    a, b, c = (found.vertices[found.triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("order", ["<", ">", ""])
@pytest.mark.parametrize("kind", ["f4", "f8"])
@pytest.mark.parametrize("line", ["\n", "\r\n"])
def test_a_ply_cloud_comes_back(tmp_path: Path, order: str, kind: str, line: str) -> None:
    form = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    name = {"f4": "float", "f8": "double"}[kind]
    columns = [f"property {name} {axis}" for axis in ("x", "y", "z", "nx", "ny", "nz")]
    header = ["ply", f"format {form} 1.0", "comment made by a test", f"element vertex {len(POINTS)}"]
    head = line.join([*header, "property uchar quality", *columns, "end_header", ""]).encode()
    row = np.dtype([("q", "u1"), ("v", (order or "<") + kind, 6)])
    table = np.zeros(len(POINTS), row)
    table["v"] = np.hstack([POINTS, NORMALS])
    body = table.tobytes() if order else rows(np.zeros(len(POINTS)), POINTS, NORMALS).replace("\n", line).encode()
    found = read_cloud(saved(tmp_path, "a.ply", head + body))
    np.testing.assert_array_equal(found.points, POINTS)
    np.testing.assert_allclose(found.normals, NORMALS, atol=1e-6)


def test_a_ply_with_old_line_ends_is_read_though_its_data_begin_with_a_newline(tmp_path: Path) -> None:
    head = "ply\rformat binary_little_endian 1.0\relement vertex 1\rproperty int x\rproperty int y\rproperty int z\r"
    found = read_cloud(saved(tmp_path, "a.ply", head.encode() + b"end_header\r" + struct.pack("<3i", 10, 2, 3)))
    assert found.points.tolist() == [[10, 2, 3]]


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_a_ply_mesh_of_triangles_and_quadrilaterals_comes_back(tmp_path: Path, form: str) -> None:
    faces = [*QUADS[:3], *TRIANGLES[6:]]
    head = f"ply\nformat {form} 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element face {len(faces)}\nproperty uchar flag\nproperty list uchar int vertex_indices\nend_header\n"
    order = ">" if "big" in form else "<"
    body = b"".join(struct.pack(f"{order}3f", *corner) for corner in CORNERS)
    body += b"".join(struct.pack(f"{order}BB{len(face)}i", 1, len(face), *face) for face in faces)
    if form == "ascii":
        body = (rows(CORNERS) + "".join(f"1 {len(face)} {' '.join(map(str, face))}\n" for face in faces)).encode()
    path = saved(tmp_path, "a.ply", head.encode() + body)
    assert volume(path) == pytest.approx(1)
    assert len(read_mesh(path).triangles) == 12


def binary_stl() -> bytes:
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *CORNERS[list(t)].ravel(), 0) for t in TRIANGLES)
    return b"solid that is binary".ljust(80, b" ") + struct.pack("<I", len(TRIANGLES)) + facets


def ascii_stl(name: str = "cube") -> str:
    loops = (
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {x} {y} {z}\n" for x, y, z in CORNERS[list(triangle)])
        + " endloop\nendfacet\n"
        for triangle in TRIANGLES
    )
    return f"solid {name}\n{''.join(loops)}endsolid {name}\n"


def obj(back: bool = False) -> str:
    faces = [[i - len(CORNERS) if back else i + 1 for i in quad] for quad in QUADS]
    lines = (" ".join(f"{i}//1" for i in face) for face in faces)
    return (
        "".join(f"v {line}\n" for line in rows(CORNERS).splitlines())
        + "vn 0 0 1\n"
        + "".join(f"f {x}\n" for x in lines)
    )


def off() -> str:
    return f"OFF # a cube\n8 6 12\n{rows(CORNERS)}" + "".join(f"4 {' '.join(map(str, q))} 255 0 0\n" for q in QUADS)


def threemf() -> bytes:
    """Return a half cube twice in one object, which is built turned by 90 degrees and shifted."""
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z / 2}"/>' for x, y, z in CORNERS)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in TRIANGLES)
    model = f"""<model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>
      <object id="1"><mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh></object>
      <object id="2"><components><component objectid="1"/>
        <component objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 0.5"/></components></object></resources>
      <build><item objectid="2" transform="0 1 0 -1 0 0 0 0 1 7 8 9"/></build></model>"""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("3D/3dmodel.model", model)
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.stl", binary_stl()),
        ("a.stl", ascii_stl()),
        ("a.stl", ascii_stl("Würfel 立方体 facet vertex")),
        ("a.stl", ascii_stl().upper()),
        ("a.stl", ascii_stl() + ascii_stl("empty")[:12] + "endsolid\n"),
        ("a.ply", binary_stl()),
        ("a.obj", obj()),
        ("a.obj", obj(back=True)),
        ("a.obj", obj().replace("\n", "\r\n").encode("utf-16")),
        ("a.off", off()),
        ("a.off", off().replace("OFF # a cube\n", "OFF ")),
        ("a.3mf", threemf()),
        ("a.off.gz", gzip.compress(off().encode())),
        ("a.obj.bz2", bz2.compress(obj().encode())),
    ],
)
def test_a_cube_comes_back_with_its_volume(tmp_path: Path, name: str, data: bytes | str) -> None:
    assert volume(saved(tmp_path, name, data)) == pytest.approx(1)


def test_instances_of_3mf_are_placed_and_their_unit_is_told(tmp_path: Path) -> None:
    found = read_mesh(saved(tmp_path, "a.3mf", threemf()))
    assert found.units == "inch"
    assert len(found.triangles) == 24
    np.testing.assert_allclose([found.vertices.min(axis=0), found.vertices.max(axis=0)], [[6, 8, 9], [7, 9, 10]])


def test_a_star_is_cut_into_triangles_that_cover_it_once(tmp_path: Path) -> None:
    """A star of 2n corners at radii 1 and r has the area n r sin(pi / n), whichever way it faces."""
    for corners in (5, 9, 40):
        angle = np.arange(2 * corners) * np.pi / corners
        radius = np.where(np.arange(2 * corners) % 2, 0.3, 1.0)
        flat = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle])
        turn = np.linalg.qr(np.random.default_rng(corners).normal(size=(3, 3)))[0]
        lines = "".join(f"v {line}\n" for line in rows(flat @ turn).splitlines())
        face = " ".join(str(i + 1) for i in range(2 * corners))
        found = read_mesh(saved(tmp_path, "star.obj", f"{lines}f {face}\n"))
        a, b, c = (found.vertices[found.triangles[:, i]] for i in range(3))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        assert area == pytest.approx(corners * 0.3 * np.sin(np.pi / corners))


def test_a_dart_is_cut_inside(tmp_path: Path) -> None:
    for shift in range(4):
        dart = np.roll([[0, 0, 0], [2, 1, 0], [0, 2, 0], [1, 1, 0]], shift, axis=0)
        found = read_mesh(saved(tmp_path, "dart.off", f"OFF\n4 1 0\n{rows(dart)}4 0 1 2 3\n"))
        a, b, c = (found.vertices[found.triangles[:, i]] for i in range(3))
        assert np.cross(b - a, c - a)[:, 2].tolist() == [1, 1]


@pytest.mark.parametrize("between", [" ", "\t", ",", ";", ", ", "  \t "])
@pytest.mark.parametrize("point", [".", ","])
@pytest.mark.parametrize(
    "title", ["", "X{0}Y{0}Z\n", "// X{0}Y{0}Z\n", "# scanned on Monday\n\n", '"x [mm]"{0}"y [mm]"{0}"z [mm]"\n']
)
def test_a_text_of_points_comes_back(tmp_path: Path, between: str, point: str, title: str) -> None:
    body = rows(POINTS, between=between).replace(".", "." if "," in between else point)
    found = read_cloud(saved(tmp_path, "a.csv", title.format(between) + body))
    np.testing.assert_array_equal(found.points, POINTS)
    assert found.remarks == ()


number = st.floats(-1e9, 1e9).map(lambda value: value + 0.0)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    points=st.lists(st.tuples(number, number, number), min_size=2, max_size=6),
    extra=st.integers(0, 3),
    between=st.sampled_from([" ", "\t", ",", ";"]),
    comma=st.booleans(),
    ending=st.sampled_from(["\n", "\r\n", "\r"]),
    suffix=st.sampled_from(["xyz", "asc", "txt", "csv"]),
    last=st.booleans(),
)
def test_any_text_of_points_comes_back(
    tmp_path: Path,
    points: list[tuple[float, ...]],
    extra: int,
    between: str,
    comma: bool,
    ending: str,
    suffix: str,
    last: bool,
) -> None:
    """Whatever parts the columns and ends the lines, x, y and z are the first three."""
    lines = [between.join([f"{value!r}" for value in point] + ["17.5"] * extra) for point in points]
    text = ending.join(lines) + ending * last
    if comma and between != ",":
        text = text.replace(".", ",")
    found = read_cloud(saved(tmp_path, f"a.{suffix}", text))
    np.testing.assert_array_equal(found.points, np.array(points))


def test_columns_are_found_by_their_names(tmp_path: Path) -> None:
    data = "Point ID;Normal_X;Normal_Y;Normal_Z;Y;X;Z\nA1;0;0;1;2;1;3\nA 2;0;1;0;5;4;6\n"
    found = read_cloud(saved(tmp_path, "a.csv", data))
    assert found.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert found.normals is not None
    assert found.normals.tolist() == [[0, 0, 1], [0, 1, 0]]


def test_normals_without_a_name_are_known_by_their_length(tmp_path: Path) -> None:
    found = read_cloud(saved(tmp_path, "a.xyz", rows(POINTS, NORMALS)))
    np.testing.assert_allclose(found.normals, NORMALS, atol=1e-12)
    assert read_cloud(saved(tmp_path, "b.xyz", rows(POINTS, 100 * NORMALS))).normals is None


def test_a_column_that_counts_the_rows_is_not_x(tmp_path: Path) -> None:
    found = read_cloud(saved(tmp_path, "a.txt", rows(np.arange(1, len(POINTS) + 1), POINTS)))
    np.testing.assert_array_equal(found.points, POINTS)
    assert "counts the rows" in found.remarks[0]


def test_the_blocks_of_a_pts_file_are_its_stations(tmp_path: Path) -> None:
    found = read_cloud(saved(tmp_path, "a.pts", f"30\n{rows(POINTS[:30])}10\n{rows(POINTS[30:])}"))
    np.testing.assert_array_equal(found.points, POINTS)
    assert found.parts == (30, 10)


def test_the_pose_of_a_ptx_station_acts_on_row_vectors(tmp_path: Path) -> None:
    turn = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    matrix = np.vstack([np.hstack([turn, np.zeros((3, 1))]), [[5, 6, 7, 1]]])
    header = f"8\n5\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n{rows(matrix)}"
    body = rows(np.vstack([POINTS[:-1], np.zeros((1, 3))]), np.full(40, 0.5))
    found = read_cloud(saved(tmp_path, "a.ptx", 2 * (header + body)))
    assert found.parts == (39, 39)
    np.testing.assert_allclose(found.points, np.tile(POINTS[:-1] @ turn + [5, 6, 7], (2, 1)), atol=1e-12)
    assert "2 directions" in found.remarks[0]
