"""Truths about the datasets the project makes itself."""

import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from inspect3d.outcome import InputError
from inspect3d.recipe import Recipe
from inspect3d.virtual.datasets import SCANNED, make_dataset
from inspect3d.virtual.part_surface import PartSurface
from inspect3d.virtual.truth import Truth

COMMITTED = Path(__file__).parents[1] / "datasets" / "bracket"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    return folder, {name: make_dataset(name, folder / name) for name in SCANNED}


def cloud(path):
    header, _, data = path.read_bytes().partition(b"end_header\n")
    assert b"format binary_little_endian 1.0" in header
    return np.frombuffer(data, "<f4").reshape(-1, 3).astype(np.float64)


@pytest.mark.parametrize("name", SCANNED)
def test_a_dataset_carries_a_recipe_that_names_its_files(name, made):
    folder = made[0] / name
    recipe = Recipe.model_validate(tomllib.loads((folder / "recipe.toml").read_text(encoding="utf-8")))
    table = recipe.measurements[0].model_extra
    assert (folder / recipe.part.cad).is_file()
    assert (folder / table["files"][0]).is_file()
    assert table["noise"] == made[1][name].noise


@pytest.mark.parametrize("name", SCANNED)
def test_the_truth_moves_the_cloud_onto_the_true_part(name, made):
    truth = Truth.read(made[0] / name / "truth.json")
    points = truth.cad_from_scan(cloud(made[0] / name / "scan.ply"))
    own = np.delete(points, truth.foreign, axis=0)
    fine = PartSurface.of_shape(SCANNED[name](0).part.shape(), chord=1e-3, chord_inside=2e-3)
    feet = fine.triangulation.closest(own[::7])
    inside = ~feet.on_rim
    error = feet.distance[inside] - truth.deviation(feet.points[inside])
    assert np.median(np.abs(error)) * 1.4826 == pytest.approx(truth.noise, rel=0.1)


@pytest.mark.parametrize("name", SCANNED)
def test_a_truth_survives_its_file(name, made):
    written, read = made[1][name], Truth.read(made[0] / name / "truth.json")
    assert read.deviation == written.deviation
    np.testing.assert_allclose(read.scan_from_cad.matrix, written.scan_from_cad.matrix, atol=1e-12)
    np.testing.assert_array_equal(read.foreign, written.foreign)


def test_the_committed_bracket_is_what_the_rig_makes(made):
    folder = made[0] / "bracket"
    assert (COMMITTED / "recipe.toml").read_bytes() == (folder / "recipe.toml").read_bytes()
    np.testing.assert_allclose(cloud(COMMITTED / "scan.ply"), cloud(folder / "scan.ply"), atol=1e-4)
    committed, again = Truth.read(COMMITTED / "truth.json"), made[1]["bracket"]
    assert committed.deviation == again.deviation
    np.testing.assert_array_equal(committed.foreign, again.foreign)


def test_the_committed_bracket_is_small_and_far_from_its_cad():
    assert sum(path.stat().st_size for path in COMMITTED.iterdir()) < 1.5e6
    pose = Truth.read(COMMITTED / "truth.json").cad_from_scan
    assert pose.angle > 0.5
    assert np.linalg.norm(pose.translation) > 100.0


def test_an_unknown_dataset_is_an_error_that_names_the_known_ones(tmp_path):
    with pytest.raises(InputError, match="bracket, freeform, milled"):
        make_dataset("brackett", tmp_path)


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot be written"):
        make_dataset("freeform", tmp_path / "file" / "folder")


@pytest.mark.parametrize("content", ["", "[]", '{"deviation": {"kind": "Dent"}}'])
def test_a_file_that_holds_no_truth_is_an_error(content, tmp_path):
    (tmp_path / "truth.json").write_text(content)
    with pytest.raises(InputError):
        Truth.read(tmp_path / "truth.json")


def test_the_command_without_a_name_says_how_to_call_it():
    ended = subprocess.run([sys.executable, "-m", "inspect3d.virtual"], capture_output=True, text=True, check=False)
    assert ended.returncode == 1
    assert "usage" in ended.stderr
    assert "bracket" in ended.stderr
