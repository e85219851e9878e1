"""The isogeometric plugin, from a recipe with photographs and a STEP file to the results on disk."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
import pyvista

from inspect3d.files.calibration import Rig
from inspect3d.files.calibration_json import write_calibration_json
from inspect3d.inspection import run
from inspect3d.nominal.nurbs_face import nurbs_of, write_step
from inspect3d.nominal.step_iges import read_brep
from inspect3d.outcome import InputError, Status
from inspect3d.registry import build
from tests.speckled import rig
from tests.test_isogeometric import NURBS, photographs, rms, within

RECIPE = """
schema = 1
[part]
name = "Sheet"
cad = "sheet.step"
element_size = 3.0
[report]
formats = ["html"]
[[measurements]]
name = "nurbs"
method = "isogeometric"
images = ["left.png", "right.png"]
cameras = "calibration.json"
systematic = 0.0
alignment = { start = "identity", refine = false }
"""


@pytest.fixture(scope="module")
def inspected(tmp_path_factory):
    """Return the measured part, the nominal and the folder of an inspection."""
    folder, views = tmp_path_factory.mktemp("isogeometric"), rig()
    write_step((NURBS,), folder / "sheet.step")
    random = np.random.default_rng(0)
    for name, exact in zip(("left.png", "right.png"), photographs(views, within), strict=True):
        grey = np.clip(np.rint(exact + random.normal(0, 2.4, exact.shape)), 0, 255)
        cv2.imwrite(str(folder / name), grey.astype(np.uint8))
    lenses, places = tuple(view.camera for view in views), tuple(view.camera_from_cad for view in views)
    write_calibration_json(folder / "calibration.json", Rig(lenses, camera_from_cad=places))
    (folder / "recipe.toml").write_text(RECIPE, encoding="utf-8")
    record = run(folder / "recipe.toml", folder / "out")
    return record.parts[0], record.nominal, folder / "out"


def test_the_map_has_the_true_deviation_and_its_uncertainty(inspected):
    part, nominal, _ = inspected
    seen = part.deviation.observed
    assert part.status is Status.OK
    assert seen.mean() > 0.95
    error = part.deviation.value[seen] - within(*nominal.mesh.nodes[seen, :2].T)
    assert np.median(np.abs(error)) < 0.001
    assert 0.75 < rms(error / part.deviation.sigma[seen]) < 1.25


def test_nodes_that_the_splines_do_not_follow_are_flagged_in_map_table_and_figures(inspected):
    part, _, out = inspected
    flags = np.asarray(pyvista.read(out / "nurbs.vtp").point_data["unresolved"])
    assert flags.dtype == np.uint8
    assert np.array_equal(flags > 0, part.unresolved)
    found = json.loads((out / "results.json").read_text(encoding="utf-8"))["measurements"]["nurbs"]["unresolved"]
    assert found["nodes"] == flags.sum()
    assert 0 <= found["share_of_observed_area"] < 0.03


def test_the_measured_surface_is_left_as_step(inspected):
    part, nominal, out = inspected
    measured, seen = nurbs_of(read_brep(out / "nurbs.step"), 1), part.deviation.observed
    nodes, normals = nominal.mesh.nodes[seen], nominal.mesh.normals[seen]
    places = nodes + part.deviation.value[seen][:, None] * normals
    away = ((measured.points(measured.parameters(places)) - places) * normals).sum(axis=1)
    assert np.abs(away).max() < 5e-4


@pytest.mark.parametrize(
    ("setting", "says"),
    [({"refine": -1}, "halves the spans"), ({"degree": 40}, "is not between 0"), ({"steepest": 0.0}, "steepest")],
)
def test_settings_out_of_range_are_refused(setting, says):
    with pytest.raises(InputError, match=says):
        build("isogeometric", setting)
