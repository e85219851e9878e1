"""Every mistake in a recipe is told in one or two sentences that name the place and what is right there."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from inspect3d.file_name import file_name
from inspect3d.outcome import InputError
from inspect3d.recipe import Recipe, load_recipe

RECIPE = """
schema = 1

[part]
name = "Pawn ring"
cad = "ring.step"
element_size = 2
tolerance = [-0.1, 0.1]
probability = 0.95
regions = [ { name = "flank", box = [[0, 0, 0], [10, 5, 5]], tolerance = [-0.05, 0.05] } ]
exclude = [ { faces = [1, 2] } ]

[[measurements]]
name = "laser"
method = "scan"
files = ["a.ply", "b.ply"]
noise = 0.02
reach = 1.0
coating = { thickness = 0.040, sigma = 0.005 }
alignment = { start = "pose", matrix = [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }

[[measurements]]
name = "stereo"
method = "scan"
files = "a.ply"

[report]
formats = ["html"]
limits = [-0.2, 0.2]
labels = [ { name = "P1", point = [10, 0, 5] } ]
"""


@pytest.fixture
def folder(tmp_path):
    for name in ("ring.step", "a.ply", "b.ply"):
        (tmp_path / name).write_text("content")
    return tmp_path


def load(folder: Path, text: str) -> Recipe:
    path = folder / "recipe.toml"
    path.write_bytes(text.encode("utf-8", errors="surrogateescape"))
    return load_recipe(path)


def complaint(folder: Path, text: str) -> str:
    with pytest.raises(InputError) as caught:
        load(folder, text)
    words = str(caught.value)
    assert "\n" not in words
    assert words.endswith((".", "?"))
    assert len(words) < 600
    return words


def test_a_right_recipe_keeps_its_values_and_where_it_came_from(folder):
    recipe = load(folder, RECIPE)
    laser, stereo = recipe.measurements
    assert recipe.part.tolerance == (-0.1, 0.1)
    assert laser.settings == {"noise": 0.02}
    assert laser.alignment.refine
    assert recipe.source == folder / "recipe.toml"
    assert recipe.cad == folder / "ring.step"
    assert recipe.files(laser)["files"] == (folder / "a.ply", folder / "b.ply")
    assert recipe.files(stereo)["files"] == (folder / "a.ply",)


@pytest.mark.parametrize(
    ("right", "wrong", "says"),
    [
        ("element_size", "element_sise", "part.element_sise: unknown key; did you mean element_size?"),
        ("[part]", "[prat]", "prat: unknown key; did you mean part?"),
        ("limits", "limit", "report.limit: unknown key; did you mean limits?"),
        ("start =", "strat =", "measurements['laser'].alignment.strat: unknown key; did you mean start?"),
        ("box =", "bx =", "part.regions['flank'].bx: unknown key; did you mean box?"),
        ("schema = 1", "", "schema: missing"),
        ("schema = 1", "schema = 2", "reads schema = 1"),
        ("element_size = 2", 'element_size = "2"', 'part.element_size: wants a number, not "2"'),
        ("element_size = 2", "element_size = true", "part.element_size: wants a number, not true"),
        ("element_size = 2", "element_size = -2", "part.element_size: should be greater than 0, not -2"),
        ("element_size = 2", "element_size = nan", "part.element_size: wants a finite number"),
        ("[-0.1, 0.1]", "[0.1, -0.1]", "part.tolerance: the lower value, 0.1, comes first"),
        ("[-0.1, 0.1]", "[0.1]", "part.tolerance: too few values"),
        ("[-0.1, 0.1]", "[0, 1, 2]", "part.tolerance: too many values, 3 instead of 2"),
        ("[-0.1, 0.1]", "0.1", "part.tolerance: wants a list in square brackets, not 0.1"),
        ("[-0.05, 0.05]", "[0.05, -0.05]", "part.regions['flank'].tolerance"),
        ("probability = 0.95", "probability = 95", "part.probability: should be less than 1, not 95"),
        ("probability = 0.95", "probability = 0.5", "part.probability: should be greater than 0.5"),
        ("faces = [1, 2]", "faces = [1], box = [[0, 0, 0], [1, 1, 1]]", "part.exclude[no. 1]: give either box"),
        ("faces = [1, 2]", 'name = "hole"', "part.exclude['hole']: give either box"),
        ("faces = [1, 2]", "faces = [1.5]", "part.exclude[no. 1].faces[no. 1]: wants a whole number, not 1.5"),
        ("[[0, 0, 0]", "[[0, 9, 0]", "part.regions['flank']: the first corner of the box"),
        ("ring.step", "a.ply", "regions by faces need a STEP or IGES file"),
        ('name = "stereo"', 'name = "LASER"', "'laser' and 'LASER' would write the same files"),
        ('name = "stereo"', 'name = "laser_points"', "would write the same files"),
        ('name = "stereo"', 'name = "../stereo"', "cannot hold '/'"),
        ('name = "stereo"', 'name = "ste\\u0007reo"', "cannot hold"),
        ('name = "stereo"', 'name = "NUL"', "reserves it for a device"),
        ('name = "stereo"', 'name = ""', "1 to 100 letters"),
        ('name = "Pawn ring"', 'name = ""', "part.name"),
        ("[0, 0, 1, 0]", "[0, 0, 2, 0]", "measurements['laser'].alignment: the rotation of a pose"),
        ("[0, 0, 0, 1]]", "[0, 0, 1, 1]]", "the last row of a pose matrix"),
        ("[0, 0, 0, 1]]", "]", "measurements['laser'].alignment.matrix: too few values"),
        ('"pose"', '"auto"', 'start = "pose" and matrix'),
        ('"pose"', '"pise"', "measurements['laser'].alignment.start: should be 'auto', 'identity'"),
        ("thickness = 0.040", "thickness = -1", "measurements['laser'].coating.thickness"),
        ('files = "a.ply"', "files = 3", "measurements['stereo']: files wants the name of a file"),
        ('files = "a.ply"', 'files = "c.ply"', "there is no file"),
        ('files = "a.ply"', 'files = "a.pyl"', "Did you mean a.ply?"),
        ('files = "a.ply"', 'files = "no/c.ply"', "Nor is there a folder"),
        ('files = "a.ply"', 'files = "."', "is a folder"),
        ('files = "a.ply"', 'files = "a\\u0000.ply"', "control characters"),
        ('files = "a.ply"', f'files = "{"x" * 300}.ply"', "measurements['stereo'].files"),
        ("noise = 0.02", "noise = 0.02\nnoise = 0.03", "is not valid TOML: Cannot overwrite a value (at line 18"),
        ("[report]", "[report", "is not valid TOML"),
        ('formats = ["html"]', 'formats = ["docx"]', "should be 'html' or 'pdf', not \"docx\""),
        ("limits = [-0.2, 0.2]", "limits = [0.2, 0.2]", "report.limits"),
        ('name = "P1", ', "", "report.labels[no. 1].name: missing"),
        ("[report]", "[[report]]", "report: wants a table"),
        ('name = "Pawn ring"', 'name = ""', 'part.name: wants a text, not ""'),
        ("schema = 1", "schema = 1\nmeasurements = []\n[x]\n", "is not valid TOML"),
    ],
)
def test_a_mistake_is_one_sentence_about_where_and_what(folder, right, wrong, says):
    assert right in RECIPE
    assert says in complaint(folder, RECIPE.replace(right, wrong))


def test_landmarks_are_three_or_more(folder):
    pair = "{ cad = [0, 0, 0], measured = [1, 2, 3] }"
    two, three = (
        RECIPE.replace(
            'files = "a.ply"', f'files = "a.ply"\nalignment = {{ start = "landmarks", landmarks = [{pairs}] }}'
        )
        for pairs in (", ".join([pair] * 2), ", ".join([pair] * 3))
    )
    assert "needs at least 3 landmarks, and there are 2" in complaint(folder, two)
    assert len(load(folder, three).measurements[1].alignment.landmarks) == 3


def test_the_landmarks_of_a_cloud_may_stand_beside_the_alignment(folder):
    pairs = ", ".join(["{ cad = [0, 0, 0], measured = [1, 2, 3] }"] * 3)
    beside = f'files = "a.ply"\nlandmarks = [{pairs}]\nalignment = {{ start = "landmarks" }}'
    stereo = load(folder, RECIPE.replace('files = "a.ply"', beside)).measurements[1]
    assert len(stereo.alignment.landmarks) == 3
    assert "landmarks" not in stereo.settings


def test_landmarks_that_are_no_tables_are_a_setting_of_the_method(folder):
    stereo = load(
        folder, RECIPE.replace('files = "a.ply"', 'files = "a.ply"\nlandmarks = [1, "measured"]')
    ).measurements[1]
    assert stereo.settings["landmarks"] == (1, "measured")


def test_the_landmarks_of_pictures_belong_to_the_method(folder):
    row = "landmarks = [{ cad = [0, 0, 5], pixels = [[512.3, 300.1], [498.7, 310.9]] }]"
    stereo = load(folder, RECIPE.replace('files = "a.ply"', f'files = "a.ply"\n{row}')).measurements[1]
    assert stereo.settings["landmarks"][0]["pixels"][0] == (512.3, 300.1)


def test_a_mesh_may_have_units_and_a_step_file_has_its_own(folder):
    inch = RECIPE.replace('cad = "ring.step"', 'cad = "ring.step"\nunits = "inch"')
    assert "carries its own" in complaint(folder, inch)
    mesh = inch.replace("ring.step", "a.ply").replace("exclude = [ { faces = [1, 2] } ]", "")
    assert load(folder, mesh).part.units == "inch"


def test_a_recipe_without_measurements_is_refused(folder):
    part, _, rest = RECIPE.partition("[[measurements]]")
    assert "measurements: missing" in complaint(folder, f"{part}[report]{rest.partition('[report]')[2]}")
    assert "at least one" in complaint(folder, "measurements = []\n" + part)


@pytest.mark.parametrize(
    "content", [b"", b"\x00\x01\xff", b"solid cube\nendsolid", b"[" * 5000, b"a = [" + b"[" * 5000]
)
def test_a_file_that_is_no_recipe_is_refused_with_a_sentence(folder, content):
    complaint(folder, content.decode("utf-8", errors="surrogateescape"))


def test_a_byte_order_mark_is_no_mistake(folder):
    assert load(folder, "\ufeff" + RECIPE).part.name == "Pawn ring"


def test_a_recipe_that_is_missing_or_a_folder_is_refused(folder):
    (folder / "recipe.toml").write_text(RECIPE)
    with pytest.raises(InputError, match=r"Did you mean recipe\.toml\?"):
        load_recipe(folder / "recipes.toml")
    with pytest.raises(InputError, match="is a folder"):
        load_recipe(folder)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything")
def test_a_file_one_may_not_read_is_refused(folder):
    (folder / "a.ply").chmod(0)
    assert "cannot be read: Permission denied" in complaint(folder, RECIPE)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes in folders")
def test_a_pipe_is_no_file(folder):
    os.mkfifo(folder / "pipe")
    assert "is not an ordinary file" in complaint(folder, RECIPE.replace('files = "a.ply"', 'files = "pipe"'))


@given(st.text(max_size=120))
def test_an_accepted_name_is_one_plain_component_of_a_path(name):
    try:
        accepted = file_name(name)
    except ValueError:
        return
    assert accepted == name
    assert Path(accepted).name == name
    assert name.isprintable()
    assert not set(name) & set('\\/:*?"<>|')
    assert len(name.encode()) <= 100
