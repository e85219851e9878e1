"""Nodes that a method has moved end in the common alignment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inspect3d.deviate.map_covariance import Independent
from inspect3d.deviate.nodes import DeviateNodes
from inspect3d.measure import NodalMeasurement
from inspect3d.outcome import MeasurementError, Status
from inspect3d.pose import Pose
from inspect3d.register.gauge import best_fit
from inspect3d.register.mobility import jacobian
from tests.sheets import plane, plane_normals, sheet
from tests.speckled import rig

NOMINAL = sheet(edge=4.0)
MESH = NOMINAL.mesh
EVERY = np.ones(len(MESH), bool)
MOTION = np.array([2e-4, -1e-4, 3e-4, 0.01, -0.02, 0.015])


def measured(value, sigma=0.002, mesh=MESH, **known):
    """Return nodes that have moved by `value`."""
    n = len(mesh)
    variances = np.full(n, sigma**2)
    return NodalMeasurement(np.arange(n), value, np.ones(n, bool), Independent(variances), Pose.identity(), **known)


def bump(height=0.05):
    """Return a local deviation."""
    return height * np.exp(-((MESH.nodes[:, 0] - 25) ** 2 + (MESH.nodes[:, 1] - 20) ** 2) / 2 / 6**2)


def test_a_rigid_motion_is_taken_out_and_stated():
    moved = jacobian(MESH.nodes, MESH.normals, np.zeros(3)) @ MOTION
    found = DeviateNodes()(measured(bump() + moved), NOMINAL, EVERY)
    still = DeviateNodes()(measured(bump()), NOMINAL, EVERY)
    np.testing.assert_allclose(found.deviation.value, still.deviation.value, atol=1e-5)
    back = found.alignment.cad_from_measured @ Pose.small(MOTION, np.zeros(3))
    np.testing.assert_allclose(back(MESH.nodes), still.alignment.cad_from_measured(MESH.nodes), atol=1e-3)
    assert found.alignment.status is Status.OK


def test_growth_is_taken_out_only_where_the_scale_is_not_known():
    grown = 2e-4 * (MESH.nodes * MESH.normals).sum(axis=1)
    free = DeviateNodes()(measured(grown, scale_known=False), NOMINAL, EVERY)
    known = DeviateNodes()(measured(grown), NOMINAL, EVERY)
    assert np.abs(free.deviation.value).max() < 1e-9
    assert free.alignment.scale == pytest.approx(1 - 2e-4, abs=1e-9)
    assert np.abs(known.deviation.value).max() > 1e-4
    assert known.alignment.scale == 1.0


def test_the_cameras_go_along_and_see_the_same():
    value = bump() + jacobian(MESH.nodes, MESH.normals, np.zeros(3)) @ MOTION
    views = rig()
    found = DeviateNodes()(measured(value, scale_known=False, views=views), NOMINAL, EVERY)
    points = MESH.nodes + value[:, None] * MESH.normals
    aligned = found.alignment.cad_from_measured(found.alignment.scale * points)
    for before, after in zip(views, found.views, strict=True):
        np.testing.assert_allclose(after.project(aligned), before.project(points), atol=1e-6)


def test_the_variance_is_that_of_the_best_fit():
    found = DeviateNodes()(measured(bump()), NOMINAL, EVERY)
    gauge = best_fit(MESH.nodes, MESH.normals, MESH.areas, bump())
    np.testing.assert_allclose(found.deviation.sigma**2, gauge.variances(np.full(len(MESH), 0.002**2)), rtol=1e-9)


def test_without_refinement_nothing_is_taken_out_if_the_place_was_known():
    value = bump() + 0.05
    found = DeviateNodes(refine=False)(measured(value, placed=True), NOMINAL, EVERY)
    np.testing.assert_allclose(found.deviation.value, value)
    np.testing.assert_allclose(found.deviation.sigma, 0.002)
    with pytest.raises(MeasurementError, match="leave refine away"):
        DeviateNodes(refine=False)(measured(value), NOMINAL, EVERY)


def test_paint_is_subtracted_and_in_the_uncertainty():
    still = {"placed": True}
    found = DeviateNodes(refine=False, coating=0.04, coating_sigma=0.005)(
        measured(bump() + 0.04, **still), NOMINAL, EVERY
    )
    np.testing.assert_allclose(found.deviation.value, bump(), atol=1e-12)
    np.testing.assert_allclose(found.deviation.sigma, np.hypot(0.002, 0.005))


def test_a_warm_part_is_shrunk_to_the_reference_temperature():
    warm = 2.3e-4 * (MESH.nodes * MESH.normals).sum(axis=1)
    found = DeviateNodes(refine=False, growth=2.3e-4)(measured(warm, placed=True), NOMINAL, EVERY)
    assert np.abs(found.deviation.value).max() < 1e-5


def test_a_plane_slides_and_says_so():
    flat = sheet(plane, plane_normals, edge=4.0)
    found = DeviateNodes()(
        measured(np.zeros(len(flat.mesh)) + 0.01, mesh=flat.mesh), flat, np.ones(len(flat.mesh), bool)
    )
    assert found.alignment.status is Status.FREE_MOTIONS
    assert len(found.alignment.free) == 3
    assert np.abs(found.deviation.value).max() < 1e-12


def test_nodes_that_are_left_out_or_out_of_reach_are_not_observed():
    counted = MESH.nodes[:, 0] < 50
    found = DeviateNodes(reach=0.03)(measured(bump()), NOMINAL, counted)
    np.testing.assert_array_equal(found.deviation.observed, counted & (bump() <= 0.03))


def test_a_map_of_a_few_nodes_is_no_map():
    few = replace(measured(bump()), sound=np.arange(len(MESH)) < 11)
    with pytest.raises(MeasurementError, match="Only 11 of"):
        DeviateNodes()(few, NOMINAL, EVERY)
