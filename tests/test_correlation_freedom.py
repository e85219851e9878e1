"""What cameras and shape can do without a change in the pictures: slides, gauges, hidden motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from inspect3d.arrays import unit
from inspect3d.camera import View
from inspect3d.correlation import solver
from inspect3d.correlation.bounded_step import bounded, bounded_step, reach
from inspect3d.correlation.dense import DenseFactor, cholesky
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.correlation.hidden import hidden_motions
from inspect3d.correlation.linear import gauge_of, motions_of, moving_cameras, slides_of, system_of
from inspect3d.correlation.normal import facets
from inspect3d.correlation.picture import Pictures
from inspect3d.correlation.seen import scene
from inspect3d.correlation.state import State
from inspect3d.correlation.still import SOFT, in_gauge, left_open, slid, still_in_pictures, stilled
from inspect3d.correlation.system import System
from inspect3d.correlation.systematic import Systematic
from inspect3d.pose import Pose
from inspect3d.register.gauge import FREE
from tests.seen_sheets import ALL, STEEPEST, accumulated, flat_sheet, wavy_sheet
from tests.sheets import plane, plane_normals, sheet
from tests.speckled import Speckle, picture, rig

NOISE = 2.4  # grey levels


@pytest.fixture(scope="module")
def flat():
    return flat_sheet()


@pytest.fixture(scope="module")
def wavy():
    return wavy_sheet()


def test_the_pictures_resist_turns_about_the_origin_of_the_freedom_wherever_that_is(wavy):
    _, views, seen, stack = wavy
    origin = seen.centre + np.array([20.0, -30.0, 40.0])  # a part of which one corner is seen
    freedom = Freedom("free", (Lens(),) * 2, tuple(views), origin)
    mixing, _ = freedom.spread(freedom.columns)
    flat, even = np.zeros(len(seen.nodes)), np.ones(len(seen.triangles))
    off = freedom.moved(views, 0.3 * freedom.scale(views, seen.sample) * np.array([0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0]))
    found = facets(seen, stack, off, flat, even, freedom.columns, power=0, origin=origin)
    weights = found.energy / (1 - found.correlation)
    for step in np.diag(0.01 * freedom.scale(views, seen.sample)):
        here = [freedom.moved(off, k * step) for k in (1, -1)]
        ahead, back = (
            weights @ (1 - accumulated(seen, stack, each, columns=freedom.columns).correlation) for each in here
        )
        assert -(mixing.T @ found.camera_right) @ step == pytest.approx((ahead - back) / 4, rel=0.05, abs=1.0)


def test_two_free_projection_matrices_hide_fifteen_motions_that_priors_name():
    views, lowest = rig(), []
    speckle = Speckle.drawn(np.random.default_rng(0), 0.7)
    stack = Pictures([picture(view, speckle) for view in views]).blurred(0.0)
    unknown = Lens(np.inf, np.inf, aspect=np.inf, skew=np.inf)
    for edge in (3.0, 1.5):
        seen = scene(sheet(edge=edge), views, 4.0, STEEPEST, [None, None])
        system = camera_system(seen, stack, views, Freedom("free", (unknown,) * 2, views, seen.centre))
        assert system.gauge.shape[1] == 7
        units = system.scale * system.scale[:, None]
        lowest.append(np.linalg.eigvalsh(system.reduced * units) / np.linalg.eigvalsh(system.camera * units)[-1])
    falls = lowest[0][:9] / lowest[1][:9]
    assert (falls[:8] > 2**3).all()  # what stiffness these eight have, the elements give them: it falls as edge⁴
    assert falls[8] < 2
    lens = Lens(30.0, 10.0, aspect=3.0, skew=3.0)
    free = Freedom("free", (lens,) * 2, views, seen.centre)
    system = camera_system(seen, stack, views, free)
    assert len(system.unseen) == 0
    told = sum(motion.prior for motion in hidden_motions(seen, system, free, 0.0))
    assert told > 7.5  # of eight; the elements say a little about the last


def test_what_weak_priors_alone_tell_is_not_held_beside_a_stiff_one(wavy):
    _, views, seen, stack = wavy
    found = []
    for bent in (0.0, 1e-4):
        lens = Lens(120.0, 15.0, (0.0, bent, 0.0, 0.0, 0.0))
        system = camera_system(seen, stack, views, Freedom("free", (lens,) * 2, views, seen.centre))
        assert len(system.unseen) == 0
        found.append(np.sqrt(np.diag(system.camera_covariance))[[12, 13, 14]])
    assert found[1] == pytest.approx(found[0], rel=1e-3)


def photographed_wave(views):
    """Return the pictures of the sheet without noise."""
    speckle = Speckle.drawn(np.random.default_rng(0), 0.7)
    return Pictures([picture(view, speckle) for view in views])


def test_a_step_that_is_taken_back_is_told_of_with_its_shift(wavy, monkeypatch):
    monkeypatch.setattr(solver, "WORSE", 0.0)
    _, views, seen, _ = wavy
    free = Freedom("free", (Lens(30.0, 10.0),) * 2, tuple(views), seen.centre)
    solve = solver.Solver((solver.Level(0, 0, 3),), systematic=Systematic(0.02, 15.0))
    state = solve(seen, photographed_wave(views), views, free)
    assert len(state.steps) == 1
    assert state.shift.any()


def test_slides_that_are_held_stay_where_they_started(wavy):
    _, views, seen, _ = wavy
    free = Freedom("free", (Lens(),) * 2, tuple(views), seen.centre)
    _, values, right = motions_of(seen, free)
    soft = moving_cameras(seen, free, views, right[values**2 <= SOFT * values[0] ** 2])
    assert soft.shape[1] > 0
    off = free.moved(views, 0.5 * soft[:, 0])
    level, pictures = solver.Level(3, 0, 8, "poses"), photographed_wave(views)
    back, stays = (solver.Solver((level,), slides=share)(seen, pictures, off, free).views for share in (FREE, SOFT))
    assert slid(seen, views, back) < 0.3 * slid(seen, views, off)
    assert slid(seen, off, stays) < 0.1 * slid(seen, views, off)


@pytest.mark.parametrize("seed", range(3))
def test_poses_come_home_without_a_slide_in_the_mean_of_the_pictures(wavy, seed):
    _, views, seen, _ = wavy
    free = Freedom("free", (Lens(),) * 2, tuple(views), seen.centre)
    _, values, right = motions_of(seen, free)
    soft = moving_cameras(seen, free, views, right[values**2 <= SOFT * values[0] ** 2])
    away = 0.5 * free.scale(views, seen.sample) * np.random.default_rng(seed).normal(size=free.unknowns)
    off = free.moved(views, away)
    level = solver.Level(3, 0, 8, "poses")
    found = solver.Solver((level,), slides=SOFT)(seen, photographed_wave(views), off, free).views
    start = mean_place(off, seen.sample)
    ways = np.stack([mean_place(free.moved(off, 1e-3 * way), seen.sample) - start for way in soft.T], axis=1)
    moved = mean_place(found, seen.sample) - start
    slid_by = ways @ np.linalg.lstsq(ways, moved, rcond=None)[0]
    assert np.linalg.norm(slid_by) < 0.15 * np.linalg.norm(moved)


def test_a_stilled_step_slides_no_more_than_it_must_and_shows_the_same_disparities(wavy):
    _, views, seen, _ = wavy
    free = Freedom("free", (Lens(30.0, 10.0),) * 2, views, seen.centre)
    random = np.random.default_rng(0)
    cameras = 0.1 * free.scale(views, seen.nodes) * random.normal(size=free.unknowns)
    shape = random.normal(0.0, 1e-3, len(seen.nodes))
    plain = slides(seen, views, free.moved(views, cameras), shape)
    shape, cameras = stilled(seen, free, views, np.zeros(len(seen.nodes)), shape, cameras)
    still = slides(seen, views, free.moved(views, cameras), shape)
    assert plain[0] - plain[1] == pytest.approx(still[0] - still[1], abs=2e-2 * np.abs(plain[0] - plain[1]).max())
    assert np.abs(still.mean(axis=(0, 1))).max() < 0.02 * np.abs(plain.mean(axis=(0, 1))).max()


def test_a_step_that_keeps_the_surface_still_shows_the_same_disparities_as_one_that_lets_it_slide(wavy):
    _, views, seen, stack = wavy
    free = Freedom("free", (Lens(30.0, 10.0),) * 2, views, seen.centre)
    still = still_in_pictures(seen, free, views)
    off = free.moved(views, 0.1 * free.scale(views, seen.nodes) * np.random.default_rng(0).normal(size=free.unknowns))
    pictured = accumulated(seen, stack, off, columns=free.columns)
    right = seen.space.gathered(seen, pictured.right) / NOISE**2
    pull = free.spread(free.columns)[0].T @ pictured.camera_right / NOISE**2
    found = []
    for held in (None, still):
        shape, cameras = camera_system(seen, stack, off, free, held).solve(right, pull)
        found.append(slides(seen, off, free.moved(off, 0.1 * cameras), 0.1 * shape))
    assert np.abs(still.across.T @ cameras).max() < 1e-6 * np.abs(still.across.T * cameras).max()
    apart = [each[0] - each[1] for each in found]
    assert apart[1] == pytest.approx(apart[0], abs=1e-2 * np.abs(apart[0]).max())


@pytest.mark.parametrize("slide", [-0.2, 0.2])
def test_shape_and_cameras_are_found_with_the_surface_where_it_started_along_itself(wavy, slide):
    _, views, seen, _ = wavy
    free = Freedom("free", (Lens(30.0, 10.0),) * 2, views, seen.centre)
    aside = free.moved(views, slide * moving_cameras(seen, free, views, motions_of(seen, free)[2])[:, -1])
    state = solver.Solver((solver.Level(0, 0, 20),))(seen, photographed_wave(views), aside, free)
    assert state.settled
    assert slid(seen, views, aside) > 1.0
    assert slid(seen, aside, state.views) < 0.2


def test_a_bounded_step_moves_the_pictures_apart_by_the_bound_and_slides_as_it_likes(wavy):
    _, views, seen, _ = wavy
    free = Freedom("free", (Lens(),) * 2, views, seen.centre)
    flat, still = np.zeros(len(seen.nodes)), np.zeros(free.unknowns)
    state = State(flat, flat, tuple(views), np.ones(len(seen.triangles)))

    def apart(lift):
        moved = np.stack([view.project(seen.nodes + lift[:, None] * seen.normals) for view in views])
        moved -= [view.project(seen.nodes) for view in views]
        return np.sqrt(((moved - moved.mean(axis=0)) ** 2).sum(axis=2).mean(axis=0))

    slide = 5.0 * moving_cameras(seen, free, views, np.eye(7)[3:4])[:, 0]
    assert slid(seen, views, free.moved(views, slide)) > 20
    assert bounded(seen, state, free, flat, slide, 5.0)[1] == pytest.approx(slide)
    lifted, _ = bounded(seen, state, free, flat + 0.5, still, 0.3)
    assert np.sqrt((apart(lifted) ** 2).mean()) == pytest.approx(0.3, rel=1e-2)
    assert bounded(seen, state, free, flat + 1e-3, still, 0.3)[0] == pytest.approx(flat + 1e-3)
    lone = flat + 1e-3
    lone[7] = 1.0
    lifted, _ = bounded(seen, state, free, lone, still, 0.3)
    assert apart(lifted)[7] == pytest.approx(0.6, rel=1e-2)
    assert np.delete(lifted, 7) == pytest.approx(np.delete(lone, 7))


def narrow(seen):
    """Return a strip of a sheet."""
    middles = seen.nodes[seen.triangles].mean(axis=1)
    return seen.restricted(np.abs(middles[:, 1] - seen.centre[1]) < 0.1 * np.ptp(seen.nodes[:, 1]))[0]


def test_a_step_of_the_poses_goes_round_the_part_by_no_more_than_a_tenth_of_its_extent(wavy):
    _, views, seen, _ = wavy
    free = Freedom("free", (Lens(),) * 2, tuple(views), seen.centre)
    scale, right = free.scale(views, seen.sample), np.random.default_rng(0).normal(size=free.unknowns)
    for far in (1e3, 1e6):
        step = bounded_step(seen, views, free, np.diag(scale), np.eye(len(scale)), far * right / scale, 1e9)
        assert 0.04 * seen.extent < reach(seen, step, free) <= 0.1 * seen.extent


def test_a_tilt_of_a_narrow_plane_is_not_taken_for_a_slide(flat):
    _, views, seen = flat
    strip = narrow(seen)
    still = still_in_pictures(strip, Freedom("free", (Lens(),) * 2, views, strip.centre), views)
    assert still.slides.shape[1] == 4  # two shifts, a turn, growth
    assert still.gauge.shape[1] == 3


def test_to_keep_a_narrow_plane_still_nothing_tilts_it(flat):
    _, views, seen = flat
    strip = narrow(seen)
    free = Freedom("free", (Lens(),) * 2, views, strip.centre)
    _, values, _ = motions_of(strip, free)
    assert np.count_nonzero(values**2 <= SOFT * values[0] ** 2) == 5  # two shifts, a turn, growth, and a tilt
    random = np.random.default_rng(0)
    cameras = 0.1 * free.scale(views, strip.nodes) * random.normal(size=free.unknowns)
    shape, after = stilled(
        strip, free, views, random.normal(0, 0.02, len(strip.nodes)), np.zeros(len(strip.nodes)), cameras
    )
    assert np.abs(shape).max() < 0.1
    assert slid(strip, views, free.moved(views, after)) < 1.2 * slid(strip, views, free.moved(views, cameras))


def test_cameras_beside_slides_move_across_none_of_what_holds_them():
    random = np.random.default_rng(0)
    root = random.normal(size=(14, 14))
    matrix = root @ root.T + np.eye(14)
    slides, across = random.normal(size=(2, 6, 2))
    system = System(
        DenseFactor(cholesky(matrix[:8, :8])), matrix[:8, 8:], matrix[8:, 8:], np.zeros((8, 0)),
        np.ones(6), np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), slides, across, np.zeros((6, 0)),
    )  # fmt: skip
    right = random.normal(size=14)
    shape, cameras = system.solve(right[:8], right[8:])
    assert across.T @ cameras == pytest.approx(np.zeros(2), abs=1e-12)
    assert (matrix @ np.append(shape, cameras) - right)[:8] == pytest.approx(np.zeros(8), abs=1e-9)
    pulled = right[8:] - matrix[8:] @ np.append(shape, cameras) - cameras
    assert across @ np.linalg.lstsq(across, pulled)[0] == pytest.approx(pulled, abs=1e-9)


def test_a_start_that_is_off_by_a_pixel_leaves_open_what_that_makes_of_a_nearly_flat_sheet(flat):
    _, views, seen = flat
    free = Freedom("free", (Lens(),) * 2, views, seen.centre)
    assert np.abs(left_open(seen, free, views)).max() < 1e-9
    x, y = ((seen.nodes - seen.centre) / seen.extent).T[:2]
    slopes = 0.05 * np.column_stack([x**2 + 2 * x * y, y**3 - x**2, np.zeros(len(x))])
    wavy = replace(seen, normals=unit(seen.normals + slopes))
    _, values, right = motions_of(wavy, free)
    held = values**2 <= FREE * values[0] ** 2
    left = left_open(wavy, free, views)
    assert held.any()
    for motion, field in zip(right[held], left.T, strict=True):
        places = wavy.nodes - wavy.centre
        moved = np.cross(motion[:3], places) + motion[3:6] + motion[6] * places
        one = moved * (np.abs(field).max() / np.abs((moved * wavy.normals).sum(axis=1)).max())
        assert np.abs((one * wavy.normals).sum(axis=1)) == pytest.approx(np.abs(field), abs=1e-9)
        pixels = np.mean([view.project(wavy.nodes + 1e-3 * one) - view.project(wavy.nodes) for view in views], axis=0)
        assert np.sqrt((pixels**2).sum(axis=1).mean()) == pytest.approx(1e-3, rel=0.02)


def test_a_state_in_the_gauge_has_no_motion_of_the_part_and_shows_the_same_pictures(wavy):
    _, views, seen, _ = wavy
    free = Freedom("free", (Lens(),) * 2, views, seen.centre)
    gauge = gauge_of(seen, free)
    deviation = 1e-3 * gauge @ np.random.default_rng(0).normal(size=gauge.shape[1])
    moved, left = in_gauge(seen, free, views, deviation)
    assert left == pytest.approx(np.zeros(len(left)), abs=1e-12)
    slid = slides(seen, views, moved, -deviation)
    assert slid[0] == pytest.approx(slid[1], abs=1e-2 * np.abs(slid).max())


def slides(seen, views, after, shape):
    """Return how far over the surface each view's picture of each node slides in a step, (2, n, 2) mm."""
    first = np.cross(seen.normals, [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    found = []
    for view, moved in zip(views, after, strict=True):
        here = view.project(seen.nodes)
        ways = [(view.project(seen.nodes + 1e-4 * t) - here) / 1e-4 for t in (first, np.cross(seen.normals, first))]
        change = moved.project(seen.nodes + shape[:, None] * seen.normals) - here
        found.append(np.einsum("nij,nj->ni", np.linalg.inv(np.stack(ways, axis=2)), change))
    return np.stack(found)


def camera_system(seen, stack, views, free, still=None):
    """Return the linear system at the nominal shape."""
    found = accumulated(seen, stack, views, columns=free.columns)
    slides = slides_of(seen, free, views)
    scale = free.scale(views, seen.nodes)
    even = np.ones(len(found.node))
    return system_of(seen, found, even, NOISE**2, free, free.columns, scale, slides, still=still)


def test_moving_the_part_before_the_cameras_is_moving_its_nodes(wavy):
    _, views, seen, stack = wavy
    found = accumulated(seen, stack, views)
    common = Freedom("common", (Lens(), Lens()), views, seen.centre)
    mixing, _ = common.spread(ALL)
    gauge = gauge_of(seen, common)
    nodes = seen.assembled(found.node)
    matrix = sparse.csr_matrix((nodes, seen.ordering.columns, seen.ordering.starts))
    cross = seen.gathered(found.cross) @ mixing
    camera = mixing.T @ found.camera @ mixing
    from inspect3d.register.mobility import jacobian

    fields = jacobian(seen.nodes, seen.normals, seen.centre)
    assert np.linalg.matrix_rank(np.column_stack([gauge, fields])) == 6
    stiffness = np.diag(fields.T @ (matrix @ fields))
    slack = fields.T @ (matrix @ fields) - 2 * fields.T @ cross + camera
    assert (np.abs(np.diag(slack)) < 0.02 * stiffness).all()


def test_sliding_all_pictures_together_over_a_plane_has_no_stiffness_at_all(flat):
    _, views, seen = flat
    random = np.random.default_rng(0)
    stack = Pictures([random.uniform(0, 255, (480, 620)) for _ in views]).blurred(0.5)
    found = accumulated(seen, stack, views)
    mixing, _ = Freedom("common", (Lens(), Lens()), views, seen.centre).spread(ALL)
    stiffness = np.diag(mixing.T @ found.camera @ mixing)
    alone = np.diag(found.camera)[:6]
    assert (stiffness[[2, 3, 4]] < 1e-12 * alone[[2, 3, 4]]).all()
    assert (stiffness[[0, 1, 5]] > 1e-3 * alone[[0, 1, 5]]).all()


def test_a_step_of_the_cameras_and_its_opposite_cancel():
    views = rig()
    free = Freedom("free", (Lens(10.0, 5.0, (0.1,) * 5, 2.0, 1.0),) * 2, views, np.array([30.0, 22.5, 0.0]))
    step = np.random.default_rng(0).normal(0, 1e-3, free.unknowns) * free.scale(
        views, np.array([[10.0, 10.0, 0.0]] * 2)
    )
    there = free.moved(views, step)
    assert free.offset(there)[12:] == pytest.approx(step[12:])
    for back, view in zip(free.moved(there, -step), views, strict=True):
        assert back.camera.matrix == pytest.approx(view.camera.matrix)
        assert back.camera_from_cad.matrix == pytest.approx(view.camera_from_cad.matrix, abs=1e-6)


def test_the_gauge_of_free_poses_has_seven_fields_and_that_of_a_plane_four():
    wavy, views = sheet(edge=9.0), rig()
    for nominal, poses, count in ((wavy, "free", 7), (wavy, "common", 6), (wavy, "known", 0)):
        seen = scene(nominal, views, 20.0, STEEPEST, [None, None])
        gauge = gauge_of(seen, Freedom(poses, (Lens(), Lens()), views, seen.centre))
        assert gauge.shape[1] == count
        assert gauge.T @ gauge == pytest.approx(np.eye(count))
    seen = scene(sheet(plane, plane_normals, edge=9.0), views, 20.0, STEEPEST, [None, None])
    assert gauge_of(seen, Freedom("free", (Lens(), Lens()), views, seen.centre)).shape[1] == 3


def test_a_view_that_moves_sees_what_a_part_that_moves_shows():
    views = rig()
    motion = Pose.small(np.array([1e-3, 2e-3, -1e-3, 0.1, 0.2, -0.1]), np.zeros(3))
    points = np.random.default_rng(0).uniform(0, 40, (5, 3))
    moved = View(views[0].camera, views[0].camera_from_cad @ motion)
    assert moved.project(points) == pytest.approx(views[0].project(motion(points)))


def mean_place(views, points):
    """Return where the views see points, in the mean, all in one row."""
    return np.mean([view.project(points) for view in views], axis=0).ravel()
