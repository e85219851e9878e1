"""What the polynomial around a node does not follow is in the node's sigma, and hardly anything where it follows."""

from dataclasses import replace

import numpy as np
import pytest

from inspect3d.deviate.cloud_to_node import CloudToNode
from inspect3d.deviate.lack_of_fit import lack_of_fit
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.nominal.surface import Feet
from tests.sheets import DEPTH, WIDTH, grid, plane, plane_normals

EDGE, NOISE = 3.0, 0.01


def meshed():
    """Return a plane as an inspection mesh."""
    nodes, triangles = grid(plane, EDGE)
    n = len(nodes)
    return InspectionMesh(nodes, triangles, plane_normals(nodes[:, 0], nodes[:, 1]), np.zeros(n, bool), np.full(n, -1))


MESH = meshed()


def fitted(deviation, seed, count=10_000):
    """Return the fit to noisy points strewn over the plane, and the feet."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(0, WIDTH, count), random.uniform(0, DEPTH, count)
    feet = Feet(
        points=np.stack([x, y, 0 * x], axis=1),
        normals=plane_normals(x, y),
        distance=deviation(x, y) + NOISE * random.normal(size=count),
        triangle=np.zeros(count, np.int64),
        on_rim=np.zeros(count, bool),
    )
    return CloudToNode()(MESH, feet, np.ones(count, bool)), feet


def inner():
    """Return the nodes away from the rim of the sheet."""
    x, y = MESH.nodes[:, 0], MESH.nodes[:, 1]
    return (x > EDGE) & (x < WIDTH - EDGE) & (y > EDGE) & (y < DEPTH - EDGE)


@pytest.mark.parametrize("deviation", [lambda x, y: 0 * x, lambda x, y: 1e-4 * (x - y) ** 2 + 0.001 * x])
def test_hardly_anything_is_missed_of_a_quadratic_form(deviation):
    shares = []
    for seed in range(6):
        fit, _ = fitted(deviation, seed)
        assert (fit.missed[fit.observed] >= 0).all()
        shares.append(np.mean(fit.missed[fit.observed]) / np.mean(fit.variance[fit.observed]))
    assert np.mean(shares) < 0.15


def test_before_it_is_clipped_the_variance_missed_is_unbiased():
    told = np.ones(len(MESH), bool)
    random = np.random.default_rng(0)
    uncertain = NOISE**2 * random.uniform(0.5, 2, len(MESH))
    missed = 0.02**2
    found = [
        lack_of_fit(MESH, told, np.sqrt(uncertain + missed) * random.normal(size=len(MESH)), uncertain, uncertain)
        for _ in range(20)
    ]
    assert np.mean(found) == pytest.approx(missed, rel=0.03)


def test_sigma_becomes_true_on_ridges_that_the_polynomial_does_not_follow():
    def ridges(x, y):
        return 0.08 * np.cos(2 * np.pi * (x + 0.2 * y) / 5.3)

    bare, whole = [], []
    for seed in range(6):
        fit, _ = fitted(ridges, seed)
        seen = fit.observed & inner()
        off = fit.value[seen] - ridges(MESH.nodes[seen, 0], MESH.nodes[seen, 1])
        bare.append(off / np.sqrt(fit.variance[seen]))
        whole.append(off / np.sqrt(fit.variance[seen] + fit.missed[seen]))
    rms = [np.sqrt(np.mean(np.concatenate(z) ** 2)) for z in (bare, whole)]
    assert rms[0] > 1.5
    assert rms[1] == pytest.approx(1.0, abs=0.1)


def test_a_motion_of_part_and_points_together_changes_nothing():
    _, feet = fitted(lambda x, y: 0.02 * np.cos(x), 0)
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    mesh = replace(MESH, nodes=MESH.nodes @ turn.T + 5.0, normals=MESH.normals @ turn.T)
    moved = replace(feet, points=feet.points @ turn.T + 5.0, normals=feet.normals @ turn.T)
    fixed = CloudToNode(radius=(0.6, 0.6))  # it follows from the density along the axes otherwise
    here, there = (fixed(m, f, np.ones(len(f.distance), bool), NOISE) for m, f in ((MESH, feet), (mesh, moved)))
    np.testing.assert_array_equal(here.observed, there.observed)
    assert np.nanmax(here.missed) > np.nanmedian(here.variance)
    np.testing.assert_allclose(there.missed, here.missed, rtol=1e-6, atol=1e-12)


def test_nodes_with_too_few_points_for_the_further_term_get_nothing():
    few, _ = fitted(lambda x, y: 0.05 * np.cos(x), 0, count=400)
    assert few.observed.sum() > 50
    assert (few.missed[few.observed] == 0).all()


def test_nodes_where_the_further_term_tells_nothing_do_not_count_in_the_mean():
    told = np.zeros(len(MESH), bool)
    told[:40] = True
    some = lack_of_fit(MESH, told, np.full(40, 0.02), np.full(40, 1e-4), np.full(40, 1e-4))
    np.testing.assert_allclose(some, 0.02**2 - 1e-4)
    assert len(lack_of_fit(MESH, told & False, *np.zeros((3, 0)))) == 0
