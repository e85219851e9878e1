"""The report opened from disk in a browser, the network off: views draw, fields switch, views turn together."""

import base64
import io
import os
import re
import shutil

import numpy as np
import pytest
from PIL import Image
from reported import three_methods
from test_report import MOMENT, NASTY

from inspect3d.report.document import document
from inspect3d.report.page import page
from inspect3d.report.pictures import Shown
from inspect3d.report.results import results
from inspect3d.report.viewer import viewer_data
from inspect3d.report.viewpoint import Viewpoint
from tests.browsing import drawn

CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = ["--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this computer"),
]


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    """Return a tab with the report of three methods, its pictures left out, and what the browser complained of."""
    from playwright.sync_api import sync_playwright

    folder, record = tmp_path_factory.mktemp("out"), three_methods()
    Image.new("RGB", (16, 12)).save(folder / "part.png")
    report = document(record, results(record), {"": (Shown("part.png", "The part"),)}, MOMENT)
    html = page(report, folder, viewer_data(record, Viewpoint.of("iso")))
    (folder / "report.html").write_text(html, encoding="utf-8")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        tab = browser.new_context(offline=True, viewport={"width": 1280, "height": 900}).new_page()
        complaints: list[str] = []
        tab.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.on("request", lambda request: complaints.append(request.url) if not _local(request.url) else None)
        tab.goto((folder / "report.html").as_uri())
        tab.wait_for_selector("#viewer canvas")
        yield tab, complaints
        browser.close()


def _local(address):
    return address.startswith(("file:", "data:"))


def pictures(tab):
    """Return what each view shows, (height, width, 3)."""
    drawn(tab)
    found = tab.evaluate("[...document.querySelectorAll('#viewer canvas')].map((canvas) => canvas.toDataURL())")
    images = [Image.open(io.BytesIO(base64.b64decode(each.split(",")[1]))) for each in found]
    return [np.asarray(image.convert("RGB")).astype(int) for image in images]


def test_a_view_for_each_method_draws_its_map(opened):
    tab, _ = opened
    laser, wrong, peg = pictures(tab)
    for picture in (laser, wrong, peg):
        assert 0.2 < (picture.sum(axis=2) < 3 * 250).mean() < 0.95
    red = [((picture[..., 0] > 150) & (picture[..., 1] < 90)).mean() for picture in (laser, wrong, peg)]
    assert min(red[:2]) > 0.005
    assert red[2] < 0.0005
    assert tab.locator("#viewer .ramp").count() == 3
    assert "deviation, mm" in tab.locator("#viewer .bar").first.inner_text()


def test_all_views_turn_together(opened):
    tab, _ = opened
    before = pictures(tab)
    tab.locator("#viewer canvas").first.focus()
    for _ in range(6):
        tab.keyboard.press("ArrowLeft")
    after = pictures(tab)
    changed = [(np.abs(a - b).sum(axis=2) > 30).mean() for a, b in zip(before, after, strict=True)]
    assert min(changed) > 0.05
    tab.click("#viewer [data-view='1 1 1']")
    assert not np.array_equal(pictures(tab)[1], after[1])


@pytest.mark.parametrize("field", ["uncertainty (k = 1)", "tolerance", "deviation"])
def test_one_choice_switches_the_field_of_every_view(opened, field):
    tab, _ = opened
    tab.select_option("#viewer .tools .field", label="grey-level residual")
    tab.select_option("#viewer .tools .field", label=field)
    shown = tab.evaluate("[...document.querySelectorAll('#viewer canvas')].map((canvas) => canvas.dataset.shows)")
    assert shown == [f"{name}: {field}" for name in ("laser", "wrong", "peg 2% ß")]
    if field == "tolerance":
        assert "conform" in tab.locator("#viewer .bar").first.inner_text()


def test_a_view_can_show_the_difference_of_two_methods_and_its_en(opened):
    tab, _ = opened
    tab.click("#viewer .another")
    last = tab.locator("#viewer .cell").last
    last.locator(".map").select_option(label="laser − peg 2% ß")
    difference = pictures(tab)[3]
    last.locator(".field").select_option(label="E_n")
    assert "E_n" in last.locator(".bar").inner_text()
    assert (np.abs(pictures(tab)[3] - difference).sum(axis=2) > 30).mean() > 0.05
    last.locator("button[title='close this view']").click()
    assert tab.locator("#viewer canvas").count() == 3


def test_resting_on_the_part_reads_the_value_in_every_view(opened):
    tab, _ = opened
    tab.click("#viewer [data-view='0 0 1']")
    drawn(tab)
    box = tab.locator("#viewer canvas").first.bounding_box()
    tab.mouse.move(box["x"] + box["width"] / 2 + 8, box["y"] + box["height"] / 2 + 8)
    drawn(tab)
    words = tab.locator("#viewer .probe").all_inner_texts()
    assert len(words) == 3
    assert all(re.search(r"[+−]?0\.\d+ ± 0\.\d+ mm", each) for each in words), words
    assert len({each.splitlines()[-1] for each in words}) == 1


def test_the_limits_of_the_colours_hold_for_all_views(opened):
    tab, _ = opened
    tab.select_option("#viewer .tools .field", label="deviation")
    tab.fill("#viewer .high", "0.3")
    tab.locator("#viewer .high").blur()
    assert all("+0.3" in words for words in tab.locator("#viewer .bar").all_inner_texts())
    tab.click("#viewer .limits-back")
    assert not any("+0.3" in words for words in tab.locator("#viewer .bar").all_inner_texts())


def test_names_are_text_and_nothing_was_complained_of(opened):
    tab, complaints = opened
    assert tab.locator("h1").inner_text() == NASTY
    assert tab.title().startswith(NASTY)
    assert complaints == []
