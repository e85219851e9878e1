"""The report opened from disk in a browser, the network off: views draw, fields switch, views turn together."""

import base64
import io
import os
import re
import shutil

import numpy as np
import pytest
from reported import three_methods
from test_report import MOMENT, NASTY

from inspect3d.report.write import write_report

CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = ["--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this computer"),
]


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    """Return the page of a report of three methods, and what the browser complained of."""
    from playwright.sync_api import sync_playwright

    folder = tmp_path_factory.mktemp("out")
    write_report(three_methods(), folder, moment=MOMENT)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_context(offline=True, viewport={"width": 1280, "height": 900}).new_page()
        complaints: list[str] = []
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: complaints.append(request.url) if not _local(request.url) else None)
        page.goto((folder / "report.html").as_uri())
        page.wait_for_selector("#viewer canvas")
        yield page, complaints
        browser.close()


def _local(address):
    return address.startswith(("file:", "data:"))


def pictures(page):
    """Return what each view shows, (height, width, 3)."""
    from PIL import Image

    page.wait_for_timeout(400)
    found = page.evaluate("[...document.querySelectorAll('#viewer canvas')].map((canvas) => canvas.toDataURL())")
    images = [Image.open(io.BytesIO(base64.b64decode(each.split(",")[1]))) for each in found]
    return [np.asarray(image.convert("RGB")).astype(int) for image in images]


def test_a_view_for_each_method_draws_its_map(opened):
    page, _ = opened
    laser, wrong, peg = pictures(page)
    for picture in (laser, wrong, peg):
        assert 0.2 < (picture.sum(axis=2) < 3 * 250).mean() < 0.95
    red = [((picture[..., 0] > 150) & (picture[..., 1] < 90)).mean() for picture in (laser, wrong, peg)]
    assert min(red[:2]) > 0.005
    assert red[2] < 0.0005
    assert page.locator("#viewer .ramp").count() == 3
    assert "deviation, mm" in page.locator("#viewer .bar").first.inner_text()


def test_all_views_turn_together(opened):
    page, _ = opened
    before = pictures(page)
    page.locator("#viewer canvas").first.focus()
    for _ in range(6):
        page.keyboard.press("ArrowLeft")
    after = pictures(page)
    changed = [(np.abs(a - b).sum(axis=2) > 30).mean() for a, b in zip(before, after, strict=True)]
    assert min(changed) > 0.05
    page.click("#viewer [data-view='1 1 1']")
    assert not np.array_equal(pictures(page)[1], after[1])


@pytest.mark.parametrize("field", ["uncertainty (k = 1)", "tolerance", "deviation"])
def test_one_choice_switches_the_field_of_every_view(opened, field):
    page, _ = opened
    page.select_option("#viewer .tools .field", label="grey-level residual")
    page.select_option("#viewer .tools .field", label=field)
    shown = page.evaluate("[...document.querySelectorAll('#viewer canvas')].map((canvas) => canvas.dataset.shows)")
    assert shown == [f"{name}: {field}" for name in ("laser", "wrong", "peg 2% ß")]
    if field == "tolerance":
        assert "conform" in page.locator("#viewer .bar").first.inner_text()


def test_a_view_can_show_the_difference_of_two_methods_and_its_en(opened):
    page, _ = opened
    page.click("#viewer .another")
    last = page.locator("#viewer .cell").last
    last.locator(".map").select_option(label="laser − peg 2% ß")
    difference = pictures(page)[3]
    last.locator(".field").select_option(label="E_n")
    assert "E_n" in last.locator(".bar").inner_text()
    assert (np.abs(pictures(page)[3] - difference).sum(axis=2) > 30).mean() > 0.05
    last.locator("button[title='close this view']").click()
    assert page.locator("#viewer canvas").count() == 3


def test_resting_on_the_part_reads_the_value_in_every_view(opened):
    page, _ = opened
    page.click("#viewer [data-view='0 0 1']")
    page.wait_for_timeout(400)
    box = page.locator("#viewer canvas").first.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2 + 8, box["y"] + box["height"] / 2 + 8)
    page.wait_for_timeout(400)
    words = page.locator("#viewer .probe").all_inner_texts()
    assert len(words) == 3
    assert all(re.search(r"[+−]?0\.\d+ ± 0\.\d+ mm", each) for each in words), words
    assert len({each.splitlines()[-1] for each in words}) == 1


def test_the_limits_of_the_colours_hold_for_all_views(opened):
    page, _ = opened
    page.select_option("#viewer .tools .field", label="deviation")
    page.fill("#viewer .high", "0.3")
    page.locator("#viewer .high").blur()
    assert all("+0.3" in words for words in page.locator("#viewer .bar").all_inner_texts())
    page.click("#viewer .limits-back")
    assert not any("+0.3" in words for words in page.locator("#viewer .bar").all_inner_texts())


def test_names_are_text_and_nothing_was_complained_of(opened):
    page, complaints = opened
    assert page.locator("h1").inner_text() == NASTY
    assert page.title().startswith(NASTY)
    assert complaints == []
