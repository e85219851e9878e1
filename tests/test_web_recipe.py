"""A page changes one key of a recipe, and nothing else."""

from __future__ import annotations

import tomllib

import pytest

from inspect3d.outcome import InputError
from inspect3d.recipe import load_recipe
from inspect3d.web.recipe_text import change_recipe, measurement, report_table, set_rows

TEXT = """\
# our recipe
schema = 1

[part]   # the part
name = "Ring"
cad = "ring.step"      # from the archive

[[measurements]]
name = "laser"
method = "scan"        # ours
files = ["a.ply"]
landmarks = [ { cad = [0, 0, 0], measured = [1, 1, 1] } ]   # old

[[measurements]]
name = "second"
method = "scan"
files = ["a.ply"]
[measurements.alignment]
start = "identity"     # by the fixture

[report]
limits = [-0.1, 0.1]
"""
ROWS = [{"name": f"P{k} <b>", "cad": [k, 0.5, 0.0], "measured": [0.0, k, 1.25]} for k in range(4)]


@pytest.fixture
def recipe(tmp_path):
    for name in ("ring.step", "a.ply"):
        (tmp_path / name).write_text("x")
    path = tmp_path / "recipe.toml"
    path.write_text(TEXT, "utf-8")
    return path


@pytest.mark.parametrize("name", ["laser", "second"])
def test_landmarks_go_into_their_measurement_and_comments_and_order_stay(recipe, name):
    change_recipe(recipe, lambda document: set_rows(measurement(document, name), "landmarks", ROWS))
    text = recipe.read_text("utf-8")
    kept = [line for line in TEXT.splitlines() if "landmarks" not in line or name != "laser"]
    lines = iter(text.splitlines())
    assert all(line in lines for line in kept)
    before, after = tomllib.loads(TEXT), tomllib.loads(text)
    table = next(each for each in before["measurements"] if each["name"] == name)
    table["landmarks"] = ROWS
    assert after == before
    tables = {each.name: each for each in load_recipe(recipe).measurements}
    assert [mark.name for mark in tables[name].alignment.landmarks] == [row["name"] for row in ROWS]
    assert tables["second"].alignment.start == "identity"


def test_a_report_table_is_added_where_there_is_none_and_no_rows_leave_no_key(recipe):
    recipe.write_text(TEXT[: TEXT.index("[report]")], "utf-8")
    labels = [{"name": "P1", "point": [1.0, 2.0, 3.0]}]
    change_recipe(recipe, lambda document: set_rows(report_table(document), "labels", labels))
    assert [label.name for label in load_recipe(recipe).report.labels] == ["P1"]
    change_recipe(recipe, lambda document: set_rows(report_table(document), "labels", []))
    assert load_recipe(recipe).report.labels == ()


def test_a_change_that_makes_the_recipe_wrong_leaves_it_as_it_is(recipe):
    wrong = [{"name": "P1", "point": [1.0, 2.0]}]
    with pytest.raises(InputError, match="labels"):
        change_recipe(recipe, lambda document: set_rows(report_table(document), "labels", wrong))
    with pytest.raises(InputError, match="no measurement 'third'"):
        change_recipe(recipe, lambda document: set_rows(measurement(document, "third"), "landmarks", ROWS))
    assert recipe.read_text("utf-8") == TEXT
    assert sorted(path.name for path in recipe.parent.iterdir()) == ["a.ply", "recipe.toml", "ring.step"]


def test_a_recipe_that_was_broken_meanwhile_is_not_touched(recipe):
    recipe.write_text("schema = ", "utf-8")
    with pytest.raises(InputError, match="not valid TOML any more"):
        change_recipe(recipe, lambda document: None)
    assert recipe.read_text("utf-8") == "schema = "


def test_a_recipe_behind_a_link_is_changed_where_it_lies_and_keeps_its_rights(recipe, tmp_path):
    (tmp_path / "kept").mkdir()
    real = recipe.rename(tmp_path / "kept" / "real.toml")
    real.chmod(0o640)
    recipe.symlink_to(real)
    change_recipe(recipe, lambda document: document["part"].update(element_size=3.0))
    assert recipe.is_symlink()
    assert real.stat().st_mode & 0o777 == 0o640
    assert load_recipe(recipe).part.element_size == 3.0
