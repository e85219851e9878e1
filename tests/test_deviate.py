"""The deviation map: exact where the truth is known, and as uncertain as it says."""

from dataclasses import replace

import numpy as np
import pytest

from inspect3d.deviate.cloud_to_node import CloudToNode
from inspect3d.deviate.deviate import Deviate
from inspect3d.measure import Cloud
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from inspect3d.register.gauge import best_fit
from inspect3d.register.register import Register
from inspect3d.virtual.correlated_noise import correlated_noise
from tests.jit import printed
from tests.sheets import DEPTH, WIDTH, scanned, sheet


@pytest.fixture(scope="module")
def nominal():
    return sheet()


def deviated(nominal, points, start=None, noise=None, noise_length=0.0, **settings):
    """Register near the truth and measure the deviation."""
    cloud = Cloud("scan", points, noise=noise, noise_length=noise_length)
    refine = settings.get("refine", True)
    alignment = Register(nominal, start or Pose.identity(), refine)(cloud)
    counted = np.ones(len(nominal.mesh), bool)
    return Deviate(**settings)((cloud,), (alignment,), nominal, counted)


def form(x, y):
    """A smooth form error, mm."""
    return 0.03 * np.sin(x / 15) * np.sin(y / 18 + 1)


def bump(x, y):
    """A local bump of 0.3 mm and 8 mm width (FWHM)."""
    return 0.3 * np.exp(-4 * np.log(2) * ((x - 30) ** 2 + (y - 21) ** 2) / 64)


def in_the_gauge_of(found, nominal, truth):
    """Return the true deviation at the observed nodes, brought into the gauge of the map found."""
    mesh, seen = nominal.mesh, found.deviation.observed
    gauge = best_fit(mesh.nodes[seen], mesh.normals[seen], mesh.areas[seen], found.deviation.value[seen])
    return gauge(truth(mesh.nodes[seen, 0], mesh.nodes[seen, 1]))


def test_a_surface_raised_by_h_deviates_by_h_everywhere_when_the_pose_is_given(nominal):
    points, _ = scanned(np.random.default_rng(0), 30_000, deviation=lambda x, y: 0.25 + 0 * x)
    found = deviated(nominal, points, refine=False, noise=1e-4)
    assert found.deviation.observed.mean() > 0.9
    np.testing.assert_allclose(found.deviation.value[found.deviation.observed], 0.25, atol=2e-3)
    np.testing.assert_allclose(found.distance[np.isfinite(found.distance)], 0.25, atol=2e-3)


def test_coating_is_subtracted_and_its_uncertainty_is_added(nominal):
    points, _ = scanned(np.random.default_rng(0), 30_000, deviation=lambda x, y: 0.04 + 0 * x)
    bare = deviated(nominal, points, refine=False, noise=1e-4)
    painted = deviated(nominal, points, refine=False, noise=1e-4, coating=0.04, coating_sigma=0.005)
    seen = bare.deviation.observed
    np.testing.assert_allclose(painted.deviation.value[seen], bare.deviation.value[seen] - 0.04, atol=1e-9)
    variance = bare.deviation.sigma[seen] ** 2 + 0.005**2
    np.testing.assert_allclose(painted.deviation.sigma[seen] ** 2, variance, rtol=1e-9)


def test_calibration_adds_to_every_node(nominal):
    points, _ = scanned(np.random.default_rng(0), 10_000, noise=0.01)
    plain, calibrated = deviated(nominal, points), deviated(nominal, points, calibration=0.003)
    seen = plain.deviation.observed
    np.testing.assert_allclose(
        calibrated.deviation.sigma[seen] ** 2, plain.deviation.sigma[seen] ** 2 + 0.003**2, rtol=1e-6
    )


def test_the_local_fit_reproduces_every_quadratic_form_exactly(nominal):
    def quadratic(x, y):
        return 1e-5 * (3 + x + 2 * y) ** 2

    points, _ = scanned(np.random.default_rng(1), 30_000, deviation=quadratic)
    feet = nominal.surface.closest(points)
    fit = CloudToNode()(nominal.mesh, feet, np.ones(len(points), bool), 1e-5)
    truth = quadratic(nominal.mesh.nodes[:, 0], nominal.mesh.nodes[:, 1])
    np.testing.assert_allclose(fit.value[fit.observed], truth[fit.observed], atol=2e-3)


def test_points_that_are_less_certain_count_less_and_sigma_stays_true(nominal):
    random = np.random.default_rng(3)
    points, _ = scanned(random, 20_000)
    feet, part = nominal.surface.closest(points), np.ones(len(points), bool)
    shares = np.where(points[:, 0] < WIDTH / 2, 1.0, random.choice([0.5, 1.0, 3.0], len(points)))
    feet = replace(feet, distance=feet.distance + 0.01 * shares * random.normal(size=len(points)))
    fit, plain = CloudToNode()(nominal.mesh, feet, part, None, shares), CloudToNode()(nominal.mesh, feet, part)
    assert fit.noise == pytest.approx(0.01, rel=0.03)
    mixed = fit.observed & (nominal.mesh.nodes[:, 0] > 0.6 * WIDTH)
    even = fit.observed & (nominal.mesh.nodes[:, 0] < 0.4 * WIDTH)
    for nodes in (mixed, even):
        z = fit.value[nodes] / np.sqrt(fit.variance[nodes])
        assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=4 / np.sqrt(2 * nodes.sum()))
    assert np.median(fit.variance[mixed]) < 0.5 * np.median(plain.variance[mixed])
    np.testing.assert_allclose(fit.value[even], plain.value[even], atol=1e-12)


def test_a_hole_in_the_scan_is_not_observed(nominal):
    points, _ = scanned(np.random.default_rng(2), 30_000, noise=0.01)
    hole = np.hypot(points[:, 0] - 30, points[:, 1] - 20) < 10
    found = deviated(nominal, points[~hole])
    deep = np.hypot(nominal.mesh.nodes[:, 0] - 30, nominal.mesh.nodes[:, 1] - 20) < 6
    assert deep.any()
    assert not found.deviation.observed[deep].any()
    assert np.isnan(found.deviation.value[deep]).all()


def test_a_defect_survives_registration_at_its_full_height(nominal):
    for seed in range(3):
        random = np.random.default_rng(seed)
        points, _ = scanned(random, 40_000, deviation=bump, noise=0.02)
        points[:4000] = random.uniform([-10, -10, -12], [70, 55, 12], (4000, 3))
        found = deviated(nominal, points)
        left = found.alignments[0].cad_from_measured
        nodes = nominal.mesh.nodes
        assert np.abs(np.einsum("ni,ni->n", left(nodes) - nodes, nominal.mesh.normals)).max() < 0.003
        peak = np.argmin(np.hypot(nodes[:, 0] - 30, nodes[:, 1] - 21))
        assert found.deviation.sigma[peak] < 0.010
        assert abs(found.deviation.value[peak] - bump(*nodes[peak, :2])) < 3 * found.deviation.sigma[peak]


def test_sigma_is_true(nominal):
    z = []
    for seed in range(8):
        random = np.random.default_rng(seed)
        count, noise = (8000, 20_000, 60_000)[seed % 3], (0.005, 0.02, 0.05)[seed % 3]
        points, _ = scanned(random, count, deviation=form, noise=noise)
        found = deviated(nominal, points)
        seen = found.deviation.observed
        z.append((found.deviation.value[seen] - in_the_gauge_of(found, nominal, form)) / found.deviation.sigma[seen])
    z = np.concatenate(z)
    assert 0.93 < np.sqrt(np.mean(z**2)) < 1.07
    assert 0.93 < np.mean(np.abs(z) < 1.96) < 0.97


@pytest.mark.parametrize("length", [0.3, 1.5, 6.0])
def test_sigma_is_true_where_neighbouring_points_share_their_noise(nominal, length):
    z = []
    for seed in range(4):
        random = np.random.default_rng(seed)
        points, along = scanned(random, 20_000)
        points = points + along * 0.02 * correlated_noise(points, length, random)[:, None]
        found = deviated(nominal, points, noise=0.02, noise_length=length)
        seen = found.deviation.observed
        z.append(found.deviation.value[seen] / found.deviation.sigma[seen])
    assert 0.85 < np.sqrt(np.mean(np.concatenate(z) ** 2)) < 1.15


def test_foreign_points_near_the_surface_do_not_pull_the_nodes(nominal):
    random = np.random.default_rng(3)
    points, along = scanned(random, 40_000, noise=0.01)
    strays = random.random(len(points)) < 0.15
    points[strays] += along[strays] * random.uniform(0.1, 0.8, (np.count_nonzero(strays), 1))
    found = deviated(nominal, points)
    assert np.sqrt(np.nanmean(found.deviation.value**2)) < 0.004


def test_points_on_the_back_of_a_thin_sheet_are_not_taken_for_its_front():
    front = sheet()
    points, normals = scanned(np.random.default_rng(4), 20_000, noise=0.01)
    back = Cloud("scan", np.concatenate([points, points - 0.6 * normals]), np.concatenate([normals, -normals]))
    alignment = Register(front, Pose.identity())(back)
    found = Deviate()((back,), (alignment,), front, np.ones(len(front.mesh), bool))
    assert np.sqrt(np.nanmean(found.deviation.value**2)) < 0.004


def test_the_noise_is_found_from_the_cloud(nominal):
    points, _ = scanned(np.random.default_rng(5), 30_000, deviation=form, noise=0.017)
    assert deviated(nominal, points).noise == pytest.approx(0.017, rel=0.03)


def test_a_sparse_cloud_is_refused_with_what_to_do(nominal):
    points, _ = scanned(np.random.default_rng(6), 60, noise=0.01)
    with pytest.raises(MeasurementError, match="element_size"):
        deviated(nominal, points)


def test_points_off_the_rim_have_no_deviation(nominal):
    points, _ = scanned(np.random.default_rng(7), 5000, noise=0.01)
    beyond = np.array([[WIDTH + 2, 10.0, 0.0], [10.0, DEPTH + 2, 0.0]])
    found = deviated(nominal, np.concatenate([points, beyond]))
    assert np.isnan(found.distance[-2:]).all()


def test_the_fit_kernel_agrees_with_the_jit_off():
    program = """
import numpy as np
from inspect3d.deviate.local_fit_kernel import fit_nodes
random = np.random.default_rng(0)
feet = np.concatenate([random.uniform(-1, 1, (60, 2)), np.zeros((60, 1))], axis=1)
shape = np.array([2, 4, 2])
keys = ((np.floor(feet[:, 0] + 1) * shape[1] + np.floor(feet[:, 1] + 2)) * shape[2] + 1).astype(np.int64)
order = np.argsort(keys, kind="stable")
feet, keys = feet[order], keys[order]
distance = 0.1 + 0.02 * feet[:, 0] - 0.03 * feet[:, 1] ** 2 + random.normal(0, 0.001, 60)
distance[7] = 5.0
up = np.array([[0.0, 0.0, 1.0]])
result = fit_nodes(np.zeros((1, 3)), up, np.full((1, 3), 0.9), 0.001, np.array([-1.0, -2.0, -1.0]), 1.0, shape, keys,
                   feet, np.tile(up, (60, 1)), distance, random.uniform(0.5, 1.0, 60))
print([f"{float(part[0]):.12g}" for part in result])
assert abs(result[0][0] - 0.1) < 0.002
"""
    with_jit, without = (printed(program, jit) for jit in (True, False))
    assert with_jit == without
