"""The uncertainty that stereocorrelation states is the scatter of its errors: the short form of the benchmark."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from scipy.stats import chi2

from inspect3d.camera import View
from inspect3d.correlation.correlate import Correlate
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.correlation.linear import gauge_of
from inspect3d.correlation.systematic import Systematic
from inspect3d.pose import Pose
from inspect3d.virtual.warp import Warp
from tests.sheets import sheet
from tests.speckled import Speckle, photographed, picture, rig

SEEDS = 6
LENS = Lens(focal=48.0, centre=4.0)


def bump(x, y):
    """Return a deviation in the middle of the sheet, mm."""
    return 0.03 * np.exp(-((x - 25) ** 2 + (y - 20) ** 2) / 2 / 8**2)


@pytest.fixture(scope="module")
def nominal():
    """Return the wavy sheet with elements of 3 mm."""
    return sheet(edge=3.0)


@pytest.fixture(scope="module")
def exact():
    """Return two cameras and what they would see without noise."""
    views, speckle = rig(), Speckle.drawn(np.random.default_rng(0), 0.7)
    return views, [picture(view, speckle, bump) for view in views]


def photographs(exact, random):
    """Return pictures of 1 % noise and different gain and offset."""
    return [photographed(random, e, 2.4, random.uniform(0.8, 1.05), random.uniform(0, 8)) for e in exact[1]]


def believed(view, random, lens=LENS):
    """Return a view whose lens is drawn from what is known of it, and the pose that makes up for it best."""
    matrix = view.camera.matrix.copy()
    focal, centre = random.normal(0, lens.focal), random.normal(0, lens.centre, 2)
    away = view.depth(np.array([[30.0, 22.5, 0.0]]))[0]
    shift = np.array([*(-centre / matrix[0, 0] * away), focal / matrix[0, 0] * away])
    matrix[[0, 1], [0, 1]] += focal
    matrix[:2, 2] += centre
    pose = Pose(np.eye(3), shift) @ view.camera_from_cad
    return View(replace(view.camera, matrix=matrix), pose)


def shifted(grey, warp):
    """Return a picture that shows at p what it has at p + w(p)."""
    rows, columns = (np.arange(size, dtype=float) for size in grey.shape)
    dx, dy = np.moveaxis(warp(columns, rows), -1, 0)
    return map_coordinates(grey, [rows[:, None] + dy, columns + dx], order=3, mode="nearest")


def without(shape, error, modes):
    """Return an error and its sigma once modes are out of both, (2, n)."""
    inverse = np.zeros(modes.T.shape)
    inverse[:, shape.sound] = np.linalg.pinv(modes[shape.sound])
    sigma = np.sqrt(shape.uncertainty.variances_without(modes, inverse))
    return np.stack([error - modes @ (inverse @ error), sigma])[:, shape.sound]


def rms(values):
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def test_with_known_cameras_scatter_over_the_seeds_is_what_was_claimed(nominal, exact):
    ratios, sound = [], True
    for seed in range(SEEDS):
        shape = Correlate(pixels=4.0)(nominal, photographs(exact, np.random.default_rng(seed)), exact[0])
        error = shape.values - bump(*shape.scene.nodes[:, :2].T)
        ratios.append(error / np.sqrt(shape.uncertainty.variances))
        sound = sound & shape.sound
    assert sound.mean() > 0.97
    z = np.array(ratios)[:, sound]
    assert 0.9 < rms(z) < 1.1
    assert 0.93 < (np.abs(z) < 1.96).mean() < 0.97
    low, high = np.percentile(np.sqrt((z**2).mean(axis=0)), [5, 95])
    spread = np.sqrt(chi2.ppf([0.05, 0.95], SEEDS) / SEEDS)
    assert low == pytest.approx(spread[0], abs=0.15)
    assert high == pytest.approx(spread[1], abs=0.15)


def test_a_step_widens_the_claim_beside_it_and_nowhere_else(nominal):
    edge, views = 26.0, rig()
    speckle = Speckle.drawn(np.random.default_rng(0), 0.7)

    def step(x, y):
        return 0.1 * (np.asarray(x) > edge)

    exact = views, [picture(view, speckle, step) for view in views]
    shape = Correlate(pixels=4.0)(nominal, photographs(exact, np.random.default_rng(1)), views)
    x, y = shape.scene.nodes[:, :2].T
    sigma = np.sqrt(shape.uncertainty.variances)
    z = (shape.values - step(x, y)) / sigma
    beside = shape.sound & (np.abs(x - edge) < 3.0)
    away = shape.sound & (np.abs(x - edge) > 6.0)
    assert shape.uncertainty.correlated < 1.5
    assert 0.85 < rms(z[away]) < 1.15
    assert np.median(sigma[beside]) > 3 * np.median(sigma[away])
    assert rms(z[beside]) < 2.0


def test_self_calibrated_the_rest_and_the_weak_motions_are_as_large_as_claimed(nominal, exact):
    z, distance, modes = [], 0.0, 0
    for seed in range(SEEDS):
        random = np.random.default_rng(100 + seed)
        views = tuple(believed(view, random) for view in exact[0])
        free = Freedom("free", (LENS,) * 2, views, nominal.mesh.nodes.mean(axis=0))
        shape = Correlate(pixels=4.0)(nominal, photographs(exact, random), views, free)
        assert shape.settled
        assert len(shape.state.steps) <= 15
        error = shape.values - bump(*shape.scene.nodes[:, :2].T)
        gauge = gauge_of(shape.scene, free)
        weak = np.stack([motion.pattern for motion in shape.hidden if np.isfinite(motion.sigma)], axis=1)
        rest, sigma = without(shape, error, np.column_stack([gauge, weak]))
        z.append(rest / sigma)
        fields = weak / len(weak)
        sizes = fields.T @ (error - gauge @ (gauge.T @ error))
        distance += sizes @ np.linalg.solve(fields.T @ shape.uncertainty.covariance(fields), sizes)
        modes += weak.shape[1]
    together = np.concatenate(z)
    assert 0.9 < rms(together) < 1.1
    assert 0.93 < (np.abs(together) < 1.96).mean() < 0.97
    assert chi2.ppf(0.001, modes) < distance < chi2.ppf(0.99, modes)


def test_a_shift_that_is_stated_is_in_the_claim_beside_lenses_that_are_hardly_known(nominal, exact):
    vague, stated, ratios = Lens(focal=200.0, centre=20.0), Systematic(0.04, 15.0), []
    for seed in range(SEEDS):
        random = np.random.default_rng(200 + seed)
        views = tuple(believed(view, random, vague) for view in exact[0])
        free = Freedom("free", (vague,) * 2, views, nominal.mesh.nodes.mean(axis=0))
        grey = [shifted(g, Warp(stated.size, 150.0, 10 * seed + k)) for k, g in enumerate(photographs(exact, random))]
        for systematic in (None, stated):
            shape = Correlate(pixels=4.0, systematic=systematic)(nominal, grey, views, free)
            weak = [motion.pattern for motion in shape.hidden if np.isfinite(motion.sigma)]
            modes = np.column_stack([gauge_of(shape.scene, free), *weak])
            rest, sigma = without(shape, shape.values - bump(*shape.scene.nodes[:, :2].T), modes)
            ratios.append(rms(rest / sigma))
    assert rms(ratios[::2]) > 1.5
    assert 0.7 < rms(ratios[1::2]) < 1.3


def test_a_smoothed_map_is_quieter_and_its_claim_counts_what_was_taken_off(nominal, exact):
    errors, ratios = [], []
    for seed in range(3):
        grey = photographs(exact, np.random.default_rng(seed))
        plain, smooth = (Correlate(pixels=4.0, smoothing=k)(nominal, grey, exact[0]) for k in (0.0, 0.1))
        truth, sound = bump(*smooth.scene.nodes[:, :2].T), smooth.sound
        assert np.array_equal(plain.state.motion, smooth.state.motion)
        errors.append([rms((shape.values - truth)[sound]) for shape in (plain, smooth)])
        ratios.append(((smooth.values - truth) / np.sqrt(smooth.uncertainty.variances))[sound])
    without_plate, with_plate = np.mean(errors, axis=0)
    assert with_plate < 0.9 * without_plate
    z = np.concatenate(ratios)
    assert 0.85 < rms(z) < 1.1
    assert (np.abs(z) < 1.96).mean() > 0.93


def test_the_claim_of_a_smoothed_map_is_the_diagonal_of_its_covariance(nominal, exact):
    views, grey = exact[0], photographs(exact, np.random.default_rng(0))
    freedom = Freedom("free", (LENS, LENS), views, nominal.mesh.nodes.mean(axis=0))
    shape = Correlate(pixels=4.0, smoothing=0.1)(nominal, grey, views, freedom)
    diagonal = np.diag(shape.uncertainty.covariance(np.eye(len(shape.scene.nodes))))
    assert shape.uncertainty.variances == pytest.approx(diagonal, rel=1e-5)
