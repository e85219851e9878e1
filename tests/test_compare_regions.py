"""Regions in which a field differs from zero: found where they are, and not where they are not."""

import numpy as np
import pytest

from inspect3d.compare.patches import Patches
from inspect3d.compare.region_test import RegionTest
from inspect3d.deviate.map_covariance import Independent
from tests.sheets import sheet

MESH = sheet(edge=3.0).mesh
SIGMA = 0.005


class Neighbourly:
    """Errors that neighbours share: S = F F' for a matrix F (k, k)."""

    def __init__(self, factor):
        self.factor = factor
        self.variances = (factor**2).sum(axis=1)

    def covariance(self, columns):
        """Return it times columns."""
        return self.factor @ (self.factor.T @ columns)


def neighbourly(length=5.0):
    """Return errors that correlate over a length, and their factor."""
    squared = ((MESH.nodes[:, None] - MESH.nodes[None]) ** 2).sum(axis=2)
    kernel = np.exp(-squared / length**2)
    factor = SIGMA * kernel / np.linalg.norm(kernel, axis=1, keepdims=True)
    return Neighbourly(factor), factor


def bump(height):
    """Return a local deviation of 8 mm width (FWHM)."""
    x, y = MESH.nodes[:, 0], MESH.nodes[:, 1]
    return height * np.exp(-4 * np.log(2) * ((x - 30) ** 2 + (y - 21) ** 2) / 64)


def regions(values, covariance, **settings):
    """Return the regions of a field on the sheet."""
    return RegionTest(**settings)(values, covariance, MESH.nodes, MESH.normals, MESH.areas)


@pytest.mark.parametrize("correlated", [False, True])
def test_a_field_without_a_defect_shows_a_region_in_one_of_twenty(correlated):
    covariance, factor = (
        neighbourly() if correlated else (Independent(np.full(len(MESH), SIGMA**2)), SIGMA * np.eye(len(MESH)))
    )
    random = np.random.default_rng(0)
    false = [bool(regions(factor @ random.normal(size=len(MESH)), covariance, draws=300)) for _ in range(40)]
    assert np.mean(false) <= 0.175  # 7 of 40: exceeded with a probability of 0.1 % if it is 5 %


@pytest.mark.parametrize("correlated", [False, True])
def test_a_defect_of_several_sigma_is_one_region_at_its_place(correlated):
    covariance, factor = (
        neighbourly() if correlated else (Independent(np.full(len(MESH), SIGMA**2)), SIGMA * np.eye(len(MESH)))
    )
    noise = factor @ np.random.default_rng(1).normal(size=len(MESH))
    (found, *others) = regions(bump(-0.06) + noise, covariance)
    assert not others
    assert np.hypot(*(found.place[:2] - [30, 21])) < 2
    assert found.height == pytest.approx(-0.06, abs=0.02)
    assert 25 < found.area < 90  # the circle at half height has 50 mm²
    assert found.p_value < 0.005
    assert found.significance > 5


def test_wide_and_shallow_defects_are_found_that_no_single_node_shows():
    x = MESH.nodes[:, 0]
    wide = SIGMA * np.exp(-((x - 40) ** 2) / 2 / 8**2)
    noise = np.random.default_rng(2).normal(0, SIGMA, len(MESH))
    covariance = Independent(np.full(len(MESH), SIGMA**2))
    assert not regions(wide + noise, covariance, widths=(0.0,))
    (found,) = regions(wide + noise, covariance)
    assert found.place[0] == pytest.approx(40, abs=5)


def test_a_dent_beside_a_bump_is_a_region_of_its_own():
    x = MESH.nodes[:, 0]
    both = 0.05 * (np.exp(-((x - 25) ** 2) / 18) - np.exp(-((x - 37) ** 2) / 18))
    found = regions(both, Independent(np.full(len(MESH), SIGMA**2)))
    assert sorted(np.sign(region.mean) for region in found) == [-1, 1]


def test_a_defect_is_no_region_on_another_face_that_wide_windows_reach_it_from():
    upper = MESH.nodes + np.array([0.0, 0.0, 15.0])
    nodes, normals, areas = np.concatenate([MESH.nodes, upper]), np.tile(MESH.normals, (2, 1)), np.tile(MESH.areas, 2)
    noise = np.random.default_rng(3).normal(0, SIGMA, len(nodes))
    values = noise + np.concatenate([bump(0.5), np.zeros(len(MESH))])
    (found,) = RegionTest()(values, Independent(np.full(len(nodes), SIGMA**2)), nodes, normals, areas)
    assert found.nodes.max() < len(MESH)


def test_many_nodes_are_gathered_into_patches_with_the_covariance_of_their_means():
    covariance, factor = neighbourly()
    patches = Patches.of(MESH.nodes, MESH.normals, MESH.areas, 100)
    assert 50 < len(patches.places) < 200
    np.testing.assert_allclose(np.asarray(patches.means.sum(axis=1)).ravel(), 1)
    assert patches.areas.sum() == pytest.approx(MESH.areas.sum())
    means = patches.means.toarray()
    np.testing.assert_allclose(patches.covariance(covariance), means @ factor @ factor.T @ means.T, atol=1e-12)
    (found,) = regions(bump(0.06), covariance, most=150)
    assert np.hypot(*(found.place[:2] - [30, 21])) < 4


def test_windows_do_not_reach_through_a_thin_wall():
    nodes = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, -0.5], [1, 0, -0.5]])
    normals = np.array([[0.0, 0, 1], [0, 0, 1], [0, 0, -1], [0, 0, -1]])
    windows = Patches.of(nodes, normals, np.ones(4), 10).windows(1.0, np.ones(4)).toarray()
    assert (windows[:2, :2] > 0).all()
    assert (windows[:2, 2:] == 0).all()
