"""Where rays first meet a surface, against brute force and exact truths."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from bodies import CLOSED, brute_hits, grid_box, scattered, square, turned

from inspect3d.nominal.surface import Surface


@pytest.mark.parametrize("name", ["box", "star", "torus", "knife of 10 degrees"])
def test_rays_end_where_brute_force_ends_them(name):
    vertices, triangles = turned(CLOSED[name](), 11)
    rng = np.random.default_rng(12)
    origins = vertices.mean(axis=0) + rng.uniform(-60, 60, (2000, 3))
    targets = scattered(vertices, triangles, 2000, seed=13)
    directions = (targets - origins) / np.linalg.norm(targets - origins, axis=1, keepdims=True)
    hits = Surface(vertices, triangles).first_hit(origins, 5.0 * directions)
    true = brute_hits(origins, directions, vertices, triangles)
    grazing = np.isinf(hits.distance) != np.isinf(true)
    assert np.count_nonzero(grazing) <= 2
    np.testing.assert_allclose(hits.distance[~grazing], true[~grazing], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(hits.triangle == -1, np.isinf(hits.distance))


def test_no_ray_leaves_a_closed_body_through_an_edge_or_a_vertex():
    vertices, triangles = turned(trimesh.creation.icosphere(subdivisions=2, radius=20.0), 14)
    surface = Surface(vertices, triangles)
    corners = vertices[triangles]
    share = np.linspace(0, 1, 21)[:, None, None]
    on_edges = (share * corners[:, 0] + (1 - share) * corners[:, 1]).reshape(-1, 3)
    inside = vertices.mean(axis=0) + np.array([1.0, 2.0, 3.0])
    hits = surface.first_hit(inside, on_edges - inside)
    np.testing.assert_allclose(hits.distance, np.linalg.norm(on_edges - inside, axis=1), rtol=0, atol=1e-9)


def test_rays_along_the_axes_meet_a_box_where_they_should():
    surface = Surface(grid_box().vertices, grid_box().faces)
    directions = np.concatenate([np.eye(3), -np.eye(3)])
    np.testing.assert_array_equal(surface.first_hit([0, 0, 0], directions).distance, 2.0)
    np.testing.assert_array_equal(surface.first_hit(-6 * directions, directions).distance, 4.0)
    np.testing.assert_array_equal(surface.first_hit(6 * directions, directions).distance, np.inf)
    np.testing.assert_array_equal(surface.first_hit(-6 * directions, directions, reach=3.9).triangle, -1)
    assert (surface.first_hit(-6 * directions, directions, reach=4.0).triangle >= 0).all()


def test_a_ray_needs_a_direction():
    with pytest.raises(ValueError, match="direction zero"):
        square().first_hit([0, 0, 1], [0, 0, 0])
    with pytest.raises(ValueError, match="shape"):
        square().first_hit(np.zeros((2, 3)), np.zeros((2, 2, 3)))
