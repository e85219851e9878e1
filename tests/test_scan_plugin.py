"""The scan plugin: files in, clouds in mm out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from inspect3d.measure import Files, Measure
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.surface import Surface
from inspect3d.outcome import InputError
from inspect3d_plugins.scan import Scan, ScanSource

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
NORMALS = np.array([[0.0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, 1]])


@pytest.fixture
def nominal() -> Nominal:
    """Return a triangle; a scan does not look at it."""
    nodes, triangles = POINTS[:3], np.array([[0, 1, 2]])
    mesh = InspectionMesh(nodes, triangles, np.tile([0.0, 0, 1], (3, 1)), np.zeros(3, bool), np.full(3, -1))
    return Nominal("triangle", Surface(nodes, triangles), mesh)


def files(folder: Path, *clouds: np.ndarray) -> Files:
    paths = []
    for i, cloud in enumerate(clouds):
        paths.append(folder / f"scan{i}.xyz")
        np.savetxt(paths[-1], cloud, fmt="%.9g")
    return Files(folder, {"files": tuple(paths)})


def test_it_is_a_measuring_method() -> None:
    assert isinstance(Scan(), Measure)


@pytest.mark.parametrize(("units", "factor"), [("mm", 1), ("cm", 10), ("m", 1000), ("um", 0.001), ("inch", 25.4)])
def test_points_become_millimetres(tmp_path: Path, units: Any, factor: float, nominal: Nominal) -> None:
    (cloud,) = Scan(units=units, noise=0.02)(
        Scan(units=units, noise=0.02).open(files(tmp_path, POINTS)), nominal
    ).clouds
    np.testing.assert_allclose(cloud.points, factor * POINTS, rtol=1e-15)
    assert cloud.noise == 0.02


def test_the_same_files_give_the_same_measurement(tmp_path: Path, nominal: Nominal) -> None:
    given = files(tmp_path, POINTS, POINTS + 1)
    for frames, names in (("one", ["scan0.xyz, scan1.xyz"]), ("separate", ["scan0.xyz", "scan1.xyz"])):
        measurement = Scan(frames=frames)(Scan(frames=frames).open(given), nominal)
        assert [cloud.name for cloud in measurement.clouds] == names
        np.testing.assert_array_equal(measurement.points, np.vstack([POINTS, POINTS + 1]))
        assert (measurement.frame, measurement.scale_known) == ("instrument", True)


def test_points_of_a_file_without_normals_have_zero_ones(tmp_path: Path) -> None:
    (cloud,) = Scan().open(files(tmp_path, np.hstack([POINTS, NORMALS]), POINTS)).clouds
    assert cloud.normals is not None
    np.testing.assert_array_equal(cloud.normals, np.vstack([NORMALS, 0 * NORMALS]))


def test_the_source_is_one_line_that_says_how_much_and_how_large(tmp_path: Path) -> None:
    assert str(Scan(units="cm").open(files(tmp_path, POINTS))) == "4 points, 10 x 20 x 30 mm (scan0.xyz)"


def test_the_unit_of_the_recipe_decides_and_a_contradiction_is_remarked(tmp_path: Path, nominal: Nominal) -> None:
    import laspy

    header = laspy.LasHeader(point_format=0, version="1.4")
    wkt = 'LOCAL_CS["rig",UNIT["metre",1]]'
    header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(wkt))
    written = laspy.LasData(header)
    written.x, written.y, written.z = POINTS.T
    written.write(tmp_path / "a.las")
    given = Files(tmp_path, {"files": (tmp_path / "a.las",)})
    assert Scan(units="m").open(given).remarks == ()
    measurement = Scan(units="mm")(Scan(units="mm").open(given), nominal)
    np.testing.assert_allclose(measurement.points, POINTS, atol=0.006)
    assert measurement.remarks == ("a.las is in m by its format, and was read in mm as the recipe says.",)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"units": "furlong"}, "mm, cm, m, um, inch"),
        ({"frames": "two"}, "one, separate"),
        ({"noise": 0.0}, "positive number in mm"),
        ({"noise": -1.0}, "positive number in mm"),
        ({"noise": float("nan")}, "positive number in mm"),
        ({"noise": "little"}, "positive number in mm"),
        ({"noise": True}, "positive number in mm"),
        ({"noise": 0.02, "noise_length": -1.0}, "positive number, mm"),
        ({"noise_length": 0.5}, "wants noise too"),
    ],
)
def test_a_wrong_setting_is_refused_with_the_right_choices(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Scan(**settings)


def test_a_measurement_without_files_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="names no `files`"):
        Scan().open(Files(tmp_path, {}))


def test_a_missing_file_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone\.ply does not exist"):
        Scan().open(Files(tmp_path, {"files": (tmp_path / "gone.ply",)}))


def test_the_settings_are_the_provenance() -> None:
    assert repr(Scan(units="m", noise=0.1)) == "Scan(units='m', noise=0.1, noise_length=0.0, frames='one')"


def test_a_source_is_made_of_clouds(tmp_path: Path) -> None:
    source = Scan(frames="separate").open(files(tmp_path, POINTS, POINTS))
    assert isinstance(source, ScanSource)
    assert len(source.clouds) == 2
