"""The page of maps, used as a person would: with a mouse and a keyboard, in a browser."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from inspect3d.compare.verdict import verdict
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.errors_file import write_errors
from inspect3d.deviate.map_covariance import Independent, MapCovariance
from inspect3d.outcome import InputError
from inspect3d.recipe import load_recipe
from inspect3d.report.maps import map_polydata
from inspect3d.report.results import as_json, results
from inspect3d.web.notebook import Results
from inspect3d.web.page import Request
from inspect3d.web.view_page import view_of
from tests.browsing import browser, drawn, opened, serving
from tests.test_report import NASTY, a_record

pytestmark = [pytest.mark.browser, pytest.mark.slow]

HEEDING = (
    "import os, signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "os.execv(sys.argv[1], sys.argv[1:])"
)
"""Starts a command that heeds Ctrl-C even where the tests were started in the background."""
RECIPE = f"""\
schema = 1   # of the recipe

[part]
name = {NASTY!r}
cad = "ring.step"
tolerance = [-0.1, 0.1]

[[measurements]]
name = "laser"     # in the metrology room
method = "scan"
files = ["a.ply"]
"""


def _other(part, seed, mesh):
    """Return the map of another method with other noise, and with residuals."""
    noise = np.random.default_rng(seed).normal(0, 0.01, len(mesh))
    value = noise + 0.15 * np.sin(mesh.nodes[:, 0] / 5)
    deviation = Deviation(part.deviation.value + value, part.deviation.sigma, part.deviation.observed)
    judged = verdict(deviation, np.tile([-0.1, 0.1], (len(mesh), 1)), 0.95)
    return replace(part, name="stereo", deviation=deviation, verdict=judged, residual=np.abs(noise) * 100)


@pytest.fixture(scope="module")
def out(tmp_path_factory) -> Path:
    """Return the results of two methods on a box, and beside it the recipe."""
    folder = tmp_path_factory.mktemp("box")
    record = a_record()
    mesh, laser = record.nominal.mesh, record.parts[0]
    parts = (laser, _other(laser, 1, mesh), record.parts[1])
    for name in ("ring.step", "a.ply"):
        (folder / name).write_text("x")
    (folder / "recipe.toml").write_text(RECIPE, "utf-8")
    written = folder / "out"
    written.mkdir()
    (written / "results.json").write_text(as_json(results(replace(record, parts=parts))), "utf-8")
    for part in parts[:2]:
        map_polydata(mesh, part).save(written / f"{part.name}.vtp")
        node = np.flatnonzero(part.deviation.observed)
        covariance = MapCovariance(node, Independent(np.full(len(node), 1e-4)), np.zeros((len(node), 0)))
        write_errors(written / f"{part.name}_errors.npz", covariance, {part.name: f"{part.name}.ply"}, mesh.face)
    return written


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture
def page(chromium, out):
    with serving(view_of([out], out.parent / "recipe.toml").page) as server, opened(chromium, server) as found:
        yield found


def picture_of(page, which: int) -> np.ndarray:
    """Return what a map shows, (rows, columns, 3)."""
    drawn(page)
    shot = page.locator(".map canvas").nth(which).screenshot()
    return cv2.imdecode(np.frombuffer(shot, np.uint8), cv2.IMREAD_COLOR).astype(float)


def middle(page, which: int = 0) -> tuple[float, float]:
    box = page.locator(".map canvas").nth(which).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_every_field_is_shown_in_its_own_colours_and_names_are_text(page):
    assert page.text_content("#part") == NASTY
    assert page.locator(".map > header strong").all_text_contents() == ["laser", "stereo"]
    fields = page.locator("#field option").evaluate_all("options => options.map((each) => each.value)")
    assert fields == ["deviation", "sigma", "tolerance", "verdict", "residual", "difference", "en"]
    seen = []
    for field in fields:
        page.select_option("#field", field)
        page.wait_for_selector(f'body[data-shown="{field}"]')
        seen.append(picture_of(page, 1))
        assert (
            page.locator("#bar strong").text_content().split(",")[0]
            in page.locator("#field option:checked").text_content()
        )
    different = [np.abs(a - b).max() > 20 for k, a in enumerate(seen) for b in seen[:k]]
    assert all(different)


def test_the_probe_gives_value_and_uncertainty_and_the_maps_turn_together(page):
    x, y = middle(page)
    page.mouse.move(x, y + 5)
    page.wait_for_selector(".map .probe:not([hidden])")
    words = page.locator(".map .probe:not([hidden])").first.text_content()
    assert words.startswith("+0.050 ± 0.020 mm, conform")
    before = picture_of(page, 1)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 120, y + 40, steps=4)
    page.mouse.up()
    assert np.abs(picture_of(page, 1) - before).max() > 50
    page.locator(".map canvas").first.focus()
    page.keyboard.press("0")
    assert np.abs(picture_of(page, 1) - before).mean() < 1


def test_a_section_is_dragged_with_the_mouse_and_moved_with_the_keyboard(page):
    page.select_option("#section", "0")
    handle = page.locator(".handle").first
    start = float(handle.get_attribute("aria-valuenow"))
    box = handle.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 60, y + 35, steps=5)
    page.mouse.up()
    dragged = float(handle.get_attribute("aria-valuenow"))
    assert dragged - start > 2
    assert page.text_content("#profileTitle") == f"Section x = {dragged:.2f} mm".replace("-", "−")
    handle.focus()
    page.keyboard.press("ArrowUp")
    assert float(handle.get_attribute("aria-valuenow")) == pytest.approx(dragged + 30 / 200, abs=2e-3)
    profile = page.locator("#profile canvas").screenshot()
    colours = cv2.imdecode(np.frombuffer(profile, np.uint8), cv2.IMREAD_COLOR).reshape(-1, 3)
    for ink in ((153, 95, 31), (12, 65, 194)):  # of the two maps; blue, green, red
        assert (np.abs(colours.astype(int) - ink).max(axis=1) < 30).sum() > 50


def test_flags_are_set_by_mouse_and_keyboard_named_and_saved_in_the_recipe(page, out):
    recipe = out.parent / "recipe.toml"
    assert page.locator(".flag").count() == 0
    x, y = middle(page)
    page.mouse.click(x, y + 5)
    page.locator(".map canvas").nth(1).focus()
    page.keyboard.press("+")
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    assert page.locator(".flag").count() == 3
    page.locator(".flag button").last.click()
    assert page.locator(".flag").count() == 2
    name = page.locator(".flag input").first
    name.fill("<b>bump</b>")
    name.press("Enter")
    assert page.locator(".pin .tag span").first.text_content().startswith("<b>bump</b>: +0.050 ± 0.020 mm")
    page.keyboard.press("Control+s")
    page.wait_for_selector("text=2 flags saved in recipe.toml")
    labels = load_recipe(recipe).report.labels
    assert [label.name for label in labels] == ["<b>bump</b>", "P2"]
    assert recipe.read_text("utf-8").startswith(RECIPE)
    assert set(tomllib.loads(recipe.read_text("utf-8"))["report"]) == {"labels"}


def test_where_two_maps_share_a_file_the_page_says_why_there_is_no_en_and_shows_none(chromium, out, tmp_path):
    shutil.copytree(out, tmp_path / "out")
    shutil.copy(out / "laser_errors.npz", tmp_path / "out" / "stereo_errors.npz")
    with serving(view_of([tmp_path / "out"], None).page) as server, opened(chromium, server, refused=1) as page:
        page.select_option("#field", "en")
        page.wait_for_selector("text=stereo and laser were measured from the same laser.ply")
        shown = picture_of(page, 1)
        grey = np.abs(shown - shown.mean(axis=2, keepdims=True)).max(axis=2) < 15
        assert grey.mean() > 0.97


def test_limits_and_colours_are_chosen_and_a_picture_is_kept(page, tmp_path):
    usual = picture_of(page, 1)
    for which, limit in (("#high", "0.06"), ("#low", "-0.06")):
        page.fill(which, limit)
        page.press(which, "Enter")
    assert np.abs(picture_of(page, 1) - usual).max() > 20
    page.fill("#low", "1")
    page.press("#low", "Enter")
    assert page.text_content("#said") == "The lower limit of the colours lies below the upper one."
    page.click("#reset")
    assert np.abs(picture_of(page, 1) - usual).max() < 20
    page.select_option("#palette", label="purple, white, orange")
    assert np.abs(picture_of(page, 1) - usual).max() > 20
    with page.expect_download() as download:
        page.click("#picture")
    assert "<" not in download.value.suggested_filename
    download.value.save_as(tmp_path / "kept.png")
    assert min(cv2.imread(str(tmp_path / "kept.png")).shape[:2]) > 800


def test_a_broken_map_is_told_on_the_terminal_and_the_others_are_shown(out, tmp_path):
    broken = tmp_path / "broken"
    shutil.copytree(out, broken)
    (broken / "stereo.vtp").write_text("<VTKFile")
    assert view_of([broken], None).damaged == [
        f"{broken / 'stereo.vtp'} is not a map of inspect3d: run the inspection again."
    ]
    command = [sys.executable, "-m", "inspect3d", "view", str(broken), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as server:
        assert "stereo.vtp is not a map" in server.stderr.readline()
        assert server.stdout.readline().startswith("view: ")
        server.terminate()
    (broken / "laser.vtp").unlink()
    with pytest.raises(InputError, match=r"laser\.vtp is missing"):
        view_of([broken], None)
    shutil.copy(out / "stereo.vtp", broken)
    rest = view_of([broken], None)
    assert [each.name for each in rest.shown] == ["stereo"]
    assert json.loads(rest.map(Request("map", {"map": "0"})).body)["geometry"] == 0
    without = {each["name"]: each["reason"] for each in json.loads(rest.maps(Request("maps", {})).body)["without"]}
    assert without["laser"] == f"{broken / 'laser.vtp'} is missing: run the inspection again."


def test_ctrl_c_stops_the_server_cleanly_and_the_page_left_open_says_so(chromium, out):
    command = [sys.executable, "-m", "inspect3d", "view", str(out), "--no-browser"]
    heeding = [sys.executable, "-c", HEEDING, *command]
    with subprocess.Popen(heeding, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as server:
        page = chromium.new_page()
        page.goto(server.stdout.readline().removeprefix("view: ").strip())
        page.wait_for_selector("body[data-ready=all]")
        assert page.locator("#gone").is_hidden()
        server.send_signal(signal.SIGINT)
        words, complaints = server.communicate(timeout=60)
    assert (server.returncode, complaints) == (0, "")
    assert words.endswith("Stopped.\n")
    page.wait_for_selector("#gone:not([hidden])")
    assert "The server has stopped" in page.text_content("#gone")
    page.close()


def test_a_notebook_shows_the_live_view_without_a_server_and_a_picture_otherwise(chromium, tmp_path):
    record = a_record()
    part = record.parts[0]
    node = np.flatnonzero(part.deviation.observed)
    covariance = MapCovariance(node, Independent(np.full(len(node), 1e-4)), np.zeros((len(node), 0)))
    (tmp_path / "results.json").write_text(as_json(results(record)), "utf-8")
    map_polydata(record.nominal.mesh, part).save(tmp_path / "laser.vtp")
    write_errors(tmp_path / "laser_errors.npz", covariance, {}, record.nominal.mesh.face)
    shown = Results(tmp_path)
    notebook = tmp_path / "notebook.html"
    notebook.write_text(f"<!DOCTYPE html><body>{shown._repr_html_()}", "utf-8")
    page = chromium.new_page()
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(notebook.as_uri())
    frame = page.frame_locator("iframe")
    frame.locator(".field option").first.wait_for(state="attached")
    frame.locator("canvas").first.hover()
    frame.locator(".probe:not([hidden])").first.wait_for()
    assert [url for url in asked if not url.startswith(("file:", "about:", "data:"))] == []
    page.close()
    picture = cv2.imdecode(np.frombuffer(shown._repr_png_(), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (750, 1000, 3)
    assert picture.std() > 10
