"""Faces that meet without sharing an edge, that have come apart on the part, and that have holes in them."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from inspect3d.correlation.splines import Splines
from inspect3d.files.calibration import Rig
from inspect3d.files.calibration_json import write_calibration_json
from inspect3d.inspection import run
from inspect3d.nominal.borders import borders
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nurbs import Nurbs
from inspect3d.nominal.nurbs_face import nurbs_of, surface_of, write_step
from inspect3d.nominal.step_iges import read_brep
from inspect3d.outcome import Status
from inspect3d.virtual.part import Part
from tests.sheets import DEPTH, WIDTH, plane, plane_normals
from tests.speckled import Speckle, photographed, picture, rig
from tests.test_isogeometric import NURBS, errors, knots, measured, photographs, rms, step, within

MIDDLE = 33.0
HOLES = ((20.0, 15.0, 6.0), (42.0, 30.0, 4.0))  # x, y and radius, mm

RECIPE = """
schema = 1
[part]
name = "Sheet with holes"
cad = "sheet.step"
element_size = 3.0
[report]
formats = ["html"]
"""
TABLE = """
[[measurements]]
name = "{name}"
method = "isogeometric"
images = ["left.png", "right.png"]
cameras = "calibration.json"
systematic = 0.0
directions = "{directions}"
alignment = {{ start = "identity", refine = false }}
"""


def half(low, high):
    """Return a flat face from x = low to high, mm."""
    across = np.concatenate([np.zeros(3), np.linspace(0, 1, 4), np.ones(3)])
    flat = Nurbs(np.zeros((6, 9, 3)), np.ones((6, 9)), across, knots())
    u, v = flat.greville.T
    places = np.stack([low + (high - low) * u, DEPTH * v, 0 * u], axis=1)
    return replace(flat, poles=places.reshape(6, 9, 3))


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    """Return a flat sheet of two faces, each with edges of its own."""
    path = tmp_path_factory.mktemp("halves") / "sheet.step"
    write_step((half(0, MIDDLE), half(MIDDLE, WIDTH)), path)
    return load_nominal(path, element_size=3.0)


@pytest.fixture(scope="module")
def apart(halves):
    """Return what pictures of a step between the faces show, kept together and each by itself; and of none."""
    views, speckle = rig(), Speckle.drawn(np.random.default_rng(0), 0.7)
    found = []
    for deviation, splines in ((step, Splines()), (step, Splines(continuity=0.0)), (lambda x, y: 0 * x, Splines())):
        exact = [picture(view, speckle, deviation, plane, plane_normals) for view in views]
        found.append((measured(halves, views, exact, 0, splines), deviation))
    return found


def test_faces_border_on_each_other_where_edges_of_their_own_coincide(halves):
    assert all(len(faces) == 1 for faces in halves.exact.edge_faces)
    (border,) = borders(halves.exact, (1, 2), 2.0)
    assert set(border.faces) == {1, 2}
    np.testing.assert_allclose(border.points[:, 0], MIDDLE, atol=1e-9)
    np.testing.assert_allclose(border.along[0], -border.along[1], atol=1e-9)
    assert not borders(halves.exact, (1,), 2.0)


def test_faces_that_have_come_apart_are_told_with_a_true_uncertainty(apart):
    (together, deviation), (loose, _), (whole, _) = apart
    error, sigma = errors(together, deviation)
    noise = np.sqrt(replace(together.uncertainty, model=None).variances[together.sound])
    assert rms(error / noise) > 2 * rms(errors(loose, deviation)[0] / errors(loose, deviation)[1])
    assert rms(error / sigma) < 1.3
    assert together.uncertainty.model.parted
    assert together.unresolved[together.observed & (np.abs(together.mesh.nodes[:, 0] - MIDDLE) < 1.5)].all()
    assert not whole.uncertainty.model.parted
    assert whole.uncertainty.model.missed.mean() < 0.06


@pytest.fixture(scope="module")
def holed(tmp_path_factory):
    """Return an inspection of a sheet with holes, along normals and in all directions, and its folder."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    folder, views = tmp_path_factory.mktemp("holed"), rig()
    shape = BRepBuilderAPI_MakeFace(surface_of(NURBS), 1e-7).Face()
    for x, y, radius in HOLES:
        axis = gp_Ax2(gp_Pnt(x, y, -50.0), gp_Dir(0, 0, 1))
        shape = BRepAlgoAPI_Cut(shape, BRepPrimAPI_MakeCylinder(axis, radius, 100.0).Shape()).Shape()
    Part("sheet", lambda: shape).write_step(folder / "sheet.step")
    random = np.random.default_rng(0)
    for name, exact in zip(("left.png", "right.png"), photographs(views, within), strict=True):
        cv2.imwrite(str(folder / name), np.rint(photographed(random, exact, 2.4, 0.95, 4.0)).astype(np.uint8))
    lenses, places = tuple(view.camera for view in views), tuple(view.camera_from_cad for view in views)
    write_calibration_json(folder / "calibration.json", Rig(lenses, camera_from_cad=places))
    tables = [TABLE.format(name=directions, directions=directions) for directions in ("normal", "all")]
    (folder / "recipe.toml").write_text(RECIPE + "".join(tables), encoding="utf-8")
    return run(folder / "recipe.toml", folder / "out"), folder / "out"


@pytest.mark.parametrize("number", [0, 1], ids=["along normals", "in all directions"])
def test_a_sheet_with_holes_is_measured_and_its_surface_left_as_step(holed, number):
    record, out = holed
    part, mesh = record.parts[number], record.nominal.mesh
    seen = part.deviation.observed
    assert part.status is Status.OK
    for x, y, radius in HOLES:
        assert np.hypot(mesh.nodes[:, 0] - x, mesh.nodes[:, 1] - y).min() > 0.95 * radius
    assert seen.mean() > 0.7
    error = part.deviation.value[seen] - within(*mesh.nodes[seen, :2].T)
    assert np.median(np.abs(error)) < 0.002
    assert 0.75 < rms(error / part.deviation.sigma[seen]) < 1.25
    measured_face = nurbs_of(read_brep(out / f"{part.name}.step"), 1)
    places = mesh.nodes[seen] + part.deviation.value[seen, None] * mesh.normals[seen]
    feet = measured_face.points(measured_face.parameters(places))
    away = np.abs(((feet - places) * mesh.normals[seen]).sum(axis=1))
    assert (away < 5e-4 + 0.1 * part.deviation.sigma[seen]).all()


def test_control_points_that_move_in_all_directions_miss_no_more_than_those_along_normals(holed):
    normal, every = (part.unresolved[part.deviation.observed].mean() for part in holed[0].parts)
    assert every <= normal + 0.01
    assert every < 0.07
