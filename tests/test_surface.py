"""The closest point of a surface, and on which side of it one is, against brute force and exact truths."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import (
    CLOSED,
    brute_distances,
    brute_inside,
    grid_box,
    scattered,
    square,
    star,
    to_segments,
    turned,
    wedge,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from inspect3d.nominal.surface import Surface


def check_closed(name, count, seed):
    vertices, triangles = turned(CLOSED[name](), seed)
    points = scattered(vertices, triangles, count, seed)
    surface = Surface(vertices, triangles)
    feet = surface.closest(points)
    true = brute_distances(points, vertices, triangles)
    assert surface.closed
    assert not feet.on_rim.any()
    np.testing.assert_allclose(np.abs(feet.distance), true, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(points - feet.points, axis=1), true, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(feet.normals, axis=1), 1, rtol=0, atol=1e-12)
    judged = true > 1e-9
    wrong = (feet.distance < 0) != brute_inside(points, vertices, triangles)
    assert np.count_nonzero(wrong & judged) == 0


def check_open(name, count, seed):
    """Cut a third of the triangles out of a closed body.

    Whatever the distance, a point has the side of one next to its foot, and there the closed body knows the side, as
    far as what was cut out is not nearer.
    """
    vertices, triangles = turned(CLOSED[name](), seed)
    cut, kept = np.split(np.random.default_rng(seed).permutation(triangles), [len(triangles) // 3])
    points = scattered(vertices, triangles, count, seed + 1)
    surface = Surface(vertices, kept)
    feet = surface.closest(points)
    true = brute_distances(points, vertices, kept)
    np.testing.assert_allclose(np.abs(feet.distance), true, rtol=0, atol=1e-9)

    ends = vertices[surface.rim_edges]
    batches = np.array_split(feet.points, 50)
    to_rim = np.concatenate([to_segments(batch, ends[:, 0], ends[:, 1]).min(axis=1) for batch in batches])
    assert (to_rim[feet.on_rim] < 1e-9).all()

    slip = np.minimum(true, 1e-8)
    beside = feet.points + (points - feet.points) * (slip / np.maximum(true, 1e-12))[:, None]
    judged = (true > 1e-9) & ~feet.on_rim & (brute_distances(beside, vertices, cut) > 1.01 * slip)
    wrong = (feet.distance < 0) != brute_inside(beside, vertices, triangles)
    assert np.count_nonzero(judged) > count / 10
    assert np.count_nonzero(wrong & judged) == 0


@pytest.mark.parametrize("name", CLOSED)
def test_distances_and_sides_of_a_closed_surface_agree_with_brute_force(name):
    check_closed(name, 2000, seed=1)


@pytest.mark.parametrize("name", ["box", "star", "torus", "knife of 10 degrees", "tube"])
def test_an_open_surface_takes_the_sides_of_the_body_it_was_cut_from(name):
    check_open(name, 2000, seed=2)


@pytest.mark.parametrize("seed", range(3))
def test_at_the_tip_of_a_needle_the_side_is_right_although_two_edges_are_equally_near(seed):
    vertices, triangles = turned(CLOSED["foil of 1 nm"](), seed)
    rng = np.random.default_rng(seed)
    tips = triangles[rng.integers(len(triangles), size=3000)]
    along = vertices[tips[:, 1]] - vertices[tips[:, 0]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, rng.normal(size=(3000, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    points = vertices[tips[:, 0]] + along * 10 ** rng.uniform(-12, -6, (3000, 1))
    points += across * 10 ** rng.uniform(-8.9, 1, (3000, 1))
    distance = Surface(vertices, triangles).closest(points).distance
    wrong = (distance < 0) != brute_inside(points, vertices, triangles)
    assert np.count_nonzero(wrong & (np.abs(distance) > 1e-9)) == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10, 15))
@pytest.mark.parametrize("name", CLOSED)
def test_none_of_200000_points_is_on_the_wrong_side(name, seed):
    check_closed(name, 3000, seed)
    check_open(name, 2000, seed)


def test_where_edges_and_vertices_tie_exactly_the_side_is_right():
    mesh = grid_box()
    axis = np.arange(-4, 4.25, 0.25)
    points = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    outside = np.abs(points) - 2
    true = np.linalg.norm(np.maximum(outside, 0), axis=1) + np.minimum(outside.max(axis=1), 0)
    np.testing.assert_array_equal(Surface(mesh.vertices, mesh.faces).closest(points).distance, true)


@given(turn=st.integers(0, 1000), p=st.tuples(*[st.floats(-20, 30)] * 3))
@settings(max_examples=50, deadline=None)
def test_beyond_a_rim_the_foot_is_on_it_and_above_the_face_it_is_not(turn, p):
    rotation = Rotation.random(rng=turn).as_matrix()
    feet = square(rotation).closest(np.array([p]) @ rotation.T)
    margin = min(p[0], p[1], 10 - p[0], 10 - p[1])
    assert feet.on_rim[0] == (margin < 0) or abs(margin) < 1e-9
    assert np.sign(feet.distance[0]) == np.sign(p[2]) or abs(p[2]) < 1e-9


@given(p=st.tuples(*[st.floats(-50, 50)] * 3), q=st.tuples(*[st.floats(-50, 50)] * 3))
@settings(max_examples=50, deadline=None)
def test_a_signed_distance_changes_no_faster_than_the_point_moves(p, q):
    mesh = star()
    a, b = Surface(mesh.vertices, mesh.faces).closest([p, q]).distance
    assert abs(a - b) <= np.linalg.norm(np.subtract(p, q)) + 1e-9


def test_distances_move_with_the_part_and_change_sign_when_it_is_turned_inside_out():
    mesh = star()
    points = np.random.default_rng(3).uniform(-40, 40, (2000, 3))
    here = Surface(mesh.vertices, mesh.faces).closest(points)
    rotation = Rotation.random(rng=4).as_matrix()
    moved = Surface(mesh.vertices @ rotation.T + 7.0, mesh.faces).closest(points @ rotation.T + 7.0)
    inside_out = Surface(mesh.vertices, mesh.faces[:, ::-1]).closest(points)
    np.testing.assert_allclose(moved.distance, here.distance, rtol=0, atol=1e-9)
    np.testing.assert_allclose(inside_out.distance, -here.distance, rtol=0, atol=1e-12)


def test_far_from_the_origin_the_distances_keep_their_digits():
    mesh = star()
    shift = np.array([3e6, -5e6, 4e6])
    vertices = mesh.vertices + shift
    points = np.random.default_rng(5).uniform(-40, 40, (2000, 3)) + shift
    near = Surface(vertices - shift, mesh.faces).closest(points - shift)
    np.testing.assert_allclose(Surface(vertices, mesh.faces).closest(points).distance, near.distance, rtol=0, atol=1e-9)


def test_each_answer_is_the_same_in_any_company_and_any_order():
    mesh = star()
    surface = Surface(mesh.vertices, mesh.faces)
    points = np.random.default_rng(6).uniform(-40, 40, (3000, 3))
    together = surface.closest(points)
    order = np.random.default_rng(7).permutation(3000)[:1700]
    apart = surface.closest(points[order])
    for name in ("points", "distance", "normals", "triangle", "on_rim"):
        np.testing.assert_array_equal(getattr(apart, name), getattr(together, name)[order])


def test_points_on_the_surface_are_their_own_feet():
    mesh = star()
    corners = mesh.triangles
    points = np.concatenate([mesh.vertices, corners.mean(axis=1), corners[:, :2].mean(axis=1)])
    feet = Surface(mesh.vertices, mesh.faces).closest(points)
    np.testing.assert_allclose(feet.distance, 0, rtol=0, atol=1e-13)
    np.testing.assert_allclose(feet.points, points, rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(feet.normals, axis=1), 1, rtol=0, atol=1e-12)


def test_loose_triangles_behave_like_the_mesh_they_make_up():
    mesh = star()
    points = scattered(mesh.vertices, mesh.faces, 3000, seed=8)
    loose = Surface(mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    feet, true = loose.closest(points), Surface(mesh.vertices, mesh.faces).closest(points)
    assert loose.closed
    np.testing.assert_array_equal(feet.distance, true.distance)
    np.testing.assert_allclose(feet.normals, true.normals, rtol=0, atol=1e-12)


@pytest.mark.parametrize("turn", [None, 1, 2])
def test_triangles_without_area_change_no_distance_and_no_side(turn):
    """Split each edge of a knife and a box on one side only, and close the gap with a triangle without area."""
    for mesh in (wedge(10.0), grid_box()):
        rotation = np.eye(3) if turn is None else Rotation.random(rng=turn).as_matrix()
        vertices, triangles = mesh.vertices @ rotation.T, mesh.faces
        middle = len(vertices)
        a, b, c = triangles[0]
        split = np.concatenate([triangles[1:], [[a, middle, c], [middle, b, c], [a, b, middle], [a, a, b], [c, c, c]]])
        broken = Surface(np.concatenate([vertices, vertices[[[a, b]]].mean(axis=1)]), split)
        points = scattered(vertices, triangles, 3000, seed=9)
        feet, true = broken.closest(points), Surface(vertices, triangles).closest(points)
        np.testing.assert_allclose(np.abs(feet.distance), np.abs(true.distance), rtol=0, atol=1e-9)
        judged = np.abs(true.distance) > 1e-9
        np.testing.assert_array_equal(np.sign(feet.distance[judged]), np.sign(true.distance[judged]))
        assert not feet.on_rim.any()
        assert all(np.isfinite(array).all() for array in (feet.points, feet.distance, feet.normals))
        np.testing.assert_allclose(np.linalg.norm(feet.normals, axis=1), 1, rtol=0, atol=1e-12)


def test_a_hair_without_area_is_near_and_has_no_inside():
    vertices = [[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 50], [0, 0, 60], [0, 0, 55]]
    feet = Surface(vertices, [[0, 1, 2], [3, 4, 5]]).closest([[3, 4, 55], [0, 0, 57], [0, 0, 61]])
    np.testing.assert_allclose(feet.distance, [5, 0, 1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(feet.normals[0], [0.6, 0.8, 0], rtol=0, atol=1e-12)


def test_an_edge_of_three_triangles_has_the_sum_of_their_normals():
    vertices = [[0, 0, 0], [10, 0, 0], [5, 10, 0], [5, -10, 0], [5, 0, 10]]
    surface = Surface(vertices, [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    feet = surface.closest([[5, 0, 0]])
    np.testing.assert_allclose(feet.normals[0], np.array([0, -1, 2]) / np.sqrt(5), rtol=0, atol=1e-12)
    assert not surface.closed


@pytest.mark.parametrize("seed", range(20))
def test_any_heap_of_triangles_has_exact_distances_and_unit_normals(seed):
    """Triangles that cross, repeat, collapse and share edges by many, on whole numbers so that much ties."""
    rng = np.random.default_rng(seed)
    vertices = rng.integers(-4, 5, (20, 3)).astype(float)
    vertices[:, 2] *= 1e-7 ** (seed % 2)
    triangles = rng.integers(0, 20, (40, 3))
    points = np.concatenate([rng.normal(size=(200, 3)) * 8, rng.integers(-5, 6, (100, 3)), vertices])
    feet = Surface(vertices, triangles).closest(points)
    np.testing.assert_allclose(np.abs(feet.distance), brute_distances(points, vertices, triangles), rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(feet.normals, axis=1), 1, rtol=0, atol=1e-12)


def test_one_triangle_is_a_surface():
    surface = Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    feet = surface.closest([[0.2, 0.2, 3.0], [0.2, 0.2, -3.0], [3.0, 0, 4.0], [-3.0, -4.0, 1e-3]])
    np.testing.assert_allclose(feet.distance, [3, -3, np.hypot(2, 4), np.hypot(5, 1e-3)], rtol=1e-12)
    np.testing.assert_array_equal(feet.on_rim, [False, False, True, True])


def test_no_points_have_no_feet():
    feet = square().closest(np.empty((0, 3)))
    assert feet.points.shape == (0, 3)
    assert feet.distance.shape == (0,)
