"""Real files of every format: counts and bounds as a second reader, or a look at the file, gives them.

The second readers were trimesh, laspy, pye57, Open3D (PCD) and a line-by-line reader; autzen-utm.pcd was unpacked by
hand.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from inspect3d.files.cloud import CloudFile, read_cloud
from inspect3d.files.mesh import read_mesh
from inspect3d.outcome import InputError

DATA = Path(__file__).parents[1].parent / "shared" / "data"
FORMATS = DATA / "formats"

pytestmark = [
    pytest.mark.data,
    pytest.mark.skipif(not FORMATS.is_dir(), reason="the folder shared/data/formats is not beside the repository"),
]

BUNNY = (30571, [-0.094689, 0.040011, -0.061873], [0.061009, 0.187321, 0.058799])
CUBE = ([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5])
AUTZEN = (1065, [635619.85, 848899.70, 406.59], [638982.55, 853535.43, 586.38])
SAMPLE = (10, [-9.318283, -14.000992, -65.560776], [4.246445, -6.014053, -50.214615])
FIVE = (5, [-0.0645, 0.0359793, 0.0404362], [-0.06275, 0.0367289, 0.0425949])
EMPTY = "is an empty cloud"
CLOUDS: dict[str, Any] = {
    "SOURCE.md": "is of no known format",
    "bunnyData.pts": BUNNY,
    "e57/ColourRepresentation.e57": (153, *CUBE),
    "e57/ColouredCubeDouble.e57": (7680, *CUBE),
    "e57/ColouredCubeFloat.e57": (7680, *CUBE),
    "e57/ZeroPoints.e57": EMPTY,
    "e57/bunnyDouble.e57": BUNNY,
    "e57/bunnyInt32.e57": BUNNY,
    "e57/pdal_A4.e57": (4, [-44.9522018, -1.3493, -0.6077], [-44.3000984, -0.886, 0.3694]),
    "e57/pdal_A_B.e57": (6, [-44.9522018, -1.3493, -0.6077], [-42.6394997, 2.0578001, 0.6667]),
    "e57/pdal_A_B_different_dims.e57": (2, [83.1978455, 537.2703247, 4.5902758], [84.1740265, 538.4684448, 4.628726]),
    "e57/pdal_A_moved_B.e57": (6, [-44.1194382, 0.7053028, -0.6077], [-42.6394997, 2.0578001, 0.6667]),
    "e57/pye57_pumpAVisualReferenceImage.e57": (
        155201,
        [-2.903763, -5.301102, -1.899704],
        [1.721603, -0.792648, 1.843002],
    ),
    "e57/pye57_testWithNormals.e57": (2, [1, 0, 0], [2, 0, 0]),
    "e57/pye57_translationWithoutRotation.e57": (4, [4, 5, 6], [5, 6, 6]),
    "e57/test filename äöü.e57": EMPTY,
    "e57/测试点云.e57": EMPTY,
    "pcd/bun0.pcd": (397, [-0.093938, 0.03742, -0.055026], [0.059562, 0.1845, 0.057803]),
    "pcd/colored_cloud.pcd": (1000, [-0.887101, -0.65073532, 0.882], [0.4888, -0.37548959, 1.532]),
    "pcd/milk_color.pcd": (13704, [-0.1400829, -0.26378, 0.714], [0.01380667, -0.01172857, 0.891]),
    "pcd/rops_cloud.pcd": (32087, [-0.41984, -0.24034, -1.4022], [0.40617, 0.24871, -1.0098]),
    "pdal/1.2-with-color.obj": (911, [635619.875, 848899.6875, 406.589996], [638982.5625, 853535.4375, 583.72998]),
    "pdal/1.2-with-color.ptx": AUTZEN,
    "pdal/autzen-utm.pcd": (1065, [493994.87, 4877429.62, 123.93], [494993.68, 4878817.02, 178.73]),
    "pdal/autzen.pts": (10, [636102.840012, 848968.800003, 427.919998], [636126.400009, 849345.199997, 512.139999]),
    "pdal/autzen_trim.laz": (110000, [636001.76, 848935.20, 406.26], [637179.22, 849497.90, 520.51]),
    "pdal/bunny_8.pts": "goes on after the 8 points it declares",
    "pdal/complex-transform.ptx": (4, [-3.0344074, -3.1737810, -1.8251146], [-3.0343598, -3.1685299, -1.8220683]),
    "pdal/crlf_test.txt": (10, [289814.15, 4320978.61, 170.58], [289818.50, 4320980.59, 170.76]),
    "pdal/epsg_4326.las": "degrees of longitude and latitude",
    "pdal/extrabytes.las": AUTZEN,
    "pdal/lone-star.copc.laz": (
        518862,
        [515368.60225, 4918340.364, 2322.89625],
        [515401.043, 4918381.12375, 2338.5755],
    ),
    "pdal/multiple-and-transform.ptx": (8, [636699.38, 848991.01, 425.39], [637012.24, 849106.66, 446.39]),
    "pdal/no-color.ptx": (15, [635795.24, 848991.01, 408.60], [637012.24, 849390.78, 446.39]),
    "pdal/simple.las": AUTZEN,
    "pdal/simple_binary.ply": (3, [-1, 0, 0], [1, 1, 0]),
    "pdal/test.pts": (19, [-25.050461, -24.533554, -2.000961], [3.980972, -2.006119, -0.010086]),
    "pdal/test1_4.las": (
        1000,
        [1694038.4456375, 1816492.7062701, 5592.7499174],
        [1694539.6770145, 1816497.9762625, 5599.0696868],
    ),
    "pdal/utm17_1.txt": (10, [289814.15, 4320978.61, 170.58], [289818.50, 4320980.59, 170.76]),
    "point_cloud_sample1.pts": SAMPLE,
    "point_cloud_sample2.pts": SAMPLE,
    "trimesh/ascii.stl.zip": (174, [-100.45, -8.7, -3.66569e-07], [100.45, 8.7, 7.7]),
    "trimesh/counterXP.3MF": (43276, [-111.48989, 5.779197, 255.860162], [193.31011, 310.187997, 281.698413]),
    "trimesh/featuretype.3MF": (1092, [-2.5, -1.25, -2.73185e-16], [2.5, 1.25, 1.375]),
    "trimesh/fuze_ascii.ply": (502, [-0.036391, -0.036711, 0.004016], [0.036221, 0.036803, 0.219144]),
    "trimesh/point_uv.ply.zip": (1000, [-0.9852822, -0.9812841, -1], [0, 0.970767, 0.9496033]),
    "trimesh/points_agisoft.xyz": (
        100,
        [665171.37498, 5648340.499471, 233.514072],
        [665187.870931, 5648381.899135, 245.90329],
    ),
    "trimesh/points_ascii.ply": FIVE,
    "trimesh/points_ascii_with_lists.ply": FIVE,
    "trimesh/points_bin.ply": FIVE,
    "trimesh/points_cloudcompare.xyz": (
        101,
        [665171.37498, 5648298.096676, 228.049194],
        [665187.870931, 5648381.899135, 245.90329],
    ),
    "trimesh/rock.obj.bz2": (21, [-0.06637575, -0.05568695, -0.0527954], [0.06637575, 0.05568695, 0.0527954]),
}
# vertices, triangles, unit; the bounds are those of the cloud
MESHES = {
    "pdal/1.2-with-color.obj": (911, 1672, None),
    "trimesh/ascii.stl.zip": (1032, 344, None),
    "trimesh/counterXP.3MF": (43276, 83750, "mm"),
    "trimesh/featuretype.3MF": (1092, 2208, "inch"),
    "trimesh/fuze_ascii.ply": (502, 1000, None),
    "trimesh/rock.obj.bz2": (21, 38, None),
}
UNITS = {
    "e57/bunnyInt32.e57": "m",
    "pdal/autzen_trim.laz": "ft",
    "pdal/lone-star.copc.laz": "m",
    "pdal/test1_4.las": "US survey ft",
    "pdal/simple.las": None,
    "pcd/bun0.pcd": None,
}


def test_every_file_of_the_zoo_is_in_the_table() -> None:
    assert {str(path.relative_to(FORMATS)) for path in FORMATS.rglob("*") if path.is_file()} == CLOUDS.keys()


@pytest.mark.parametrize("name", CLOUDS)
def test_a_real_file_is_read_right_or_refused(name: str) -> None:
    known = CLOUDS[name]
    if isinstance(known, str):
        with pytest.raises(InputError, match=known) as refusal:
            read_cloud(FORMATS / name)
        assert Path(name).name in str(refusal.value)
        return
    found = read_cloud(FORMATS / name)
    assert (len(found.points), sum(found.parts)) == (known[0], known[0])
    np.testing.assert_allclose([found.points.min(axis=0), found.points.max(axis=0)], known[1:], rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", CLOUDS)
def test_a_real_file_is_a_mesh_or_refused_as_one(name: str) -> None:
    if name not in MESHES:
        with pytest.raises(InputError):
            read_mesh(FORMATS / name)
        return
    found = read_mesh(FORMATS / name)
    assert (len(found.vertices), len(found.triangles), found.units) == MESHES[name]
    bounds = [found.vertices.min(axis=0), found.vertices.max(axis=0)]
    np.testing.assert_allclose(bounds, CLOUDS[name][1:], rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", UNITS)
def test_the_unit_a_format_fixes_is_told(name: str) -> None:
    assert cloud(name).units == UNITS[name]


def test_one_part_in_several_formats_is_the_same_cloud() -> None:
    groups = [
        ("bunnyData.pts", "e57/bunnyDouble.e57", "e57/bunnyInt32.e57"),
        ("pdal/simple.las", "pdal/extrabytes.las", "pdal/1.2-with-color.ptx"),
    ]
    for first, *others in groups:
        for other in others:
            np.testing.assert_allclose(in_order(cloud(other)), in_order(cloud(first)), rtol=0, atol=1e-6)


def in_order(found: CloudFile) -> np.ndarray:
    """Return the points, rounded and in lexical order."""
    return np.unique(found.points.round(6), axis=0)


def test_stations_are_placed_by_their_poses() -> None:
    """In A_moved_B the second scan has a pose of its own, a shift; the first is that of A_B."""
    together, moved = cloud("e57/pdal_A_B.e57"), cloud("e57/pdal_A_moved_B.e57")
    assert together.parts == moved.parts == (2, 4)
    shift = moved.points - together.points
    assert not shift[:2].any()
    assert np.linalg.norm(shift[2]) > 2
    np.testing.assert_allclose(shift[2:], shift[2:3].repeat(4, axis=0), rtol=0, atol=1e-6)
    shifted = cloud("pdal/multiple-and-transform.ptx")
    assert shifted.parts == (4, 4)
    np.testing.assert_allclose(shifted.points[:4], shifted.points[4:], rtol=0, atol=1e-9)


def test_directions_without_a_point_are_dropped_with_a_remark() -> None:
    (remark,) = cloud("pdal/complex-transform.ptx").remarks
    assert "8 directions" in remark


def test_normals_are_read_where_the_file_has_them() -> None:
    for name in ("pcd/bun0.pcd", "pcd/colored_cloud.pcd", "e57/pye57_testWithNormals.e57", "trimesh/point_uv.ply.zip"):
        normals = cloud(name).normals
        assert normals is not None
        length = np.linalg.norm(normals, axis=1)
        np.testing.assert_allclose(length[length > 0], 1, atol=1e-12)
    assert cloud("pdal/autzen.pts").normals is None


def test_columns_of_colour_are_not_taken_for_normals() -> None:
    for name in ("trimesh/points_agisoft.xyz", "trimesh/points_cloudcompare.xyz", "point_cloud_sample1.pts"):
        assert cloud(name).normals is None


@pytest.mark.parametrize(
    ("name", "points"),
    [("bun000", 40256), ("bun045", 40097), ("bun090", 30379), ("bun315", 35336), ("bun_zipper", 35947)],
)
def test_a_range_grid_is_read_as_its_points(name: str, points: int) -> None:
    assert len(read_cloud(DATA / "bunny_multiscan" / f"{name}.ply").points) == points


def test_a_mesh_agrees_with_trimesh_triangle_by_triangle() -> None:
    import trimesh

    for path in (
        "bunny_multiscan/bun_zipper.ply",
        "step_freeform/bladex_lower.stl",
        "cranfield_realsense/cad/Pendulum.stl",
    ):
        found, other = read_mesh(DATA / path), trimesh.load_mesh(DATA / path, process=False)
        np.testing.assert_array_equal(found.triangles, other.faces)
        np.testing.assert_allclose(found.vertices, other.vertices, rtol=0, atol=1e-8)


def cloud(name: str) -> CloudFile:
    return read_cloud(FORMATS / name)
