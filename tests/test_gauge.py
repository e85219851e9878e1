"""The common alignment: what it removes, what it keeps, and what it claims."""

import numpy as np
import pytest

from inspect3d.register.gauge import Gauge, best_fit
from inspect3d.register.mobility import jacobian, named
from tests.sheets import plane, plane_normals, sheet


@pytest.fixture(scope="module")
def mesh():
    return sheet().mesh


def gauge_of(mesh):
    return Gauge(mesh.nodes, mesh.normals, mesh.areas)


def test_the_gauge_is_a_projection_that_removes_every_rigid_motion(mesh):
    gauge = gauge_of(mesh)
    random = np.random.default_rng(0)
    field = random.normal(size=len(mesh))
    np.testing.assert_allclose(gauge(gauge(field)), gauge(field), atol=1e-12)
    np.testing.assert_allclose(gauge(gauge.jacobian @ random.normal(size=6)), 0, atol=1e-10)


def test_the_motion_found_undoes_the_motion_made(mesh):
    gauge = gauge_of(mesh)
    made = np.array([1e-4, -2e-4, 3e-4, 0.01, 0.02, -0.03])
    np.testing.assert_allclose(gauge.motion(gauge.jacobian @ made), -made, rtol=1e-9)


def test_variances_are_the_diagonal_of_g_s_g(mesh):
    gauge = gauge_of(mesh)
    variances = np.random.default_rng(1).uniform(0.5, 2.0, len(mesh))
    dense = gauge(np.eye(len(mesh)))
    np.testing.assert_allclose(gauge.variances(variances), np.diag((dense * variances) @ dense.T), rtol=1e-10)


def test_a_local_defect_does_not_move_the_robust_fit(mesh):
    random = np.random.default_rng(2)
    noise = random.normal(0, 0.002, len(mesh))
    bump = 0.3 * np.exp(-((mesh.nodes[:, 0] - 45) ** 2 + (mesh.nodes[:, 1] - 10) ** 2) / 30)
    with_bump = best_fit(mesh.nodes, mesh.normals, mesh.areas, noise + bump)
    without = best_fit(mesh.nodes, mesh.normals, mesh.areas, noise)
    moved = np.abs(with_bump.jacobian @ (with_bump.motion(noise + bump)) - without.jacobian @ without.motion(noise))
    assert moved.max() < 0.002  # the noise of one node
    plain = gauge_of(mesh)
    assert np.abs(plain.jacobian @ plain.motion(bump)).max() > 0.02


def test_the_sandwich_tells_the_scatter_of_the_motion_for_errors_that_correlate_within_blocks(mesh):
    gauge = gauge_of(mesh)
    block = 9.0
    cells = np.floor((mesh.nodes - mesh.nodes.min(axis=0)) / block).astype(int)
    cell = np.unique(cells, axis=0, return_inverse=True)[1].ravel()
    motions, claims = [], []
    for seed in range(300):
        errors = np.random.default_rng(seed).normal(0, 0.01, cell.max() + 1)[cell]
        motions.append(gauge.motion(errors))
        claims.append(np.diag(gauge.covariance(gauge(errors), block)))
    ratio = np.std(motions, axis=0) / np.sqrt(np.mean(claims, axis=0))
    assert ((ratio > 0.8) & (ratio < 1.25)).all(), ratio


def test_a_plane_leaves_two_shifts_and_a_turn_free_and_holds_them():
    mesh = sheet(plane, plane_normals).mesh
    gauge = gauge_of(mesh)
    words = [motion.words for motion in named(gauge.free, gauge.origin, gauge.length)]
    assert sorted(words) == [
        "shift along (0, 1, 0)",
        "shift along (1, 0, 0)",
        "turn about the axis along (0, 0, 1) through (30, 22.5, 0) mm",
    ]
    held = np.array([0, 0, 1.0, 1.0, 1.0, 0])
    np.testing.assert_allclose(gauge.inverse @ held, 0, atol=1e-15)


def cylinder(radius=20.0, turns=1.0):
    angles = np.linspace(0, 2 * np.pi * turns, 60, endpoint=False)
    angle, z = (a.ravel() for a in np.meshgrid(angles, np.linspace(0, 8, 9)))
    normals = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return radius * normals + np.stack([0 * z + 5, 0 * z, z], axis=1), normals


@pytest.mark.parametrize("turns", [1.0, 0.3])
def test_a_cylinder_band_turns_about_its_axis_and_slides_along_it(turns):
    points, normals = cylinder(turns=turns)
    gauge = Gauge(points, normals, np.ones(len(points)))
    words = [motion.words for motion in named(gauge.free, gauge.origin, gauge.length)]
    assert words == ["shift along (0, 0, 1)", words[1]]
    assert words[1] == "turn about the axis along (0, 0, 1) through (5, 0, 0) mm"


def test_named_motions_move_no_point_along_its_normal():
    points, normals = cylinder()
    gauge = Gauge(points, normals, np.ones(len(points)))
    for motion in named(gauge.free, gauge.origin, gauge.length):
        np.testing.assert_allclose(jacobian(points, normals, gauge.origin) @ motion.direction, 0, atol=1e-9)


def test_a_sphere_turns_about_its_centre():
    random = np.random.default_rng(3)
    normals = random.normal(size=(500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = 7 * normals + [1.0, 2.0, 3.0]
    gauge = Gauge(points, normals, np.ones(len(points)))
    words = [motion.words for motion in named(gauge.free, gauge.origin, gauge.length)]
    assert len(words) == 3
    assert all(text.endswith("through (1, 2, 3) mm") for text in words)


def test_a_helix_surface_leaves_a_screw():
    angle, radius = (a.ravel() for a in np.meshgrid(np.linspace(0, 6 * np.pi, 200), np.linspace(5, 10, 6)))
    pitch = 40.0 / (2 * np.pi)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), pitch * angle], axis=1)
    normals = np.stack([pitch * np.sin(angle), -pitch * np.cos(angle), radius], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    gauge = Gauge(points, normals, np.ones(len(points)))
    (motion,) = named(gauge.free, gauge.origin, gauge.length)
    assert motion.words == "screw of 40.00 mm a turn about the axis along (0, 0, 1) through (0, 0, 0) mm"
