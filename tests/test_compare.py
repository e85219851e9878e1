"""Two methods, one part: their difference, and how much of it their uncertainties explain."""

from dataclasses import replace

import numpy as np
import pytest

from inspect3d.compare.compare import Compare
from inspect3d.compare.measured_map import MeasuredMap
from inspect3d.compare.resolution import unresolved
from inspect3d.deviate.deviate import Deviate
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.low_rank import LowRank
from inspect3d.deviate.map_covariance import Independent, MapCovariance
from inspect3d.measure import Cloud
from inspect3d.pose import Pose
from inspect3d.register.gauge import best_fit
from inspect3d.register.mobility import jacobian
from inspect3d.register.register import Register
from tests.sheets import scanned, sheet

MOTION = np.array([1e-4, -2e-4, 1e-4, 0.01, 0.02, -0.015])


@pytest.fixture(scope="module")
def nominal():
    return sheet()


def form(x, y):
    """A smooth form error, mm."""
    return 0.03 * np.sin(x / 15) * np.sin(y / 18 + 1)


def scan(nominal, seed, count, noise, name="scan", deviation=form):
    """Return the map of a simulated scan."""
    points, _ = scanned(np.random.default_rng(seed), count, noise=noise, deviation=deviation)
    cloud = Cloud(name, points)
    alignment = Register(nominal, Pose.identity())(cloud)
    found = Deviate()((cloud,), (alignment,), nominal, np.ones(len(nominal.mesh), bool))
    return MeasuredMap(name, found.deviation, found.covariance)


def made(nominal, name, value, sigma=0.004, seen=None, spread=(), **known):
    """Return a map with independent errors, and in its weak motions errors of the sizes `spread` (mm) besides."""
    node = np.arange(len(nominal.mesh)) if seen is None else np.flatnonzero(seen)
    full, sigmas = np.full(len(nominal.mesh), np.nan), np.full(len(nominal.mesh), np.nan)
    full[node], sigmas[node] = value[node], sigma
    own = Independent(np.full(len(node), sigma**2))
    if spread:
        own = LowRank(own.variances, known["weak"] * spread)
    covariance = MapCovariance(node, own, np.zeros((len(node), 0)), **known)
    return MeasuredMap(name, Deviation(full, sigmas, np.isfinite(full)), covariance)


def pair(nominal, a, b):
    """Return the comparison of two maps."""
    (found,) = Compare()((a, b), nominal.mesh)
    return found


def test_between_independent_scans_en_is_as_large_as_true_uncertainties_make_it(nominal):
    en = []
    for seed in range(6):
        a = scan(nominal, 2 * seed, 15_000, 0.02, "a")
        b = scan(nominal, 2 * seed + 1, 40_000, 0.01, "b")
        found = pair(nominal, a, b)
        en.append(found.en[found.common])
    en = np.concatenate(en)
    assert 0.45 < np.sqrt(np.mean(en**2)) < 0.55
    assert 0.02 < np.mean(en > 1) < 0.08


def test_the_rigid_motion_between_two_maps_is_no_difference(nominal):
    mesh = nominal.mesh
    value = form(mesh.nodes[:, 0], mesh.nodes[:, 1])
    moved = value + jacobian(mesh.nodes, mesh.normals, np.zeros(3)) @ MOTION
    found = pair(nominal, made(nominal, "a", value), made(nominal, "b", moved))
    assert np.abs(found.difference).max() < 1e-9
    assert found.correlation == pytest.approx(1)
    assert found.en_rms < 1e-6


def test_a_step_that_each_method_resolves_in_its_own_way_is_no_region_and_a_defect_of_one_beside_it_is(nominal):
    mesh, random = nominal.mesh, np.random.default_rng(5)
    x, y = mesh.nodes[:, 0], mesh.nodes[:, 1]
    step = 0.04 * (x > 30.3)
    sharp = step + random.normal(0, 0.003, len(x))
    blurred = 0.04 / (1 + np.exp(-(x - 30.3) / 0.8)) + random.normal(0, 0.003, len(x))
    found = pair(nominal, made(nominal, "a", sharp, 0.003), made(nominal, "b", blurred, 0.003))
    assert not found.regions
    assert any("a step that both maps show" in words for words in found.words)
    bump = 0.06 * np.exp(-((x - 30) ** 2 + (y - 20) ** 2) / 20)
    region, *_ = pair(nominal, made(nominal, "a", sharp + bump, 0.003), made(nominal, "b", blurred, 0.003)).regions
    assert np.hypot(*(region.place[:2] - [30, 20])) < 4


def test_a_slope_that_both_maps_show_hides_no_difference(nominal):
    mesh = nominal.mesh
    slope = 0.01 * mesh.nodes[:, 0]
    a, b = (made(nominal, name, slope, 0.002) for name in "ab")
    height = unresolved(a, b, mesh, np.arange(len(mesh)))
    middle = (np.abs(mesh.nodes[:, :2] - [30, 22.5]) < [20, 12]).all(axis=1)
    assert np.median(height[middle]) == 0
    assert height.max() < 0.01 * 2 * mesh.edge_length


def test_two_maps_held_in_given_poses_are_compared_as_they_are(nominal):
    value = form(nominal.mesh.nodes[:, 0], nominal.mesh.nodes[:, 1])
    a, b = (made(nominal, name, value + shift, refined=False) for name, shift in (("a", 0.0), ("b", 0.01)))
    found = pair(nominal, a, b)
    np.testing.assert_allclose(found.difference, -0.01, rtol=1e-9)
    np.testing.assert_allclose(found.sigma, 0.004 * np.sqrt(2), rtol=1e-9)
    assert found.mean == pytest.approx(-0.01)


def test_the_scale_goes_from_both_maps_if_one_cannot_tell_it(nominal):
    mesh = nominal.mesh
    grown = 2e-4 * (mesh.nodes * mesh.normals).sum(axis=1)
    known, free = made(nominal, "a", grown), made(nominal, "b", 0 * grown, scale_known=False)
    assert np.abs(pair(nominal, known, free).difference).max() < 1e-9
    told = made(nominal, "b", 0 * grown)
    assert np.abs(pair(nominal, known, told).difference).max() > 1e-4


def bends(mesh):
    """Return two slow motions (n, 2) that the pictures of a stereo method hardly tell."""
    x, y = mesh.nodes[:, 0] / 30 - 1, mesh.nodes[:, 1] / 22 - 1
    return np.column_stack([x * x, x * y])


def test_motions_that_pictures_hardly_tell_go_from_both_and_leave_a_local_defect(nominal):
    x, y = nominal.mesh.nodes[:, 0], nominal.mesh.nodes[:, 1]
    bump = 0.06 * np.exp(-((x - 40) ** 2 + (y - 25) ** 2) / 20)
    noise = np.random.default_rng(3).normal(0, 0.004, (2, len(x)))
    weak = bends(nominal.mesh)
    a = made(nominal, "a", bump + noise[0])
    b = made(nominal, "b", noise[1] + weak @ [0.09, -0.05], weak=weak, spread=(0.08, 0.08))
    found = pair(nominal, a, b)
    far = bump < 1e-4
    assert 0.45 < np.sqrt(np.mean(found.en[far] ** 2)) < 0.55
    assert (found.en[bump > 0.03] > 1).all()
    assert np.nanmax(found.sigma) < 0.008
    assert "2 motions of cameras and shape together that the pictures of b hardly tell" in found.gauge
    assert any("as their stated uncertainties allow" in words for words in found.words)
    sure = made(nominal, "b", b.deviation.value, weak=weak, spread=(0.01, 0.01))
    assert any("more than their stated uncertainties explain" in words for words in pair(nominal, a, sure).words)


def test_maps_in_given_poses_keep_them_when_weak_motions_go(nominal):
    weak = bends(nominal.mesh)
    value = np.zeros(len(nominal.mesh))
    a = made(nominal, "a", value + 0.01 * nominal.mesh.nodes[:, 0] / 60, refined=False)
    b = made(nominal, "b", 0.05 * weak[:, 1], refined=False, weak=weak, spread=(0.08, 0.08))
    found = pair(nominal, a, b)
    assert 0.005 < np.ptp(found.difference) < 0.02
    assert found.gauge.startswith("2 motions")


def test_weak_motions_that_leave_the_common_nodes_at_rest_are_not_taken_out(nominal):
    value, weak = np.zeros(len(nominal.mesh)), np.zeros((len(nominal.mesh), 1))
    found = pair(
        nominal, made(nominal, "a", value + 0.01, refined=False), made(nominal, "b", value, refined=False, weak=weak)
    )
    np.testing.assert_allclose(found.difference, 0.01)
    assert found.gauge.startswith("Both maps stay in the poses they were given")


def test_a_defect_that_one_method_shows_does_not_tilt_the_difference(nominal):
    x, y = nominal.mesh.nodes[:, 0], nominal.mesh.nodes[:, 1]
    bump = 0.3 * np.exp(-((x - 45) ** 2 + (y - 35) ** 2) / 40)
    noise = np.random.default_rng(0).normal(0, 0.004, (2, len(x)))
    found = pair(nominal, made(nominal, "a", bump + noise[0]), made(nominal, "b", noise[1]))
    far = bump < 1e-4
    assert abs(found.difference[far].mean()) < 0.001
    assert np.sqrt(np.mean(found.en[far] ** 2)) < 0.56
    assert (found.en[bump > 0.03] > 1).all()


def test_the_variance_of_the_difference_is_that_of_both_maps_in_the_common_alignment(nominal):
    mesh, random = nominal.mesh, np.random.default_rng(1)
    a, b = (made(nominal, name, random.normal(0, 0.004, len(mesh))) for name in "ab")
    found = pair(nominal, a, b)
    gauge = best_fit(mesh.nodes, mesh.normals, mesh.areas, a.deviation.value - b.deviation.value)
    through = np.eye(len(mesh)) - gauge.jacobian @ gauge.solver
    np.testing.assert_allclose(found.sigma**2, 2 * 0.004**2 * (through**2).sum(axis=1), rtol=1e-9)


def test_the_error_of_one_coat_cancels_and_that_of_two_adds(nominal):
    value = np.zeros(len(nominal.mesh))
    bare = [made(nominal, name, value, refined=False) for name in "ab"]
    same = [made(nominal, name, value, refined=False, coating=(0.04, 0.005)) for name in "ab"]
    other = made(nominal, "b", value, refined=False, coating=(0.05, 0.003))
    plain = pair(nominal, *bare).sigma ** 2
    np.testing.assert_allclose(pair(nominal, *same).sigma ** 2, plain)
    np.testing.assert_allclose(pair(nominal, same[0], other).sigma ** 2, plain + 0.005**2 + 0.003**2)


def test_methods_that_share_pictures_have_no_en_and_say_why(nominal):
    value = form(nominal.mesh.nodes[:, 0], nominal.mesh.nodes[:, 1])
    a = replace(made(nominal, "nodes", value), sources={"12ab": "left.png", "34cd": "right.png"})
    b = replace(made(nominal, "patch", value), sources={"12ab": "left.png", "56ef": "third.png"})
    found = pair(nominal, a, b)
    assert found.en_rms is None
    assert found.en is None
    assert "left.png" in found.reason
    assert found.reason in found.words
    assert found.std is not None


def test_methods_without_common_nodes_have_no_difference(nominal):
    left = nominal.mesh.nodes[:, 0] < 30
    value = np.zeros(len(nominal.mesh))
    found = pair(nominal, made(nominal, "a", value, seen=left), made(nominal, "b", value, seen=~left))
    assert found.nodes == 0
    assert found.mean is None
    assert found.coverage == 0
    assert found.coverage_a + found.coverage_b == pytest.approx(1)
    assert "too few" in found.reason


def test_three_methods_make_three_comparisons(nominal):
    value = np.zeros(len(nominal.mesh))
    found = Compare()(tuple(made(nominal, name, value) for name in "abc"), nominal.mesh)
    assert [(each.a, each.b) for each in found] == [("a", "b"), ("a", "c"), ("b", "c")]
