"""Truths about the photographed datasets the project makes itself."""

import tomllib
from dataclasses import replace

import cv2
import numpy as np
import pytest

from inspect3d.camera import View
from inspect3d.files.calibration_json import read_calibration_json
from inspect3d.outcome import InputError
from inspect3d.recipe import Recipe
from inspect3d.virtual.camera_knowledge import LensesKnown, rig_known
from inspect3d.virtual.dataset import Dataset
from inspect3d.virtual.datasets import DATASETS, make_dataset
from inspect3d.virtual.picks import picks
from inspect3d.virtual.picture_truth import PictureTruth
from inspect3d.virtual.scene import Scene
from inspect3d.virtual.stereo_datasets import PHOTOGRAPHED, knowing, smooth_stereo
from inspect3d.virtual.stereo_rig import StereoRig

TINY = StereoRig(scale=2.5, focal=1025.0, size=(306, 256), offset=1.0)
KNOWLEDGE = {"places": None, "rig": rig_known, "lenses": LensesKnown(0.5, 0.4), "picks": None}


def tiny(kind, seed=3, cameras=2):
    dataset = smooth_stereo(seed, replace(TINY, cameras=cameras), 10.0)
    return dataset if kind == "places" else knowing(dataset, KNOWLEDGE[kind])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("photographed")
    return folder, {kind: tiny(kind).write(folder / kind, 3) for kind in KNOWLEDGE}


def table(folder):
    recipe = Recipe.model_validate(tomllib.loads((folder / "recipe.toml").read_text(encoding="utf-8")))
    assert (folder / recipe.part.cad).is_file()
    return recipe.measurements[0].model_extra


def rig_of(folder):
    text = (folder / "calibration.json").read_text(encoding="utf-8")
    return read_calibration_json(text, "calibration.json", ("left.png", "right.png"), (TINY.size, TINY.size))


@pytest.mark.parametrize("kind", KNOWLEDGE)
def test_a_dataset_carries_a_recipe_that_names_its_files(kind, made):
    folder = made[0] / kind
    extra = table(folder)
    assert extra["images"] == ["left.png", "right.png"]
    for name in extra["images"]:
        assert cv2.imread(str(folder / name), cv2.IMREAD_UNCHANGED).shape == TINY.size[::-1]
    assert ("cameras" in extra) == (kind != "picks") == (folder / "calibration.json").is_file()
    assert ("landmarks" in extra) == (kind != "places")


def test_known_places_are_the_true_ones(made):
    for view, true in zip(rig_of(made[0] / "places").views, made[1]["places"].views, strict=True):
        np.testing.assert_array_equal(view.camera.matrix, true.camera.matrix)
        np.testing.assert_allclose(view.camera_from_cad.matrix, true.camera_from_cad.matrix, atol=1e-12)


def test_a_known_rig_is_the_true_one_moved_with_the_part(made):
    rig, truth = rig_of(made[0] / "rig"), made[1]["rig"]
    motion = truth.views[0].camera_from_cad
    points = np.random.default_rng(0).uniform(20, 60, (20, 3))
    for camera, pose, true in zip(rig.cameras, rig.camera_from_rig, truth.views, strict=True):
        np.testing.assert_allclose(View(camera, pose).project(motion(points)), true.project(points), atol=1e-8)


def test_errors_of_the_lenses_have_the_size_that_is_stated():
    views = tuple(camera.view for camera in tiny("places").cameras)
    known, random = LensesKnown(2.0, 3.0), np.random.default_rng(1)
    errors = [known(views, random).cameras[0].matrix - views[0].camera.matrix for _ in range(1000)]
    np.testing.assert_allclose(np.std([error[0, 0] for error in errors]), 2.0, rtol=0.1)
    np.testing.assert_allclose(np.std([error[:2, 2] for error in errors], axis=0), 3.0, rtol=0.1)
    assert known(views, random).sigmas[1].focal == 2.0


def test_picks_are_where_the_true_points_appear_but_for_the_hand():
    dataset = tiny("picks")
    scene = Scene(dataset.part.surface(), dataset.deviation, dataset.speckle)
    views = tuple(camera.view for camera in dataset.cameras)
    steady, shaky = picks(scene, views, 6, 0.0, 5), picks(scene, views, 200, 1.5, 5)
    _, away, normals = (
        (feet := scene.surface.triangulation.closest(steady.points_cad)).points,
        feet.distance,
        feet.normals,
    )
    assert np.abs(away).max() < 0.05
    true = steady.points_cad + dataset.deviation(steady.points_cad)[:, None] * normals
    for k, view in enumerate(views):
        np.testing.assert_allclose(steady.pixels[:, k], view.project(true), atol=0.02)
        errors = shaky.pixels[:, k] - view.project(shaky.points_cad)
        assert errors.std() == pytest.approx(1.5, rel=0.15)
    gaps = np.linalg.norm(steady.points_cad[:, None] - steady.points_cad, axis=2)
    assert gaps[~np.eye(6, dtype=bool)].min() > 25.0


def test_cameras_without_common_points_are_an_error():
    dataset = tiny("picks")
    scene = Scene(dataset.part.surface(), dataset.deviation, dataset.speckle)
    above = dataset.cameras[0].view
    aside = replace(TINY, toward=(1.0, 0.0, -0.2))(np.array([52.0, 42.0, 5.0]), 0)[0]
    with pytest.raises(InputError, match="in common"):
        picks(scene, (above, aside), 6, 1.0, 0)


def test_a_truth_survives_its_file(made):
    written, read = made[1]["places"], PictureTruth.read(made[0] / "places" / "truth.json")
    assert read.deviation == written.deviation
    assert (read.noise, read.seed, read.warps) == (written.noise, written.seed, (None, None))
    points = np.random.default_rng(2).uniform(20, 60, (20, 3))
    for one, other in zip(read.views, written.views, strict=True):
        np.testing.assert_allclose(one.project(points), other.project(points), atol=1e-9)


@pytest.mark.parametrize("content", ["", "[]", '{"deviation": {"kind": "Dent"}}', '{"cameras": [{}]}'])
def test_a_file_that_holds_no_truth_is_an_error(content, tmp_path):
    (tmp_path / "truth.json").write_text(content)
    with pytest.raises(InputError):
        PictureTruth.read(tmp_path / "truth.json")


def test_the_same_seed_gives_the_same_files_and_another_one_others(made, tmp_path):
    tiny("picks").write(tmp_path / "again", 3)
    tiny("picks", 4).write(tmp_path / "other", 4)
    for path in (made[0] / "picks").iterdir():
        assert (tmp_path / "again" / path.name).read_bytes() == path.read_bytes(), path.name
    assert (tmp_path / "other" / "left.png").read_bytes() != (made[0] / "picks" / "left.png").read_bytes()


def test_four_cameras_make_four_pictures(tmp_path):
    tiny("places", cameras=4).write(tmp_path, 3)
    assert table(tmp_path)["images"] == [f"view{k}.png" for k in (1, 2, 3, 4)]


def test_the_deviations_of_the_smooth_part_are_20_um_rms():
    dataset = smooth_stereo(0)
    points, _ = dataset.part.surface().sample(20_000, np.random.default_rng(4))
    assert np.sqrt(np.mean(dataset.deviation(points) ** 2)) == pytest.approx(0.020, abs=0.002)


@pytest.mark.parametrize("name", PHOTOGRAPHED)
def test_every_dataset_has_its_own_name_in_its_recipe(name):
    dataset = DATASETS[name](0)
    assert not isinstance(dataset, Dataset)
    assert f"`inspect3d virtual {name}`" in dataset.recipe


@pytest.mark.parametrize("name", PHOTOGRAPHED)
def test_the_part_fills_every_picture_and_no_pixel_is_saturated(name):
    dataset = DATASETS[name](1)
    vertices = dataset.part.surface().vertices
    top = vertices[vertices[:, 2] > 15.0] if "milled" in name else vertices
    for camera in dataset.cameras:
        pixels, size = camera.view.project(top), np.array(camera.view.camera.size)
        assert (pixels > 0).all()
        assert (pixels < size - 1).all()
        assert (np.ptp(pixels, axis=0) > 0.6 * size).all()
        assert camera.sensor.offset + camera.sensor.gain * dataset.speckle.ground + 4 * camera.sensor.noise < 1.0


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot be written"):
        tiny("places").write(tmp_path / "file" / "folder", 0)


def test_an_unknown_dataset_is_an_error_that_names_the_photographed_ones(tmp_path):
    with pytest.raises(InputError, match="smooth-stereo-picks"):
        make_dataset("smooth", tmp_path)
