"""Broken and awkward files: each is read right or refused with a sentence; the facts are from looking at each file."""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

BROKEN = Path(__file__).parents[1].parent / "shared" / "data" / "broken"
CHILD = Path(__file__).parent / "broken_child.py"
SECONDS = 20

pytestmark = [
    pytest.mark.data,
    pytest.mark.skipif(not BROKEN.is_dir(), reason="the folder shared/data/broken is not beside the repository"),
]

HALF = ([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5])
UNIT = ([0, 0, 0], [1, 1, 1])
TWO = ([-1, -1, -1], [1, 1, 1])
FLAT = ([-1, -1, 0], [1, 1, 0])

# path: (vertices, triangles, low, high) of the mesh, or a part of the sentence that refuses it
MESHES: dict[str, Any] = {
    "assimp/OBJ/box_UTF16BE.obj": (8, 12, *HALF),
    "assimp/OBJ/box_longline.obj": "passes an edge twice",  # one polygon that goes round a square 235 times
    "assimp/OBJ/box_without_lineending.obj": (8, 12, *HALF),
    "assimp/OBJ/concave_polygon.obj": (64, 64, [-1.146, 1.6575, 1.6055], [-1.146, 3.1425, 3.0905]),
    "assimp/OBJ/cube_with_vertexcolors.obj": (8, 12, *UNIT),
    "assimp/OBJ/number_formats.obj": "'3.1+e2'",
    "assimp/OBJ/point_cloud.obj": "3 points but no triangles",
    "assimp/OBJ/testmixed.obj": (8, 12, *HALF),  # points, lines and faces; the faces are a whole box
    "assimp/OFF/Cube.off": (8, 12, *HALF),
    "assimp/OFF/invalid.off": "declares 3 vertices and 4 faces",
    "assimp/PLY/cube.ply": (8, 12, *UNIT),
    "assimp/PLY/cube_binary.ply": (8, 12, *UNIT),
    "assimp/PLY/cube_binary_header_with_RN_newline.ply": (8, 12, *UNIT),
    "assimp/PLY/cube_binary_starts_with_nl.ply": (8, 12, [5.96753407, 0, 0], [6.96753407, 1, 1]),
    "assimp/PLY/cube_uv.ply": (24, 12, [-1, -1.000001, -1], [1, 1, 1]),
    "assimp/PLY/float-color.ply": (3, 1, [0, 0, 0], [200, 200, 0]),
    "assimp/PLY/issue623.ply": "ends before the 24 rows of `vertex`",  # the element face is missing from the header
    "assimp/PLY/payload_JVN42386607": "line 2 is not PLY",
    "assimp/PLY/points.ply": "4 points but no triangles",
    "assimp/STL/3DSMaxExport.STL": (6000, 2000, [-27.37004, -2.4281218, 9.69857], [29.664497, 45.913139, 62.342556]),
    "assimp/STL/Spider_ascii.stl": (4104, 1368, [-3.114895, -4, -1.649329], [3.114895, 4, 1.649329]),
    "assimp/STL/Spider_binary.stl": (4104, 1368, [-3.114895, -4, -1.649329], [3.114895, 4, 1.649329]),
    "assimp/STL/formatDetection": (3, 1, *FLAT),
    "assimp/STL/sphereWithHole.stl": (855, 285, [0, 0, 0], [3, 3, 3]),
    "assimp/STL/triangle.stl": (3, 1, *FLAT),
    "assimp/STL/triangle_with_empty_solid.stl": (3, 1, *FLAT),
    "assimp/STL/triangle_with_two_solids.stl": (6, 2, [-1, -1, 0], [3, 3, 0]),
    "assimp/invalid/OutOfMemory.off": "declares 353535235358 vertices",
    "assimp/invalid/crash-30d6d0f7c529b3b66b4131700b7a4580cd7082df.ply": "PLY header",
    "assimp/invalid/empty.obj": "is empty",
    "assimp/invalid/empty.off": "is empty",
    "assimp/invalid/empty.ply": "is empty",
    "assimp/invalid/malformed.obj": "refers to vertex 12 of 8 in line 23",
    "assimp/invalid/malformed2.obj": "face of 0 corners in line 23",
    "assimp/invalid/readme.txt": "is a point cloud (text)",
    "e57/InvalidCVHeader.e57": "is a point cloud (E57)",
    "e57/ZeroPointsInvalid.e57": "is a point cloud (E57)",
    "e57/bad-crc.e57": "is a point cloud (E57)",
    "e57/empty.e57": "is a point cloud (E57)",
    "trimesh_emptyIO/obj_empty.obj": "holds no triangles",
    "trimesh_emptyIO/obj_points.obj": "8 points but no triangles",
    "trimesh_emptyIO/obj_wireframe.obj": "8 points but no triangles",
    "trimesh_emptyIO/ply_empty_ascii.ply": "holds no triangles",
    "trimesh_emptyIO/ply_empty_bin.ply": "holds no triangles",
    "trimesh_emptyIO/ply_empty_header.ply": "no element `vertex`",
    "trimesh_emptyIO/ply_points_ascii.ply": "8 points but no triangles",
    "trimesh_emptyIO/ply_points_bin.ply": "8 points but no triangles",
    "trimesh_emptyIO/stl_empty_ascii.stl": "holds no triangles",
    "trimesh_emptyIO/stl_empty_bin.stl": "holds no triangles",
    "SOURCE.md": "no known format",
    "load_results_trimesh_open3d.txt": "is a point cloud (text)",
}
EMPTY = "is an empty cloud"
# where the points differ from the vertices of the mesh: (points, low, high), or a part of the sentence
CLOUDS: dict[str, Any] = {
    "assimp/OBJ/box_longline.obj": (8, *HALF),
    "assimp/OBJ/point_cloud.obj": (3, [-0.275607, -0.965401, 2.54153], [-0.207717, -0.953997, 2.55411]),
    "assimp/PLY/points.ply": (4, [0, 0, 0], [0, 1, 1]),
    "assimp/STL/3DSMaxExport.STL": (1042, [-27.37004, -2.4281218, 9.69857], [29.664497, 45.913139, 62.342556]),
    "assimp/STL/Spider_ascii.stl": (722, [-3.114895, -4, -1.649329], [3.114895, 4, 1.649329]),
    "assimp/STL/Spider_binary.stl": (722, [-3.114895, -4, -1.649329], [3.114895, 4, 1.649329]),
    "assimp/STL/sphereWithHole.stl": (146, [0, 0, 0], [3, 3, 3]),
    "assimp/invalid/readme.txt": "in line 2, neither numbers nor names",
    "e57/InvalidCVHeader.e57": EMPTY,
    "e57/ZeroPointsInvalid.e57": EMPTY,
    "e57/bad-crc.e57": "checksum mismatch",
    "e57/empty.e57": EMPTY,
    "trimesh_emptyIO/obj_empty.obj": EMPTY,
    "trimesh_emptyIO/obj_points.obj": (8, *TWO),
    "trimesh_emptyIO/obj_wireframe.obj": (8, *TWO),
    "trimesh_emptyIO/ply_empty_ascii.ply": EMPTY,
    "trimesh_emptyIO/ply_empty_bin.ply": EMPTY,
    "trimesh_emptyIO/ply_points_ascii.ply": (8, *TWO),
    "trimesh_emptyIO/ply_points_bin.ply": (8, *TWO),
    "trimesh_emptyIO/stl_empty_ascii.stl": EMPTY,
    "trimesh_emptyIO/stl_empty_bin.stl": EMPTY,
    "load_results_trimesh_open3d.txt": "in line 1, neither numbers nor names",
}
BOXES = {
    "assimp/OBJ/box_UTF16BE.obj": 1,
    "assimp/OBJ/box_without_lineending.obj": 1,
    "assimp/OBJ/cube_with_vertexcolors.obj": 1,
    "assimp/OBJ/testmixed.obj": 1,
    "assimp/OFF/Cube.off": 1,
    "assimp/PLY/cube.ply": 1,
    "assimp/PLY/cube_binary.ply": 1,
    "assimp/PLY/cube_binary_header_with_RN_newline.ply": 1,
    "assimp/PLY/cube_binary_starts_with_nl.ply": 1,
    "assimp/PLY/cube_uv.ply": 8,
}


@pytest.fixture(scope="module")
def results() -> dict[str, dict[str, Any]]:
    """Read each file in a process of its own."""

    def child(name: str) -> dict[str, Any]:
        command = [sys.executable, str(CHILD), str(BROKEN / name)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
        return {"code": done.returncode, "errors": done.stderr, **(json.loads(done.stdout) if done.stdout else {})}

    with ThreadPoolExecutor(2) as pool:
        return dict(zip(MESHES, pool.map(child, MESHES), strict=True))


def test_every_broken_file_is_in_the_table() -> None:
    assert {str(path.relative_to(BROKEN)) for path in BROKEN.rglob("*") if path.is_file()} == MESHES.keys()


@pytest.mark.parametrize("name", MESHES)
def test_a_broken_file_neither_crashes_nor_prints(name: str, results: dict[str, dict[str, Any]]) -> None:
    assert (results[name]["code"], results[name]["errors"]) == (0, "")


@pytest.mark.parametrize("name", MESHES)
def test_a_broken_mesh_is_read_right_or_refused(name: str, results: dict[str, dict[str, Any]]) -> None:
    found, known = results[name]["mesh"], MESHES[name]
    if isinstance(known, str):
        assert_refused(found, known, name)
        return
    assert (found["vertices"], found["triangles"]) == known[:2]
    np.testing.assert_allclose([found["low"], found["high"]], known[2:], atol=1e-5)


@pytest.mark.parametrize("name", MESHES)
def test_a_broken_cloud_is_read_right_or_refused(name: str, results: dict[str, dict[str, Any]]) -> None:
    mesh = MESHES[name]
    known = CLOUDS.get(name, mesh if isinstance(mesh, str) else (mesh[0], *mesh[2:]))
    found = results[name]["cloud"]
    if isinstance(known, str):
        assert_refused(found, known, name)
        return
    assert found["points"] == known[0]
    np.testing.assert_allclose([found["low"], found["high"]], known[1:], atol=1e-5)


@pytest.mark.parametrize("name", BOXES)
def test_a_box_has_its_volume_and_area(name: str, results: dict[str, dict[str, Any]]) -> None:
    found = results[name]["mesh"]
    assert abs(found["volume"]) == pytest.approx(BOXES[name], rel=1e-5)
    assert found["area"] == pytest.approx(6 * BOXES[name] ** (2 / 3), rel=1e-5)


def test_the_triangles_of_a_ring_with_a_bridge_cover_its_area_once(results: dict[str, dict[str, Any]]) -> None:
    """The only face of concave_polygon.obj goes round a ring in the plane x = -1.146; its area is the shoelace sum."""
    lines = (BROKEN / "assimp/OBJ/concave_polygon.obj").read_text().splitlines()
    points = np.array([[float(word) for word in line.split()[1:]] for line in lines if line.startswith("v ")])
    face = next(line for line in lines if line.startswith("f "))
    y, z = points[[int(corner.split("/")[0]) - 1 for corner in face.split()[1:]], 1:].T
    shoelace = abs(np.sum(y * np.roll(z, -1) - z * np.roll(y, -1))) / 2
    assert results["assimp/OBJ/concave_polygon.obj"]["mesh"]["area"] == pytest.approx(shoelace, rel=1e-12)


def assert_refused(found: dict[str, Any], words: str, name: str) -> None:
    assert found.keys() == {"refused"}
    assert words in found["refused"]
    assert Path(name).name in found["refused"]
    assert found["refused"].endswith(".")
