"""Picked points place the cameras, or are refused with the reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inspect3d.camera import Camera, View
from inspect3d.correlation.freedom import Freedom, Lens, Stand
from inspect3d.correlation.picks import Picks, ideal_camera, placed_by_picks, view_from_dlt
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from tests.sheets import wave
from tests.speckled import rig

EXACT = Lens()
X, Y = np.array([2.0, 55.0, 50.0, 5.0, 30.0, 18.0, 41.0]), np.array([3.0, 5.0, 40.0, 38.0, 20.0, 30.0, 12.0])
POINTS = np.stack([X, Y, wave(X, Y)], axis=1)
FLAT = np.stack([X, Y, 0 * X], axis=1)
XX, YY = (a.ravel() for a in np.meshgrid(np.arange(0.0, 60, 5), np.arange(0.0, 45, 5)))
NODES = np.stack([XX, YY, wave(XX, YY)], axis=1)


def seen(views, points=POINTS):
    """Return the points as they are seen, picked without error."""
    return Picks(points, np.stack([view.project(points) for view in views], axis=1))


def free(views, lens=EXACT):
    """Return cameras whose places are unknown."""
    return Freedom("free", (lens,) * len(views), views, POINTS.mean(axis=0))


def cameras(views):
    """Return the lenses of views."""
    return [view.camera for view in views]


@pytest.mark.parametrize("points", [POINTS, POINTS[:4], FLAT, FLAT[:4]])
def test_exact_picks_give_exact_places(points):
    views = rig(distortion=(-0.1, 0.1, 1e-4, 1e-4, 0))
    placed = placed_by_picks(seen(views, points), (), cameras(views), free(views))
    for view, found in zip(views, placed.views, strict=True):
        assert np.abs(view.project(NODES) - found.project(NODES)).max() < 1e-3
    assert placed.errors.max() < 1e-4


def test_unsteady_picks_and_a_rough_focal_length_leave_a_few_pixels():
    views = rig()
    random = np.random.default_rng(3)
    rough = tuple(replace(view, camera=ideal_camera(1.03 * 2400, view.camera.size)) for view in views)
    worst = []
    for _ in range(10):
        picks = seen(views)
        picks = Picks(picks.points_cad, picks.pixels + random.normal(0, 1.5, picks.pixels.shape))
        placed = placed_by_picks(picks, (), cameras(rough), free(rough, Lens(120.0)))
        errors = [found.project(NODES) - view.project(NODES) for view, found in zip(views, placed.views, strict=True)]
        worst.append(np.sqrt(np.mean(np.square(errors)) * 2))
    assert np.median(worst) < 3.0


def test_a_known_rig_is_placed_as_one():
    views = rig()
    moved = Pose.small(np.array([0.3, -0.2, 0.5, 40, -20, 30.0]), np.zeros(3))
    there = tuple(replace(view, camera_from_cad=view.camera_from_cad @ moved) for view in views)
    freedom = Freedom("common", (Lens(),) * 2, views, POINTS.mean(axis=0))
    placed = placed_by_picks(seen(there), views, cameras(views), freedom)
    for view, found in zip(there, placed.views, strict=True):
        np.testing.assert_allclose(found.camera_from_cad.matrix, view.camera_from_cad.matrix, atol=1e-6)


def test_a_stand_gives_way_within_its_uncertainty_only():
    views = rig()
    moved = replace(
        views[1], camera_from_cad=Pose.small(np.array([0, 1e-3, 0, 0, 0, 0]), np.zeros(3)) @ views[1].camera_from_cad
    )
    found = {}
    for turn in (1e-6, 1e-2):
        freedom = Freedom("common", (Lens(),) * 2, views, POINTS.mean(axis=0), (Stand(turn, 1000 * turn),) * 2)
        found[turn] = placed_by_picks(seen((views[0], moved)), views, cameras(views), freedom)
    assert found[1e-6].errors.max() > 0.3
    assert found[1e-2].errors.max() < 0.1 * found[1e-6].errors.max()


def test_picks_in_the_wrong_order_are_refused():
    views = rig()
    picks = seen(views)
    with pytest.raises(MeasurementError, match=r"landmarks do not fit.*order|No place of the camera"):
        placed_by_picks(Picks(POINTS, picks.pixels[::-1]), (), cameras(views), free(views))


@pytest.mark.parametrize(
    ("points", "says"), [(POINTS[:3], "4 or more"), (np.linspace([0, 0, 0], [9, 9, 9], 6), "one line")]
)
def test_too_few_picks_and_picks_on_a_line_are_refused(points, says):
    views = rig()
    with pytest.raises(MeasurementError, match=says):
        placed_by_picks(seen(views, points), (), cameras(views), free(views))


def test_picks_that_were_all_made_at_one_place_are_refused():
    views = rig()
    there = np.full((len(POINTS), 2), 100.0)
    picks = Picks(POINTS, np.stack([views[0].project(POINTS), there], axis=1))
    with pytest.raises(MeasurementError, match="all picked at one place"):
        placed_by_picks(picks, (), cameras(views), free(views))
    with pytest.raises(MeasurementError, match="all picked at one place"):
        view_from_dlt(POINTS, there, (620, 480), NODES)


def test_six_deep_picks_give_the_projection_matrix():
    camera = Camera(np.array([[900, 0, 500], [0, 905, 400], [0, 0, 1.0]]), np.zeros(5), (1000, 800))
    view = View(camera, Pose(np.eye(3), np.array([-30.0, -20.0, 120.0])))
    deep = POINTS + np.array([0, 0, 1.0]) * np.array([0, 30, -20, 10, 40, -35, 5.0])[:, None]
    found = view_from_dlt(deep, view.project(deep), camera.size, deep)
    np.testing.assert_allclose(found.camera.matrix, camera.matrix, atol=1e-4)
    np.testing.assert_allclose(found.camera_from_cad.matrix, view.camera_from_cad.matrix, atol=1e-6)


def test_picks_on_a_nearly_flat_part_do_not_determine_a_projection_matrix():
    view = rig()[0]
    shallow = POINTS * [1, 1, 0.05]
    with pytest.raises(MeasurementError, match="do not determine a projection matrix"):
        view_from_dlt(shallow, view.project(shallow), view.camera.size, NODES)
    with pytest.raises(MeasurementError, match="takes 6 picks"):
        view_from_dlt(POINTS[:5], view.project(POINTS[:5]), view.camera.size, NODES)
