"""Facets that do not follow the part are cut in four, and the map stays that of the inspection mesh."""

from __future__ import annotations

import numpy as np
import pytest

from inspect3d.correlation.correlate import ALIKE, UNFIT, Correlate
from inspect3d.correlation.finer import quartered
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.correlation.seen import scene
from inspect3d.correlation.words import remarks
from inspect3d.nominal.load import load_nominal
from inspect3d.virtual.milled import milled
from tests.seen_sheets import STEEPEST
from tests.sheets import plane, plane_normals, sheet
from tests.speckled import Speckle, photographed, picture, rig


def waves(x, y):
    """Return waves that elements of 10 mm do not follow, mm."""
    return 0.04 * np.sin(2 * np.pi * x / 22) * np.sin(2 * np.pi * y / 22)


def test_a_quarter_of_each_facet_and_the_halves_of_its_edges_lie_on_the_surface(tmp_path):
    milled().write_step(tmp_path / "milled.step")
    block = load_nominal(tmp_path / "milled.step", element_size=12.0)
    finer, ends = quartered(block)
    mesh, n = block.mesh, len(block.mesh)
    assert len(finer.mesh.triangles) == 4 * len(mesh.triangles)
    assert len(finer.mesh) - len(finer.mesh.triangles) / 2 == n - len(mesh.triangles) / 2
    np.testing.assert_array_equal(finer.mesh.nodes[:n], mesh.nodes)
    np.testing.assert_array_equal(ends[:n], np.repeat(np.arange(n), 2).reshape(-1, 2))
    assert block.surface.closest(finer.mesh.nodes[n:]).distance == pytest.approx(0, abs=1e-9)
    assert finer.mesh.areas.sum() == pytest.approx(mesh.areas.sum(), rel=0.02)
    corners = finer.mesh.nodes[finer.mesh.triangles]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    owned = ~finer.mesh.crease[finer.mesh.triangles].any(axis=1)
    assert ((outward * finer.mesh.normals[finer.mesh.triangles[:, 0]]).sum(axis=1) > 0)[owned].all()
    halves = ~finer.mesh.crease[n:]
    assert set(finer.mesh.face[n:][halves]) <= set(block.surface_face)


def test_a_field_that_is_linear_is_carried_to_the_finer_mesh_as_it_is():
    flat, views = sheet(plane, plane_normals, edge=7.5), rig()
    finer, ends = quartered(flat)
    coarse, fine = (scene(part, views, 6.0, STEEPEST, [None, None]) for part in (flat, finer))
    carried = fine.carried(coarse, 1 + coarse.nodes @ [0.2, -0.3, 0.0], ends)
    assert carried == pytest.approx(1 + fine.nodes @ [0.2, -0.3, 0.0])


@pytest.fixture(scope="module")
def wavy():
    """Return a sheet with elements of 10 mm and waves on it, measured."""
    nominal, views, random = sheet(edge=10.0), rig(), np.random.default_rng(1)
    speckle = Speckle.drawn(np.random.default_rng(0), 0.7)
    grey = [photographed(random, picture(view, speckle, waves), 2.4, 1.0, 0.0) for view in views]
    return nominal, Correlate()(nominal, grey, views)


def test_waves_between_the_nodes_are_followed_and_the_map_is_that_of_the_mesh(wavy):
    nominal, shape = wavy
    found = shape.deviation()
    assert shape.mesh is nominal.mesh
    assert len(found.value) == len(nominal.mesh)
    assert len(shape.scene.nodes) > 3 * len(nominal.mesh)
    known = Freedom("known", (Lens(), Lens()), shape.views, shape.scene.centre)
    (sentence,) = [words for words in remarks(shape, known) if "follow" in words]
    assert sentence.startswith("Elements of 10 mm do not follow the part: its shape was found with elements 4 times as")
    assert shape.uncertainty.fitting >= 1 - UNFIT
    assert shape.uncertainty.correlated <= ALIKE
    assert shape.quarterings == 2
    assert shape.scene.node.max() < len(nominal.mesh)
    assert (np.bincount(shape.scene.node[shape.scene.own]) <= 1).all()
    error = found.value - waves(nominal.mesh.nodes[:, 0], nominal.mesh.nodes[:, 1])
    z = (error / found.sigma)[found.observed]
    assert found.observed.mean() > 0.9
    assert 0.7 < np.sqrt((z**2).mean()) < 1.3


def test_elements_that_follow_the_part_stay_as_they_are():
    nominal, views, random = sheet(edge=10.0), rig(), np.random.default_rng(1)
    speckle = Speckle.drawn(np.random.default_rng(0), 0.7)
    grey = [photographed(random, picture(view, speckle, lambda x, y: 1e-4 * x), 2.4, 1.0, 0.0) for view in views]
    shape = Correlate()(nominal, grey, views)
    assert shape.quarterings == 0
    assert len(shape.scene.nodes) == len(nominal.mesh)
