"""Isogeometric stereocorrelation: control points of a NURBS face found from photographs of a speckled sheet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inspect3d.camera import View
from inspect3d.correlation.correlate import Correlate
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.correlation.linear import gauge_of
from inspect3d.correlation.space import EVERY_NODE
from inspect3d.correlation.splines import Splines
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nurbs import Nurbs
from inspect3d.nominal.nurbs_face import write_step
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from tests.sheets import DEPTH, WIDTH, sheet, wave
from tests.speckled import Speckle, photographed, picture, rig

SEEDS = 4
COUNT, DEGREE = 9, 3


def knots():
    """Return the clamped knots of the sheet in each direction, from 0 to 1."""
    return np.concatenate([np.zeros(DEGREE), np.linspace(0, 1, COUNT - DEGREE + 1), np.ones(DEGREE)])


def fitted_sheet():
    """Return the wavy sheet as a NURBS surface through its heights, x and y proportional to u and v."""
    flat = Nurbs(np.zeros((COUNT, COUNT, 3)), np.ones((COUNT, COUNT)), knots(), knots())
    u, v = flat.greville.T
    height = np.linalg.lstsq(flat.functions(flat.greville).toarray(), wave(WIDTH * u, DEPTH * v), rcond=None)[0]
    return replace(flat, poles=np.stack([WIDTH * u, DEPTH * v, height], axis=1).reshape(COUNT, COUNT, 3))


NURBS = fitted_sheet()
MOTIONS = np.random.default_rng(3).normal(0, 0.02, NURBS.size)


def at(x, y):
    """Return the parameters of places of the sheet."""
    return np.clip(np.stack([x / WIDTH, y / DEPTH], axis=1), 0, 1)


def height(x, y):
    """Return the height of the NURBS sheet, mm, on straight beyond its rim."""
    return NURBS.points(at(x, y))[:, 2]


def normals(x, y):
    """Return its unit normals."""
    return NURBS.normals(at(x, y))


def within(x, y):
    """Return a deviation in the space of the splines, mm: control points moved along their normals."""
    moved = NURBS.functions(at(x, y)) @ (MOTIONS[:, None] * NURBS.frames[:, 0])
    return (moved * normals(x, y)).sum(axis=1)


def step(x, y):
    """Return a deviation that no smooth spline follows: a step of 30 µm."""
    return np.where(x > 33.0, 0.03, 0.0)


def bump(x, y):
    """Return a bump too narrow for the splines, mm."""
    return 0.08 * np.exp(-((x - 33) ** 2 + (y - 22) ** 2) / 2 / 3.5**2)


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    """Return the sheet as a STEP file is read."""
    path = tmp_path_factory.mktemp("sheet") / "sheet.step"
    write_step((NURBS,), path)
    return load_nominal(path, element_size=3.0)


@pytest.fixture(scope="module")
def views():
    """Return two cameras."""
    return rig()


def photographs(views, deviation):
    """Return what the cameras see without noise."""
    speckle = Speckle.drawn(np.random.default_rng(0), 0.7)
    return [picture(view, speckle, deviation, height, normals) for view in views]


def measured(nominal, views, exact, seed, splines):
    """Return the shape that noisy photographs show, and its errors' function of the truth."""
    random = np.random.default_rng(seed)
    grey = [photographed(random, each, 2.4, random.uniform(0.8, 1.05), random.uniform(0, 8)) for each in exact]
    return Correlate(pixels=4.0, splines=splines)(nominal, grey, views)


def errors(shape, deviation):
    """Return the errors and sigmas of the sound nodes."""
    error = shape.values - deviation(*shape.scene.nodes[:, :2].T)
    return error[shape.sound], np.sqrt(shape.uncertainty.variances)[shape.sound]


def rms(values):
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.fixture(scope="module")
def series(nominal, views):
    """Return splines and every node by itself, over a few seeds, for a deviation in the space of the splines."""
    exact = photographs(views, within)
    return [[measured(nominal, views, exact, seed, splines) for seed in range(SEEDS)] for splines in (Splines(), None)]


def test_in_the_space_of_the_splines_sigma_is_true(series):
    z = np.concatenate([error / sigma for error, sigma in (errors(shape, within) for shape in series[0])])
    assert 0.9 < rms(z) < 1.1
    assert 0.93 < (np.abs(z) < 1.96).mean() < 0.97


def test_control_points_are_at_least_twice_as_quiet_as_nodes_by_themselves(series):
    splines, nodes = (rms(np.concatenate([errors(shape, within)[0] for shape in shapes])) for shapes in series)
    assert splines < nodes / 2


def test_the_surface_handed_over_is_the_surface_measured(series):
    shape = series[0][0]
    (surface,) = shape.scene.space.surfaces(shape.state.motion)
    nodes, along = shape.scene.nodes, shape.scene.normals
    feet = surface.points(surface.parameters(nodes + shape.values[:, None] * along))
    away = ((feet - nodes) * along).sum(axis=1)
    np.testing.assert_allclose(away, shape.values, atol=5e-4)


def test_in_the_space_of_the_splines_hardly_any_node_is_flagged(series):
    assert np.mean([shape.uncertainty.model.missed.mean() for shape in series[0]]) < 0.03
    assert not any(shape.uncertainty.model.parted for shape in series[0])
    assert series[1][0].unresolved is None


def believed(view, share, aside):
    """Return a view that shows the sheet in about the same place with a focal length and a centre that are wrong."""
    camera, pose = view.camera, view.camera_from_cad
    matrix = camera.matrix * np.array([[share, 1, 1], [1, share, 1], [1, 1, 1]]) + np.array(
        [[0, 0, aside]] + [[0.0] * 3] * 2
    )
    depth = pose.translation[2]
    place = pose.translation + np.array([-aside * depth / camera.matrix[0, 0], 0, (share - 1) * depth])
    return View(replace(camera, matrix=matrix), Pose(pose.rotation, place))


def test_beside_unknown_cameras_splines_settle_on_the_shape_but_for_what_nothing_tells(nominal, views):
    random = np.random.default_rng(3)
    off = believed(views[0], 0.93, 40.0), believed(views[1], 0.95, -40.0)
    freedom = Freedom("free", (Lens(0.05 * 2400, 20.0),) * 2, off, nominal.mesh.nodes.mean(axis=0))
    grey = [photographed(random, exact) for exact in photographs(views, within)]
    shape = Correlate(pixels=4.0, splines=Splines())(nominal, grey, off, freedom)
    assert shape.settled
    assert len(shape.state.steps) < 10
    weak = [motion.pattern for motion in shape.hidden if np.isfinite(motion.sigma)]
    modes = np.column_stack([gauge_of(shape.scene, freedom), *weak])
    inverse = np.linalg.pinv(modes)
    error = shape.values - within(*shape.scene.nodes[:, :2].T)
    sigma = np.sqrt(shape.uncertainty.variances_without(modes, inverse))
    assert rms((error - modes @ (inverse @ error)) / sigma) < 1.25


@pytest.fixture(scope="module")
def stepped(nominal, views):
    """Return splines and splines with halved knots over a step."""
    exact = photographs(views, step)
    return [measured(nominal, views, exact, 0, Splines(refine=refine)) for refine in (0, 1)]


def test_what_splines_cannot_follow_is_in_the_uncertainty(stepped):
    for shape in stepped:
        error, sigma = errors(shape, step)
        assert rms(error) > 0.002
        assert (np.abs(error) < 1.96 * sigma).mean() > 0.93
        assert rms(error / sigma) < 1.1


def test_nodes_beside_a_step_are_flagged_as_unresolved(stepped):
    for shape in stepped:
        beside = np.abs(shape.mesh.nodes[:, 0] - 33.0) < 1.5
        assert shape.unresolved[beside & shape.observed].mean() > 0.95
    away = np.abs(stepped[1].mesh.nodes[:, 0] - 33.0) > 25.0  # no control point there reaches the step
    assert stepped[1].unresolved[away].mean() < 0.1


def test_refined_splines_follow_a_bump_better(nominal, views):
    exact = photographs(views, bump)
    found = []
    for splines in (Splines(), Splines(refine=1)):
        shape = measured(nominal, views, exact, 0, splines)
        error, _ = errors(shape, bump)
        nodes = shape.scene.nodes[shape.sound]
        found.append(rms(error[np.hypot(nodes[:, 0] - 33, nodes[:, 1] - 22) < 9]))
    assert found[1] < 0.7 * found[0]


def test_a_model_of_meshes_only_is_refused():
    nominal = sheet()
    with pytest.raises(MeasurementError, match="give the STEP or IGES file"):
        Splines()(nominal, None)


def test_faces_that_are_not_there_and_meshes_too_coarse_are_refused(nominal, views, series):
    scene = replace(series[1][0].scene, space=EVERY_NODE)
    with pytest.raises(MeasurementError, match="no face 4: the model has faces 1 to 1"):
        Splines(faces=(4,))(nominal, scene)
    with pytest.raises(MeasurementError, match="too coarse for face 1"):
        Splines(faces=(1,), refine=3)(nominal, scene)
    with pytest.raises(MeasurementError, match="set element_size lower"):
        Splines(refine=3)(nominal, scene)
