"""The parts of the correlation engine against brute force, closed forms and invariances."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse
from scipy.ndimage import gaussian_filter, spline_filter

from inspect3d.correlation.cells import whole_facets
from inspect3d.correlation.conjugate import conjugate
from inspect3d.correlation.evaluation import centres, evaluation_points, points_per_edge
from inspect3d.correlation.factor import Ordering
from inspect3d.correlation.freedom import COLUMNS, Freedom, Lens
from inspect3d.correlation.picture import Pictures, Stack
from inspect3d.correlation.reading_kernel import lens_slope
from inspect3d.correlation.seen import scene
from inspect3d.correlation.visibility import visibility
from inspect3d.nominal.nominal import Nominal
from inspect3d.nominal.surface import Surface
from tests.jit import printed
from tests.seen_sheets import STEEPEST, accumulated, flat_sheet, wavy_sheet
from tests.sheets import plane, plane_normals, sheet
from tests.speckled import rig


@pytest.fixture(scope="module")
def flat():
    return flat_sheet()


@pytest.fixture(scope="module")
def wavy():
    return wavy_sheet()


def test_a_sampled_picture_goes_through_its_pixels_and_its_gradient_is_its_slope():
    grey = np.random.default_rng(0).uniform(0, 255, (20, 30))
    stack = Pictures([grey, grey]).blurred(0.0)
    inside = np.stack(np.meshgrid(np.arange(2, 27), np.arange(2, 17)), axis=-1).reshape(-1, 2).astype(float)
    assert stack.sampled(0, inside)[:, 0] == pytest.approx(grey[2:17, 2:27].ravel(), abs=1e-4)
    places = inside[:-30] + np.array([0.3, 0.6])
    found, small = stack.sampled(1, places), 1e-5
    for axis in range(2):
        step = small * np.eye(2)[axis]
        slope = (stack.sampled(1, places + step)[:, 0] - stack.sampled(1, places - step)[:, 0]) / (2 * small)
        assert found[:, 1 + axis] == pytest.approx(slope, abs=1e-4)


def test_linear_sampling_is_exact_for_a_bilinear_picture():
    rows, columns = np.mgrid[:12, :15]
    grey = 3.0 + 2.0 * columns - rows + 0.5 * rows * columns
    places = np.random.default_rng(1).uniform(1, 10, (50, 2))
    x, y = places.T
    found = Pictures([grey, grey], "linear").blurred(0.0).sampled(0, places)
    assert found == pytest.approx(np.stack([3 + 2 * x - y + 0.5 * x * y, 2 + 0.5 * y, -1 + 0.5 * x], axis=1))


@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_the_points_of_a_facet_are_uniform(n):
    shapes = centres(n)
    assert len(shapes) == len(np.unique(shapes.round(9), axis=0)) == n * n
    assert (shapes > 0).all()
    assert shapes.sum(axis=1) == pytest.approx(1.0)
    assert shapes.mean(axis=0) == pytest.approx(1 / 3)
    assert shapes.T @ shapes / n**2 == pytest.approx((np.ones((3, 3)) + np.eye(3)) / 12, abs=0.1 / n**2)


def test_lifted_points_lie_on_the_surface_and_flat_ones_off_it_by_a_chord_that_falls_with_the_square_of_the_edge():
    chords = []
    for edge in (3.0, 1.5):
        nominal = sheet(edge=edge, fine=0.25)
        every = np.full(len(nominal.mesh.triangles), 4)
        lifted, _ = evaluation_points(nominal, every)
        assert np.abs(nominal.surface.closest(lifted.places).distance).max() < 1e-9
        chords.append(evaluation_points(nominal, every, lifted=False)[0].chord)
    assert chords[0] / chords[1] == pytest.approx(4.0, rel=0.25)


def test_a_facet_has_as_many_points_as_its_picture_has_room_for(flat):
    nominal, views, _ = flat
    count = points_per_edge(nominal.mesh, views, 4.0, least=1)
    pixels = views[0].project(nominal.mesh.nodes)[nominal.mesh.triangles]
    a, b = pixels[:, 1] - pixels[:, 0], pixels[:, 2] - pixels[:, 0]
    area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert (count**2 * 4.0 >= 0.95 * area).all()
    assert np.median(count**2 * 4.0 / area) < 1.25


def test_what_a_plate_in_front_of_the_part_hides_is_not_seen_by_that_camera(flat):
    nominal, views, _ = flat
    points, _ = evaluation_points(nominal, np.full(len(nominal.mesh.triangles), 4))
    every = whole_facets(nominal.mesh, points)
    middle = 0.5 * (views[0].centre + np.array([20.0, 20.0, 0.0]))
    corners = middle + np.array([[-6.0, -6, 0], [6, -6, 0], [6, 6, 0], [-6, 6, 0]])
    surface = nominal.surface
    both = Surface(
        np.concatenate([surface.vertices, corners]),
        np.concatenate([surface.triangles, np.array([[0, 1, 2], [0, 2, 3]]) + len(surface.vertices)]),
    )
    hidden = visibility(Nominal("hidden", both, nominal.mesh), every, views, STEEPEST, [None, None])
    free = visibility(nominal, every, views, STEEPEST, [None, None])
    shadow = (
        views[0].centre
        + (points.places - views[0].centre)
        * ((middle[2] - views[0].centre[2]) / (points.places[:, 2] - views[0].centre[2]))[:, None]
    )
    behind = (np.abs(shadow - middle)[:, :2] < 6).all(axis=1)
    assert behind.any()
    assert (hidden.seen[0] == (free.seen[0] & ~behind)).all()
    assert (hidden.seen[1] == free.seen[1]).all()
    assert not (hidden.used & ~(hidden.seen.all(axis=0))).any()


def test_what_is_masked_in_one_picture_is_not_used(flat):
    nominal, views, _ = flat
    points, _ = evaluation_points(nominal, np.full(len(nominal.mesh.triangles), 4))
    every = whole_facets(nominal.mesh, points)
    mask = np.ones((480, 620), bool)
    mask[:, :300] = False
    used = visibility(nominal, every, views, STEEPEST, [None, mask]).used
    assert used.any()
    assert (views[1].project(points.places[used])[:, 0] >= 299.5).all()


def test_the_right_hand_side_is_the_slope_of_the_energy_for_fixed_weights(wavy):
    _, views, seen, stack = wavy
    random = np.random.default_rng(3)
    deviation = random.normal(0, 0.003, len(seen.nodes))
    found = accumulated(seen, stack, views, deviation)
    step = random.normal(0, 1e-4, len(seen.nodes)) + 0.01 * deviation
    weights = found.energy / (1 - found.correlation)
    ahead, back = (weights @ (1 - accumulated(seen, stack, views, deviation + k * step).correlation) for k in (1, -1))
    assert -seen.gathered(found.right) @ step == pytest.approx((ahead - back) / 4, rel=0.05)


def test_the_slopes_of_a_lens_are_those_of_its_projection():
    view = rig(distortion=(-0.1, 0.2, 1e-3, -1e-3, 0.1))[0]
    free = Freedom("known", (Lens(1.0, 1.0, (1.0,) * 5, 1.0, 1.0),), (view,), np.zeros(3))
    point = np.array([[0.05, -0.08, 1.0]])
    for k, columns in enumerate(COLUMNS):
        step = 1e-3 * np.eye(len(COLUMNS))[k]
        ahead, back = (free.moved((view,), sign * step)[0].camera.project(point)[0] for sign in (1, -1))
        slope = sum(
            np.array(lens_slope(column, view.camera.matrix, view.camera.distortion, *point[0, :2]))
            for column in columns
        )
        assert slope == pytest.approx((ahead - back) / 2e-3, rel=1e-6, abs=1e-8)


def test_gradient_noise_is_told_from_curvature(wavy):
    _, views, seen, stack = wavy
    random = np.random.default_rng(4)
    exact = accumulated(seen, stack, views, columns=np.empty(0, np.int64))
    levels = stack.levels + 0.0
    for level in levels:
        level += spline_filter(random.normal(0, 12.0, level.shape), order=3, mode="mirror")
    noisy = accumulated(seen, type(stack)(levels, stack.sizes, True), views, columns=np.empty(0, np.int64))
    curvature = np.trace(exact.node.sum(axis=0))
    assert np.trace(noisy.node.sum(axis=0)) > 1.03 * curvature
    cleaned = np.einsum("fii,f->", noisy.node, noisy.clean)
    assert cleaned == pytest.approx(curvature, rel=0.02)
    assert exact.clean.min() > 0.98


def test_a_sparse_factor_solves_and_inverts_as_a_dense_one_does():
    random = np.random.default_rng(0)
    dense = np.where(random.uniform(size=(60, 60)) < 0.06, random.normal(size=(60, 60)), 0.0)
    matrix = sparse.csr_matrix(dense @ dense.T + np.eye(60))
    matrix.sort_indices()
    ordering = Ordering(matrix.indptr.astype(np.int64), matrix.indices.astype(np.int64))
    factor, inverse = ordering.factor(matrix.data), np.linalg.inv(matrix.toarray())
    right = random.normal(size=(60, 3))
    assert factor.solve(right) == pytest.approx(inverse @ right)
    assert factor.solve(right[:, 0]) == pytest.approx(inverse @ right[:, 0])
    assert factor.inverse_diagonal == pytest.approx(np.diag(inverse))
    rows = sparse.csr_matrix(np.where(matrix.toarray() != 0, 1.0, 0.0) * np.eye(60))
    assert factor.quadratic(rows) == pytest.approx(np.diag(inverse))
    with pytest.raises(ValueError, match="positive definite"):
        ordering.factor(-matrix.data)


def test_the_smoother_takes_the_bias_of_linear_elements_off_a_parabola():
    nominal, views = sheet(plane, plane_normals, edge=3.0), rig()
    seen = scene(nominal, views, 20.0, STEEPEST, [None, None])
    x, y = seen.nodes[:, 0], seen.nodes[:, 1]
    wanted = (x - 30) ** 2 / 500
    centre = np.einsum("pi,pij->pj", seen.points.shapes, seen.nodes[seen.triangles[seen.points.facet]])
    shapes = sparse.csr_matrix(
        (seen.points.shapes.ravel(), seen.triangles[seen.points.facet].ravel(), 3 * np.arange(len(centre) + 1))
    )
    fitted = sparse.linalg.spsolve((shapes.T @ shapes).tocsc(), shapes.T @ ((centre[:, 0] - 30) ** 2 / 500))
    inner = (x > 9) & (x < 51) & (y > 9) & (y < 36)
    smooth = seen.smoother(np.ones(len(seen.triangles))) @ fitted
    assert np.abs(fitted - wanted)[inner].max() > 0.0025
    assert np.abs(smooth - wanted)[inner].max() < 0.0004


PROGRAM = """
import numpy as np
from tests.seen_sheets import ALL, STEEPEST, accumulated
from tests.sheets import sheet
from tests.speckled import rig
from inspect3d.correlation.picture import Pictures
from inspect3d.correlation.reading_kernel import lens_slope
from inspect3d.correlation.seen import scene
nominal, views = sheet(edge=30.0, fine=7.5), rig()
seen = scene(nominal, views, 1e9, STEEPEST, [None, None])
random = np.random.default_rng(0)
found = accumulated(seen, Pictures([random.uniform(0, 255, (480, 620)) for _ in views]).blurred(2.0), views)
print(*(abs(part).sum() for part in (found.node, found.right, found.cross, found.camera, found.statistics)))
matrix = seen.assembled(found.node) + seen.plate
print(seen.ordering.factor(matrix).inverse_diagonal.sum())
"""


def test_the_kernels_say_the_same_with_the_compiler_on_and_off():
    compiled, plain = (np.array(printed(PROGRAM, jit).split(), float) for jit in (True, False))
    assert compiled == pytest.approx(plain, rel=1e-6)


def test_points_near_the_outline_of_the_part_are_not_used(flat):
    nominal, views, _ = flat
    points, _ = evaluation_points(nominal, np.full(len(nominal.mesh.triangles), 12))
    every = whole_facets(nominal.mesh, points)
    used = visibility(nominal, every, views, STEEPEST, [None, None]).used
    rim = np.concatenate([np.stack([np.linspace(0, 60, 500), np.full(500, y), np.zeros(500)], 1) for y in (0.0, 45.0)])
    for view in views:
        near, edge = view.project(points.places[used]), view.project(rim)
        assert min(np.linalg.norm(edge - pixel, axis=1).min() for pixel in near) > 3.0
    assert used.mean() > 0.9


def test_a_pictures_coefficients_are_those_of_the_cubic_spline():
    grey = np.random.default_rng(0).uniform(0, 255, (40, 300))
    for turned in (grey, grey.T):
        stack = Pictures([turned, turned]).blurred(0.0)
        assert stack.levels[0] == pytest.approx(spline_filter(turned, order=3, mode="mirror"), abs=2e-4)


@pytest.mark.parametrize("blur", [3.0, 6.0])
def test_a_blurred_picture_with_fewer_pixels_shows_the_same(blur):
    grey = gaussian_filter(np.random.default_rng(0).normal(0, 500, (160, 200)), 1.0)
    full = spline_filter(gaussian_filter(grey, blur, mode="nearest"), order=3, mode="mirror")
    places = np.random.default_rng(1).uniform(20, 140, (500, 2))
    stack = Pictures([grey, grey]).blurred(blur)
    exact = Stack(full[None].astype(np.float32), np.array([[200, 160]]), True).sampled(0, places)
    assert stack.step == blur / 1.5
    assert np.abs(stack.sampled(0, places) - exact).max(axis=0) == pytest.approx(0, abs=0.03 * exact[:, 0].std())


def test_a_factor_of_many_panels_inverts_and_helps_with_a_matrix_like_it():
    seen = scene(sheet(edge=2.0), rig(), 20.0, STEEPEST, [None, None])
    random = np.random.default_rng(0)
    blocks = random.uniform(0.5, 1, len(seen.triangles))[:, None, None] * (np.ones((3, 3)) + np.eye(3))
    values = seen.assembled(blocks) + 0.1 * seen.plate
    factor, dense = seen.ordering.factor(values), seen.matrix(values).toarray()
    assert np.diff(seen.ordering.shape[2]).max() > 8
    assert factor.inverse_diagonal == pytest.approx(np.diag(np.linalg.inv(dense)))
    right = random.normal(size=len(dense))
    assert dense @ factor.solve(right) == pytest.approx(right)
    found = conjugate(seen.matrix(1.05 * values), right, factor.solve, 6)
    assert found == pytest.approx(np.linalg.solve(1.05 * dense, right))
    other = seen.assembled(random.uniform(0, 1, len(blocks))[:, None, None] ** 20 * blocks)
    assert conjugate(seen.matrix(other + 1e-6 * seen.plate), right, factor.solve, 6) is None


def test_a_matrix_without_a_plate_is_solved_with_its_diagonal_in_few_steps():
    seen, random = scene(sheet(edge=2.0), rig(), 20.0, STEEPEST, [None, None]), np.random.default_rng(0)
    blocks = random.uniform(0.5, 1, len(seen.triangles))[:, None, None] * (np.ones((3, 3)) + np.eye(3))
    matrix = seen.matrix(seen.assembled(blocks))
    wanted = random.normal(size=len(seen.nodes))
    found = conjugate(matrix, matrix @ wanted, lambda rest: rest / matrix.diagonal(), 12)
    assert found == pytest.approx(wanted, abs=0.05)


def test_a_part_of_a_scene_is_factored_in_the_order_of_the_whole_and_times_a_number():
    seen, random = scene(sheet(edge=2.0), rig(), 20.0, STEEPEST, [None, None]), np.random.default_rng(0)
    part, node = seen.restricted(random.uniform(size=len(seen.triangles)) < 0.8)
    values = part.assembled(np.tile(np.ones((3, 3)) + np.eye(3), (len(part.triangles), 1, 1))) + 0.1 * part.plate
    factor, inverse = part.ordering.factor(values), np.linalg.inv(part.matrix(values).toarray())
    assert len(node) < len(seen.nodes)
    assert len(factor.lower) < len(seen.ordering.shape[1])
    assert factor.inverse_diagonal == pytest.approx(np.diag(inverse))
    assert factor.times(4.0).inverse_diagonal == pytest.approx(np.diag(inverse) / 4)
    assert factor.times(4.0).solve(inverse[0]) == pytest.approx(inverse @ inverse[0] / 4)


def test_a_point_sees_a_target_unless_its_ray_meets_the_surface_before(wavy):
    surface, random = wavy[0].surface, np.random.default_rng(0)
    points, target = random.uniform([0, 0, -8], [60, 45, 8], (400, 3)), np.array([30.0, 20.0, 40.0])
    away = np.linalg.norm(target - points, axis=1)
    met = surface.first_hit(points, target - points, away).triangle >= 0
    assert 50 < met.sum() < 350
    np.testing.assert_array_equal(surface.hides(points, target), met)
    with pytest.raises(ValueError, match="target itself"):
        surface.hides(points, points[3])
