"""Truths about set-ups that a user plans: a part and a rig of one's own, or a sentence on what is wrong."""

import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from inspect3d.outcome import InputError
from inspect3d.recipe import Recipe
from inspect3d.virtual.bracket import bracket
from inspect3d.virtual.datasets import DATASETS, make_dataset
from inspect3d.virtual.milled import milled
from inspect3d.virtual.picture_truth import PictureTruth
from inspect3d.virtual.plan import load_plan
from inspect3d.virtual.scene import Scene
from inspect3d.virtual.warp import Warp

PLAN = """\
cad = "block.step"
element_size = 3.0
knowledge = "lenses"
rig = { cameras = 3, angle = 40, scale = 2.0, focal = 900, size = [320, 260] }
camera = { blur = 0.8, lamp = [0.3, 0.2, 1.0] }
sensor = { bits = 12, noise = 0.02 }
speckle = { dot = 2.5 }
warp = { tau = 0.02, length = 80 }

[[deviations]]
kind = "Bump"
centre = [50, 35, 30]
height = 0.2
width = 10
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("plan")
    milled().write_step(place / "block.step")
    return place


def planned(folder, text):
    (folder / "plan.toml").write_text(text)
    return load_plan(folder / "plan.toml", 5)


def test_a_plan_makes_pictures_of_a_part_of_ones_own(folder):
    (folder / "plan.toml").write_text(PLAN)
    truth = make_dataset(str(folder / "plan.toml"), folder / "out", 5)
    recipe = Recipe.model_validate(tomllib.loads((folder / "out" / "recipe.toml").read_text(encoding="utf-8")))
    assert recipe.part.element_size == 3.0
    assert recipe.measurements[0].model_extra["images"] == ["view1.png", "view2.png", "view3.png"]
    for name in recipe.measurements[0].model_extra["images"]:
        picture = cv2.imread(str(folder / "out" / name), cv2.IMREAD_UNCHANGED)
        assert picture.shape == (260, 320)
        assert picture.dtype == np.uint16
        assert 255 < picture.max() <= 4095
    assert truth.deviation(np.array([[50.0, 35.0, 30.0]]))[0] == pytest.approx(0.2)
    assert truth.noise == 0.02
    assert PictureTruth.read(folder / "out" / "truth.json").warps == truth.warps
    assert truth.warps[0] == Warp(0.02, 80.0, truth.warps[0].seed)


def test_the_plan_in_the_manual_can_be_followed(tmp_path):
    bracket().write_step(tmp_path / "part.step")
    manual = (Path(__file__).parents[1] / "docs" / "virtual_rig.md").read_text(encoding="utf-8")
    dataset = planned(tmp_path, manual.split("```toml")[1].split("```")[0])
    scene = Scene(dataset.part.surface(), dataset.deviation, dataset.speckle)
    picture = dataset.cameras[0](scene, 0)
    assert picture.shape == (512, 612)
    assert np.mean(picture > 1000) > 0.2


def test_the_manual_names_every_dataset():
    manual = (Path(__file__).parents[1] / "docs" / "virtual_rig.md").read_text(encoding="utf-8")
    assert all(f"`{name}`" in manual for name in DATASETS)


def test_every_lens_of_a_plan_has_its_own_unknown_error(folder):
    cameras = planned(folder, PLAN).cameras
    assert {camera.warp.tau for camera in cameras} == {0.02}
    assert len({camera.warp.seed for camera in cameras}) == 3


def test_a_plan_gives_its_angle_in_degrees_and_aims_at_the_middle_of_the_part(folder):
    dataset = planned(folder, 'cad = "block.step"\nrig = { angle = 30, scale = 3.0, focal = 1000, size = [320, 240] }')
    vertices = dataset.part.surface().vertices
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    first, second = (camera.view.centre - middle for camera in dataset.cameras)
    cosine = first @ second / np.linalg.norm(first) / np.linalg.norm(second)
    assert np.degrees(np.arccos(cosine)) == pytest.approx(30.0)
    assert dataset.speckle.dot == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cad =", "not valid TOML"),
        ("element_size = 1.0", "cad is missing"),
        ('cad = "block.step"\nfokal = 3', "'fokal' is unknown"),
        ('cad = "block.stl"', "STEP or IGES"),
        ('cad = "none.step"', "STEP or IGES"),
        ('cad = "block.step"\nknowledge = "all"', "places, rig, lenses, picks"),
        ('cad = "block.step"\nrig = 3', r"\[rig\] is a table"),
        ('cad = "block.step"\nrig = { camera = 3 }', "'camera' is unknown; the settings are cameras"),
        ('cad = "block.step"\nrig = { cameras = 1 }', "at least two cameras"),
        ('cad = "block.step"\nrig = { scale = "fine" }', "scale: .*number"),
        ('cad = "block.step"\ntarget = [1, 2]', "target"),
        ('cad = "block.step"\nsensor = { bits = 9 }', "8, 12 or 16"),
        ('cad = "block.step"\ncamera = { view = 1 }', "'view' is unknown"),
        ('cad = "block.step"\nwarp = { tau = 0.1 }', "length"),
        ('cad = "block.step"\nwarp = { tau = -0.1, length = 9 }', "not negative"),
        ('cad = "block.step"\ndeviations = [ { kind = "Dent" } ]', "no deviation field"),
        ('cad = "block.step"\ndeviations = [ { kind = "Bump" } ]', "deviations"),
        ('cad = "block.step"\ndeviations = [ 3 ]', "deviations"),
    ],
)
def test_what_is_wrong_in_a_plan_is_told_in_a_sentence(text, words, folder):
    with pytest.raises(InputError, match=words):
        planned(folder, text)


def test_a_plan_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        make_dataset(str(tmp_path / "plan.toml"), tmp_path)
