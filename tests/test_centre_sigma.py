"""How well the centres of cameras are known against each other, against all unknowns in one dense matrix."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inspect3d.camera import Camera, View
from inspect3d.pose import Pose
from inspect3d.triangulation.centre_sigma import OFF_MIDDLE, centre_sigma, robust_variance
from inspect3d.triangulation.tie import TiePoints, loss_scale

VIEWS, POINTS = 4, 40


def tied(noise, scale=1.0):
    """Return tie points before four cameras, seen with noise (px)."""
    random = np.random.default_rng(1)
    points = random.uniform(-20, 20, (POINTS, 3))
    matrix = np.array([[1500.0, 0, 500], [0, 1500, 400], [0, 0, 1]])
    camera = Camera(matrix, np.array([-0.1, 0.1, 0, 0, 0]), (1000, 800))
    views = []
    for k in range(VIEWS):
        turn = Pose.small(np.array([0.2 * np.sin(2 * k), 0.3 * np.cos(2 * k), 0.1 * k, 0, 0, 0]), np.zeros(3))
        views.append(View(camera, Pose(np.eye(3), np.array([0.0, 0, 150 + 5 * k])) @ turn))
    view, point = np.repeat(np.arange(VIEWS), POINTS), np.tile(np.arange(POINTS), VIEWS)
    pixels = np.concatenate([each.project(points) for each in views]) + random.normal(0, noise, (VIEWS * POINTS, 2))
    moved = [
        replace(v, camera_from_cad=Pose(v.camera_from_cad.rotation, scale * v.camera_from_cad.translation))
        for v in views
    ]
    return TiePoints(tuple(moved), scale * points, point, view, pixels, noise)


def changed(ties, x, size):
    """Return views and points after changes of all unknowns: pose and lens of each camera, the points."""
    views = []
    for k, view in enumerate(ties.views):
        own = x[k * size : (k + 1) * size]
        matrix, distortion = view.camera.matrix.copy(), view.camera.distortion.copy()
        if size == 9:
            matrix[[0, 1], [0, 1]] += own[6]
            distortion[:2] += own[7:]
        moved = view.camera_from_cad @ Pose.small(own[:6], np.array([1.0, 2.0, 3.0]))
        views.append(View(replace(view.camera, matrix=matrix, distortion=distortion), moved))
    return views, ties.points + x[VIEWS * size :].reshape(-1, 3)


def shifts(ties, systematic, middle):
    """Return the shifts of each picture: all pixels' coordinates in a row, (n, 6 v).

    They are constant and linear in its pixels, the constant one also for the middle of the lens (px).
    """
    columns = []
    for k in range(VIEWS):
        here = ties.view == k
        away = ties.pixels[here] - ties.pixels[here].mean(axis=0)
        whole = np.full(POINTS, np.hypot(systematic / np.sqrt(3), middle))
        for form in (whole, *(systematic / np.sqrt(3) * away / away.std(axis=0)).T):
            for axis in range(2):
                column = np.zeros(ties.pixels.shape)
                column[here, axis] = form
                columns.append(column.ravel())
    return np.stack(columns, axis=1)


@pytest.mark.parametrize(("free", "shift"), [(False, 0.0), (True, 0.0), (False, 0.1), (True, 0.1)])
def test_centres_are_known_as_the_inverse_of_the_whole_normal_matrix_says(free, shift):
    ties, size = tied(0.2), 9 if free else 6
    steps = np.concatenate(
        [np.tile([1e-5] * 3 + [1e-3] * 3 + ([1e-1, 1e-4, 1e-4] if free else []), VIEWS), [1e-3] * 3 * POINTS]
    )

    def pixels(x):
        views, points = changed(ties, x, size)
        return np.concatenate([view.project(points) for view in views]).ravel()

    def centres(x):
        return np.concatenate([view.centre for view in changed(ties, x, size)[0]])

    both = [(pixels(e) - pixels(-e), centres(e) - centres(-e)) for e in np.diag(steps)]
    slopes, moves = (np.stack(columns, axis=1) / 2 for columns in zip(*both, strict=True))
    misses = ties.pixels.ravel() - pixels(np.zeros(len(steps)))
    noise = robust_variance(misses.reshape(-1, 2)) * len(misses) / (len(misses) - len(steps) + 7)
    inverse = moves @ np.linalg.pinv(slopes.T @ slopes, 1e-14, hermitian=True)
    by_shifts = inverse @ slopes.T @ shifts(ties, shift, free * OFF_MIDDLE * 1000)
    covariance = noise * inverse @ moves.T + by_shifts @ by_shifts.T
    away = np.array([view.centre for view in ties.views])
    away -= away.mean(axis=0)
    together = [np.cross(axis, away).ravel() for axis in np.eye(3)] + [np.tile(axis, VIEWS) for axis in np.eye(3)]
    basis = np.linalg.qr(np.stack([*together, away.ravel()], axis=1))[0]
    rest = np.eye(3 * VIEWS) - basis @ basis.T
    expected = np.sqrt(np.diag(rest @ covariance @ rest).reshape(-1, 3).mean(axis=1))
    assert centre_sigma(ties, free, shift) == pytest.approx(expected, rel=1e-3)


def test_the_uncertainty_grows_with_the_unit_and_cameras_that_were_not_placed_have_none():
    one, ten = tied(0.2), tied(0.2, 10.0)
    assert centre_sigma(ten, True, 0.01) == pytest.approx(10 * centre_sigma(one, True, 0.01), rel=1e-4)
    fewer = replace(one, views=(*one.views[:3], None))
    kept = fewer.view < 3
    fewer = replace(fewer, point=one.point[kept], view=one.view[kept], pixels=one.pixels[kept])
    assert np.isnan(centre_sigma(fewer, False, 0.01)).tolist() == [False, False, False, True]


def test_the_robust_variance_is_how_much_a_mean_with_those_weights_scatters():
    """Of normal errors with one in fifty ten times as large; means of 100, found by reweighting."""
    random = np.random.default_rng(2)
    errors = random.normal(0, 0.1, (2000, 100, 2)) * np.where(random.random((2000, 100, 1)) < 0.02, 10, 1)
    scale = loss_scale(errors.reshape(-1, 2))
    means = np.zeros((2000, 1, 2))
    for _ in range(20):
        weights = 1 / (1 + ((errors - means) ** 2).sum(axis=2, keepdims=True) / scale**2)
        means = (weights * errors).sum(axis=1, keepdims=True) / weights.sum(axis=1, keepdims=True)
    assert robust_variance(errors.reshape(-1, 2)) == pytest.approx(100 * np.mean(means**2), rel=0.08)
    assert robust_variance(errors.reshape(-1, 2)) < 0.5 * np.mean(errors**2)
