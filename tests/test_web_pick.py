"""The page to pick points on, used as a person would: with a mouse and a keyboard, in a browser."""

from __future__ import annotations

import json
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
import trimesh

from inspect3d.camera import Camera, View
from inspect3d.inspection import run
from inspect3d.nominal.load import load_nominal
from inspect3d.pose import Pose
from inspect3d.recipe import load_recipe
from inspect3d.register.landmarks import pose_from_landmarks
from inspect3d.virtual.stereo_datasets import knowing, milled_stereo
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d.web.pick_page import pick_of
from tests.browsing import browser, drawn, opened, serving

pytestmark = [pytest.mark.browser, pytest.mark.slow]

NAME = '<script>alert("x")</script> & Block'
CLOUD = """\
schema = 1

[part]
name = "Block"
cad = "part.step"   # as milled
element_size = 8.0

[[measurements]]
name = "laser"      # the short one
method = "scan"
files = ["scan.txt"]
alignment = { refine = false }
"""
CORNERS = np.array([[0, 70, 20], [0, 0, 20], [86, 0, 22.703], [100, 0, 22.703], [100, 54, 22.703], [100, 70, 6.703]])
"""Of the milled block, mm; all of them in both pictures and from above."""
ENLARGED = 12.0
"""By which a picture is enlarged to click on it."""


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def photographs(tmp_path_factory) -> Path:
    """Return a folder with photographs of the milled block, whose recipe has comments and no landmarks."""
    folder = tmp_path_factory.mktemp("block")
    knowing(milled_stereo(0, StereoRig().halved().halved()), None).write(folder, 0)
    text = re.sub(r"landmarks = \[.*?\n\]\n", "", (folder / "recipe.toml").read_text("utf-8"), flags=re.DOTALL)
    text = text.replace('name = "Milled block"', f"name = {NAME!r}  # as on the drawing")
    text = text.replace("element_size = 2.0", "element_size = 8.0")
    (folder / "recipe.toml").write_text(text + "\n# the end\n", "utf-8")
    return folder


@pytest.fixture
def cloud(photographs, tmp_path) -> tuple[Path, np.ndarray, Pose]:
    """Return a recipe with a scan of the block, whose last run was ambiguous; the points, and their pose."""
    shutil.copy(photographs / "part.step", tmp_path)
    (tmp_path / "recipe.toml").write_text(CLOUD, "utf-8")
    surface = load_nominal(tmp_path / "part.step", element_size=8.0).surface
    cad_from_scan = Pose.small(np.array([0.0, 0.0, 0.2, 30.0, -20.0, 5.0]), np.zeros(3))
    points, _ = trimesh.sample.sample_surface(trimesh.Trimesh(surface.vertices, surface.triangles), 40_000, seed=0)
    points = cad_from_scan.inverse()(np.asarray(points))
    np.savetxt(tmp_path / "scan.txt", points, fmt="%.4f")
    candidates = [
        {"matrix": np.diag(sides).tolist(), "scale": 1.0, "residual": residual}
        for sides, residual in (([1.0, 1, 1, 1], 0.01), ([-1.0, -1, 1, 1], 0.011))
    ]
    ended = {"status": "ambiguous", "reason": "Two poses <fit>.", "alignment": {"candidates": candidates}}
    (tmp_path / "out").mkdir()
    part = {"name": "Block", "cad": "part.step", "tolerance": None, "bounds": [[0, 0, 0], [1, 1, 1]]}
    values = {"part": part, "inputs": [], "measurements": {"laser": {"method": "scan", **ended}}}
    (tmp_path / "out" / "results.json").write_text(json.dumps(values), "utf-8")
    return tmp_path / "recipe.toml", points, cad_from_scan


@pytest.fixture
def recipe(photographs) -> Path:
    """Return the recipe, as it was before any test."""
    path = photographs / "recipe.toml"
    before = path.read_bytes()
    yield path
    path.write_bytes(before)


def views_of(folder: Path) -> list[View]:
    """Return the true cameras of a dataset."""
    cameras = json.loads((folder / "truth.json").read_text("utf-8"))["cameras"]
    return [
        View(
            Camera(np.array(each["matrix"]), np.array(each["distortion"]), tuple(each["size"])),
            Pose.from_matrix(np.array(each["camera_from_cad"])),
        )
        for each in cameras
    ]


def click_on_cad(page, point: np.ndarray) -> None:
    """Click on a point (3,) mm of the block of 100 x 70 mm, seen from above."""
    page.click('[data-view="0 0 1"]')
    box = page.locator("#cad canvas").bounding_box()
    pixel = max(2.25 * 50 / box["width"], 2.25 * 35 / box["height"])
    x = box["x"] + box["width"] / 2 + (point[0] - 50) / pixel
    y = box["y"] + box["height"] / 2 - (point[1] - 35) / pixel
    page.mouse.click(round(x) + 2, round(y) - 1)


def click_on_cloud(page, points: np.ndarray, point: np.ndarray) -> None:
    """Click on the point of the cloud in front, seen along the diagonal as at the beginning, that is nearest to one."""
    canvas = page.locator(".shots canvas")
    canvas.focus()
    page.keyboard.press("0")
    box = canvas.bounding_box()
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    near = np.full(3, 1 / np.sqrt(3))
    right = np.array([-1.0, 1.0, 0.0]) / np.sqrt(2)
    turn = np.stack([right, np.cross(near, right)])
    spans = np.abs((points - centre) @ turn.T).max(axis=0)
    pixel = max(2.25 * spans[0] / box["width"], 2.25 * spans[1] / box["height"])
    x, y = turn @ (point - centre) / pixel
    page.mouse.click(box["x"] + box["width"] / 2 + x, box["y"] + box["height"] / 2 - y)


def click_in_picture(page, which: int, pixel: np.ndarray, size: tuple[int, int]) -> None:
    """Turn the wheel over a place of a picture, px, and click on it, to a fraction of a pixel."""
    canvas = page.locator(".shot canvas").nth(which)
    canvas.focus()
    page.keyboard.press("0")
    box = canvas.bounding_box()
    scale = min(box["width"] / size[0], box["height"] / size[1])
    left = box["x"] + (box["width"] - size[0] * scale) / 2
    top = box["y"] + (box["height"] - size[1] * scale) / 2
    near = np.round([left + (pixel[0] + 0.5) * scale, top + (pixel[1] + 0.5) * scale])
    page.mouse.move(*near)
    page.mouse.wheel(0, -np.log(ENLARGED) / 0.0015)
    drawn(page)
    under = (near - [left, top]) / scale - 0.5
    at = np.round(near + (pixel - under) * scale * ENLARGED)
    page.mouse.click(*at)


def pick_pairs(page, views: list[View], points: np.ndarray, wrong: dict[int, float] | None = None) -> None:
    """Pick points on the CAD and in every picture; those in `wrong` that many pixels off in the second."""
    page.select_option("#snapPicture", "")
    for k, point in enumerate(points):
        click_on_cad(page, point)
        for which, view in enumerate(views):
            pixel = view.project(point[None])[0] + [(wrong or {}).get(k, 0.0) * which, 0.0]
            click_in_picture(page, which, pixel, view.camera.size)
        page.wait_for_selector(f'body[data-pairs="{k + 1}"]')


def fitted(page) -> float:
    """Return the reprojection error of the page, px rms, once it is there."""
    page.wait_for_selector('body:not([data-rms=""])')
    return float(page.get_attribute("body", "data-rms"))


def test_six_pairs_picked_by_mouse_place_the_cameras_within_a_pixel_and_the_saved_recipe_runs(
    chromium, photographs, recipe
):
    before, views = recipe.read_text("utf-8"), views_of(photographs)
    with serving(pick_of(recipe, photographs / "out").page) as server, opened(chromium, server) as page:
        assert page.text_content("#part") == NAME
        pick_pairs(page, views, CORNERS)
        assert fitted(page) < 1.0
        page.screenshot(path=photographs / "six.png")
        page.click("#save")
        page.wait_for_selector('body[data-saved="6"]')
    text = recipe.read_text("utf-8")
    for line in before.splitlines():
        assert line in text
    table = tomllib.loads(text)["measurements"][0]
    assert np.abs(np.array([row["cad"] for row in table["landmarks"]]) - CORNERS).max() < 1e-3
    assert [row["name"] for row in table["landmarks"]] == ["P1", "P2", "P3", "P4", "P5", "P6"]
    (part,) = run(recipe, photographs / "out").parts
    assert part.status.has_map, part.reason
    started = re.search(r"6 landmarks, which fit within ([\d.]+) px rms", " ".join(part.remarks))
    assert float(started[1]) < 1.0


def test_a_pair_that_does_not_fit_stands_out_until_it_is_undone_or_deleted(chromium, photographs, recipe):
    views = views_of(photographs)
    with serving(pick_of(recipe, photographs / "out").page) as server, opened(chromium, server) as page:
        pick_pairs(page, views, CORNERS, wrong={3: 9.0})
        fitted(page)
        assert page.locator(".pair.outlier input").input_value() == "P4"
        assert "P4 does not belong to the others" in page.text_content("#advice")
        name = page.locator(".pair input").nth(3)
        name.fill("<i>foot</i>")
        name.press("Enter")
        assert page.locator(".mark.outlier span").text_content() == "<i>foot</i>"
        page.locator(".pair.outlier button").last.click()
        page.wait_for_selector('body[data-pairs="5"]')
        assert fitted(page) < 1.0
        assert page.locator(".pair.outlier").count() == 0
        page.locator("#cad canvas").focus()
        page.keyboard.press("Control+z")
        page.wait_for_selector('body[data-pairs="6"]')
        fitted(page)
        assert page.locator(".pair.outlier").count() == 1
        for _ in range(3):
            page.click("#undo")
        assert page.locator(".pair").count() == 6
        assert page.get_attribute("body", "data-pairs") == "5"
        assert "click the same point in left.png and in right.png" in page.text_content("#advice")


def test_a_pair_is_picked_with_the_keyboard_alone(chromium, photographs, recipe):
    with serving(pick_of(recipe, photographs / "out").page) as server, opened(chromium, server) as page:
        page.locator("#cad canvas").focus()
        page.keyboard.press("t")
        assert page.get_attribute("#cad canvas", "data-aim") in ("corner", "circle centre")
        page.keyboard.press("Enter")
        for which in range(2):
            page.locator(".shot canvas").nth(which).focus()
            for key in ("ArrowLeft", "Shift+ArrowUp", "Alt+ArrowRight", "+", "Enter"):
                page.keyboard.press(key)
            page.wait_for_function(
                "which => document.querySelectorAll('.shot .caption')[which].textContent.endsWith(' px')", arg=which
            )
            place = page.locator(".shot .caption").nth(which).text_content().partition(" · ")[2].removesuffix(" px")
            np.testing.assert_allclose([float(x) for x in place.split(", ")], (304.6, 245.5), atol=0.11)  # as shown
        page.wait_for_selector('body[data-pairs="1"]')


def test_in_a_cloud_three_pairs_place_the_cad_and_are_saved(chromium, cloud):
    recipe, points, cad_from_scan = cloud
    with serving(pick_of(recipe, recipe.parent / "out").page) as server, opened(chromium, server) as page:
        assert page.locator("#starts button").all_text_contents() == ["1: 0.0100 mm", "2: 0.0110 mm"]
        assert page.text_content("#why") == "Two poses <fit>."
        wanted = np.array([[0, 0, 20.0], [100, 0, 22.703], [0, 70, 20.0]])
        for k, point in enumerate(wanted):
            click_on_cad(page, point)
            click_on_cloud(page, points, cad_from_scan.inverse()(point[None])[0])
            page.wait_for_selector(f'body[data-pairs="{k + 1}"]')
        assert fitted(page) < 2.0
        page.keyboard.press("Control+s")
        page.wait_for_selector('body[data-saved="3"]')
    text = recipe.read_text("utf-8")
    for line in CLOUD.splitlines()[:-1]:
        assert line in text
    start = load_recipe(recipe).measurements[0].alignment
    assert start.start == "landmarks"
    found = pose_from_landmarks(
        np.array([mark.measured for mark in start.landmarks]), np.array([mark.cad for mark in start.landmarks])
    )
    assert np.linalg.norm(found(points) - cad_from_scan(points), axis=1).max() < 4.0


def test_one_click_chooses_among_the_candidates_of_an_ambiguous_start(chromium, cloud):
    recipe, _, _ = cloud
    with serving(pick_of(recipe, recipe.parent / "out").page) as server, opened(chromium, server) as page:
        page.locator("#starts button").nth(1).click()
        page.wait_for_selector("text=Start 2 chosen for laser")
    start = load_recipe(recipe).measurements[0].alignment
    assert (start.start, start.refine) == ("pose", False)
    assert np.allclose(start.matrix, np.diag([-1.0, -1.0, 1.0, 1.0]))
    assert recipe.read_text("utf-8").startswith(CLOUD[: CLOUD.index("alignment")])
