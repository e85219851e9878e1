"""Truths about virtual scans."""

from dataclasses import replace
from math import cos, radians

import numpy as np
import pytest

from inspect3d.pose import Pose
from inspect3d.virtual.bracket import BracketSizes, bracket
from inspect3d.virtual.correlated_noise import correlated_noise
from inspect3d.virtual.deviation_field import Bump, Uniform, Wave
from inspect3d.virtual.freeform import FreeformSizes, freeform
from inspect3d.virtual.laser_scanner import LaserScanner
from inspect3d.virtual.random_pose import random_pose
from inspect3d.virtual.uniform_scan import uniform_scan

POSE = random_pose(np.random.default_rng(11))
QUICK = LaserScanner(noise=0.0, line_spacing=1.0, point_spacing=0.7)


@pytest.fixture(scope="module")
def bracket_surface():
    return bracket().surface()


@pytest.fixture(scope="module")
def sheet():
    return freeform().surface()


@pytest.fixture(scope="module", params=["laser", "uniform"])
def scan_without_noise(request):
    """Return a function (surface, field) -> scan without noise, in a pose of its own."""
    if request.param == "laser":
        scanner = replace(QUICK, scan_from_cad=POSE, views=((0.0, 0.0, 1.0), (0.7, 0.4, 1.0)))
        return lambda surface, field: scanner(surface, field, 1)
    return lambda surface, field: uniform_scan(surface, field, 0.5, 0.0, 1, POSE)


def test_a_scan_without_noise_lies_on_the_true_freeform_surface(scan_without_noise, sheet):
    from OCP.BRep import BRep_Tool
    from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
    from OCP.gp import gp_Pnt

    sizes = FreeformSizes()
    field = Wave(0.03, (0.01, 0.005, 0.0)) + Bump((34.0, 50.0, 5.0), 0.3, 8.0)
    scan = scan_without_noise(sheet, field)
    exact = BRep_Tool.Surface_s(freeform(sizes).shape())
    chosen = np.random.default_rng(2).choice(len(scan), 300, replace=False)
    points, outward = scan.points_cad[chosen], POSE.inverse().turned(scan.normals_scan[chosen])
    inside = (points[:, :2] > 0.5).all(axis=1) & (points[:, :2] < [sizes.length - 0.5, sizes.width - 0.5]).all(axis=1)
    for point, normal in zip(points[inside], outward[inside], strict=True):
        foot = GeomAPI_ProjectPointOnSurf(gp_Pnt(*point.tolist()), exact).NearestPoint()
        nominal = np.array([[foot.X(), foot.Y(), foot.Z()]])
        assert (point - nominal[0]) @ normal == pytest.approx(field(nominal)[0], abs=1e-6)


def test_a_scan_without_noise_lies_on_the_planes_and_cylinders_of_the_bracket(scan_without_noise, bracket_surface):
    s = BracketSizes()
    scan = scan_without_noise(bracket_surface, Uniform(0.05))
    points, normals = scan.points_cad, POSE.inverse().turned(scan.normals_scan)
    levels = np.array([0.0, s.thickness, s.thickness + s.boss[3], s.height])
    up = normals[:, 2] > 0.999999
    off = np.abs(points[up, 2, None] - 0.05 - levels).min(axis=1)
    assert off.max() < 2e-4
    axis = points[:, :2] - np.array(s.boss[:2])
    above_foot = (points[:, 2] > s.thickness + s.boss_foot + 0.1) & (np.abs(normals[:, 2]) < 1e-6)
    radius = np.hypot(*axis.T)
    on_boss = above_foot & (radius < s.boss[2] + 1.0)
    assert np.count_nonzero(on_boss) > 20
    np.testing.assert_allclose(radius[on_boss], s.boss[2] + 0.05, atol=1e-9)


def test_the_cloud_comes_out_in_the_pose_that_was_asked(scan_without_noise, bracket_surface):
    scan = scan_without_noise(bracket_surface, Uniform())
    assert scan.scan_from_cad is POSE
    np.testing.assert_allclose(POSE(scan.points_cad), scan.points_scan, atol=1e-10)
    low, high = scan.points_cad.min(axis=0), scan.points_cad.max(axis=0)
    assert (low > -1e-3).all()
    assert (high < [100.001, 80.001, 60.001]).all()


def test_noise_moves_points_along_the_normal_by_the_stated_amount(bracket_surface):
    for scan in (
        uniform_scan(bracket_surface, Uniform(0.1), 3.0, 0.02, 5),
        LaserScanner(noise=0.02)(bracket_surface, Uniform(0.1), 5),
    ):
        assert scan.noise == 0.02
        count = len(scan)
        assert scan.noise_true.std() == pytest.approx(0.02, rel=4 / np.sqrt(2 * count))
        assert abs(scan.noise_true.mean()) < 4 * 0.02 / np.sqrt(count)
        up = (scan.normals_scan[:, 2] > 0.999999) & (scan.points_scan[:, 2] < 15.0)
        np.testing.assert_allclose(scan.points_scan[up, 2] - 12.1, scan.noise_true[up], atol=2e-4)


def test_paint_lifts_every_point_by_its_thickness(bracket_surface):
    bare, painted = (replace(QUICK, coating=paint)(bracket_surface, Uniform(), 3) for paint in (0.0, 0.04))
    np.testing.assert_allclose(painted.points_scan, bare.points_scan + 0.04 * bare.normals_scan, atol=1e-12)


def test_the_same_seed_gives_the_same_cloud_and_another_seed_another(bracket_surface):
    scanner = LaserScanner(noise=0.02, line_spacing=1.0, point_spacing=0.7, foreign=0.05, holes=2, drift=0.01)
    one, two, other = (scanner(bracket_surface, Uniform(), seed) for seed in (4, 4, 5))
    assert (one.points_scan == two.points_scan).all()
    assert (one.foreign == two.foreign).all()
    assert one.points_scan.shape != other.points_scan.shape or (one.points_scan != other.points_scan).any()


def test_no_point_lies_on_a_face_turned_away_or_looked_along(bracket_surface):
    view = np.array([1.0, 0.4, 0.8])
    scan = replace(QUICK, views=(tuple(view),))(bracket_surface, Uniform(), 6)
    assert (scan.normals_scan @ view / np.linalg.norm(view)).min() > cos(QUICK.grazing)
    assert scan.points_scan[:, 2].min() > -1e-9
    assert np.count_nonzero(scan.normals_scan[:, 0] < -0.5) == 0


def test_the_wall_hides_the_base_from_behind_as_far_as_its_shadow_falls(bracket_surface):
    s = BracketSizes()
    scanner = replace(QUICK, views=((-1.0, 0.0, 1.0),), triangulation=0.0)
    scan = scanner(bracket_surface, Uniform(), 7)
    on_base = (scan.points_scan[:, 2] < s.thickness + 1e-6) & (scan.normals_scan[:, 2] > 0.999)
    shadow = s.thickness + s.height - s.thickness
    beyond = scan.points_scan[on_base, 0]
    assert beyond.min() == pytest.approx(shadow, abs=1.5)
    assert beyond.min() > shadow - 1e-6


def test_what_the_camera_does_not_see_is_not_measured(bracket_surface):
    alone, watched = (
        replace(QUICK, triangulation=angle)(bracket_surface, Uniform(), 8) for angle in (0.0, radians(40.0))
    )
    assert len(watched) < len(alone)
    found = {tuple(point) for point in alone.points_scan.round(9)}
    assert all(tuple(point) in found for point in watched.points_scan.round(9))


def test_foreign_points_have_their_share_and_are_not_of_the_part(bracket_surface):
    clean = QUICK(bracket_surface, Uniform(), 9)
    scan = replace(QUICK, foreign=0.1)(bracket_surface, Uniform(), 9)
    assert scan.foreign.mean() == pytest.approx(0.1, abs=1e-4)
    np.testing.assert_array_equal(scan.points_scan[~scan.foreign], clean.points_scan)
    feet = bracket_surface.triangulation.closest(scan.points_scan[scan.foreign])
    assert np.mean(np.abs(feet.distance) > 0.5) > 0.9
    assert not scan.noise_true[scan.foreign].any()


def test_a_hole_is_empty(bracket_surface):
    whole = QUICK(bracket_surface, Uniform(), 10)
    holed = replace(QUICK, holes=3, hole_width=10.0)(bracket_surface, Uniform(), 10)
    kept = {tuple(point) for point in holed.points_scan}
    lost = np.array([point for point in whole.points_scan if tuple(point) not in kept])
    assert len(whole) == len(holed) + len(lost)
    assert len(lost) > 50


def test_drift_has_its_size_and_its_length():
    at = np.column_stack([np.linspace(0.0, 60.0, 4), np.zeros((4, 2))])
    drawn = np.array([correlated_noise(at, 20.0, np.random.default_rng(seed)) for seed in range(4000)])
    expected = np.exp(-(np.subtract.outer(at[:, 0], at[:, 0]) ** 2) / (2 * 20.0**2))
    np.testing.assert_allclose(drawn.T @ drawn / len(drawn), expected, atol=0.08)


def test_drift_comes_on_top_of_the_noise(sheet):
    scan = LaserScanner(noise=0.01, drift=0.03, drift_length=5.0)(sheet, Uniform(), 12)
    assert scan.noise_true.std() == pytest.approx(np.hypot(0.01, 0.03), rel=0.15)


def test_a_random_pose_goes_as_far_as_it_is_told():
    poses = [random_pose(np.random.default_rng(seed), distance=300.0) for seed in range(200)]
    assert np.allclose([np.linalg.norm(pose.translation) for pose in poses], 300.0)
    assert np.mean([pose.rotation for pose in poses], axis=0) == pytest.approx(np.zeros((3, 3)), abs=0.2)


def test_the_cad_frame_is_the_default_pose(sheet):
    scan = uniform_scan(sheet, Uniform(), 0.1, 0.02, 0)
    np.testing.assert_array_equal(scan.scan_from_cad.matrix, Pose.identity().matrix)


def test_a_share_of_foreign_points_beyond_one_is_refused():
    with pytest.raises(ValueError, match="share of foreign points"):
        LaserScanner(foreign=1.0)


def test_a_spacing_of_zero_is_refused():
    with pytest.raises(ValueError, match="spacing"):
        LaserScanner(line_spacing=0.0)
