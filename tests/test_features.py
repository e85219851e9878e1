"""Steps, waviness and scallops in marked places: their height, how sure it is, and when nothing is resolved."""

from dataclasses import replace

import numpy as np
import pytest

from inspect3d.compare.features import features_of_nodes, features_of_points
from inspect3d.compare.segmentation import Segmentation
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.map_covariance import Independent, MapCovariance
from inspect3d.pose import Pose
from inspect3d.recipe_feature import Feature
from inspect3d.recipe_types import Region
from inspect3d.register.alignment import Alignment
from inspect3d.virtual.deviation_field import Scallops, Step, Wave
from tests.sheets import DEPTH, WIDTH, plane, plane_normals, sheet

MESH = sheet(plane, plane_normals, edge=2.0).mesh
PLACE = Region(box=((5.0, 5.0, -1.0), (55.0, 40.0, 1.0)))
STEP = Feature(name="mismatch", kind="step", place=PLACE, across=(1.0, 0.0, 0.0), point=(30.0, 0.0, 0.0))
WAVES = Feature(name="facets", kind="waviness", place=PLACE, across=(1.0, 0.0, 0.0), wavelength=16.0)
SCALLOPS = Feature(name="scallops", kind="scallops", place=PLACE, across=(1.0, 0.0, 0.0), wavelength=4.0)
FORM = Wave(0.02, (0.004, 0.007, 0.0), 0.3)
SIGMA, NOISE = 0.004, 0.02
HELD = Alignment(Pose.identity(), 1.0, 0.0, np.zeros((6, 6)), np.zeros(3), np.ones(3, bool))


def of_points(feature, field, seed=0, noise=NOISE, count=20_000):
    """Return a feature as a noisy cloud shows it."""
    random = np.random.default_rng(seed)
    points = np.column_stack([random.uniform(0, WIDTH, count), random.uniform(0, DEPTH, count), np.zeros(count)])
    values = field(points) + random.normal(0, noise, count)
    return features_of_points((feature,), MESH, points, values, noise, HELD)[0]


def of_nodes(feature, field, seed=0, sigma=SIGMA):
    """Return a feature as a noisy map shows it."""
    values = field(MESH.nodes) + np.random.default_rng(seed).normal(0, sigma, len(MESH))
    deviation, covariance = mapped(values, sigma)
    return features_of_nodes((feature,), MESH, deviation, covariance, HELD)[0]


def mapped(values, sigma=SIGMA):
    """Return values at every node as a map with independent errors."""
    n = len(MESH)
    covariance = MapCovariance(np.arange(n), Independent(np.full(n, sigma**2)), np.zeros((n, 0)))
    return Deviation(values, np.full(n, sigma), np.ones(n, bool)), covariance


@pytest.mark.parametrize("measured", [of_points, of_nodes])
@pytest.mark.parametrize(
    ("feature", "field", "height"),
    [
        (STEP, Step(0.04, (30.0, 0.0, 0.0), (1.0, 0.0, 0.0)), 0.04),
        (WAVES, Wave(0.015, (1 / 16, 0.0, 0.0), 1.0), 0.03),
    ],
)
def test_a_feature_is_found_on_a_form_error_within_its_stated_uncertainty(measured, feature, field, height):
    z = []
    for seed in range(12):
        found = measured(feature, FORM + field, seed)
        assert found.resolved
        assert found.sigma < 0.003
        z.append((found.value - height) / found.sigma)
    assert np.sqrt(np.mean(np.square(z))) < 1.5  # of 12: exceeded with a probability of 1 % if sigma is true
    assert np.sqrt(np.mean(np.square(z))) > 0.5


def test_the_scallops_around_a_step_are_told_apart_from_it():
    narrow = Region(box=((26.0, 5.0, -1.0), (39.0, 40.0, 1.0)))
    field = Step(0.04, (30.0, 0.0, 0.0), (1.0, 0.0, 0.0)) + Scallops(0.012, 4.0, (1.0, 0.0, 0.0))
    told = STEP.model_copy(update={"place": narrow, "wavelength": 4.0})
    found = of_points(told, field)
    assert found.value == pytest.approx(0.04, abs=3 * found.sigma)
    assert abs(found.value - 0.04) < 0.5 * abs(
        of_points(told.model_copy(update={"wavelength": None}), field).value - 0.04
    )


def test_nodes_too_coarse_for_the_scallops_still_tell_the_step():
    field = FORM + Step(0.04, (30.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    found = of_nodes(STEP.model_copy(update={"wavelength": 4.0}), field)
    assert found.value == pytest.approx(0.04, abs=3 * found.sigma)


def test_lines_that_meet_a_wave_in_the_same_two_places_do_not_resolve_it():
    random, field = np.random.default_rng(7), Scallops(0.012, 4.0, (1.0, 0.0, 0.0))
    lines = np.repeat(np.arange(0.7, WIDTH, 2.0), 300)
    points = np.column_stack([lines, random.uniform(0, DEPTH, len(lines)), np.zeros(len(lines))])
    values = field(points) + random.normal(0, 0.005, len(points))
    (found,) = features_of_points((SCALLOPS,), MESH, points, values, 0.005, HELD)
    assert not found.resolved
    assert "same places" in found.reason


def test_the_sign_of_a_step_is_that_of_the_side_across():
    turned = STEP.model_copy(update={"across": (-1.0, 0.0, 0.0)})
    field = Step(0.04, (30.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert of_points(turned, field).value == pytest.approx(-0.04, abs=0.003)


def test_scallops_are_resolved_by_dense_points_and_not_by_coarse_nodes():
    field = FORM + Scallops(0.012, 4.0, (1.0, 0.0, 0.0))
    fine = of_points(SCALLOPS, field)
    assert fine.resolved
    assert fine.value == pytest.approx(0.012, abs=3 * fine.sigma)
    coarse = of_nodes(SCALLOPS, field)
    assert not coarse.resolved
    assert coarse.value is None
    assert "2 mm apart" in coarse.reason


@pytest.mark.parametrize("feature", [STEP, WAVES, SCALLOPS])
def test_a_feature_that_is_not_there_is_not_resolved(feature):
    resolved = [of_points(feature, FORM, seed, count=5000).resolved for seed in range(30)]
    assert np.mean(resolved) <= 0.2  # 6 of 30: exceeded with a probability of 0.3 % if it is 5 %


def test_correlated_errors_make_a_step_less_sure():
    random = np.random.default_rng(4)
    patches = random.normal(0, 0.01, (60, 45))
    values = patches[MESH.nodes[:, 0].astype(int) // 9, MESH.nodes[:, 1].astype(int) // 9]
    correlated = features_of_nodes((STEP,), MESH, *mapped(values), HELD)[0]
    independent = of_nodes(STEP, Wave(0.0, (0.0, 0.0, 0.0)), sigma=0.01)
    assert correlated.sigma > 2 * independent.sigma


def test_a_step_on_an_edge_carries_the_uncertainty_of_the_pose():
    folded = MESH.normals.copy()
    folded[MESH.nodes[:, 0] > 30] = [0.6, 0.0, 0.8]
    mesh, shifted = replace(MESH, normals=folded), replace(HELD, covariance=np.diag([0, 0, 0, 0.01**2, 0, 0]))
    deviation, covariance = mapped(np.zeros(len(MESH)), 1e-5)
    (flat,) = features_of_nodes((STEP,), MESH, deviation, covariance, shifted)
    (edge,) = features_of_nodes((STEP,), mesh, deviation, covariance, shifted)
    assert flat.sigma < 1e-4
    assert edge.sigma == pytest.approx(0.6 * 0.01, rel=0.01)


def test_where_nothing_was_measured_nothing_is_resolved():
    elsewhere = STEP.model_copy(update={"place": Region(box=((100.0, 0.0, 0.0), (110.0, 1.0, 1.0)))})
    assert "nothing was measured" in of_points(elsewhere, FORM).reason
    beside = STEP.model_copy(update={"point": (54.0, 0.0, 0.0)})
    assert "one side of the joint" in of_nodes(beside, FORM).reason


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [("point", None, "point"), ("kind", "waviness", "point"), ("across", (0.0, 0.0, 0.0), "not zero")],
)
def test_a_feature_that_lacks_what_it_needs_is_refused(key, value, words):
    table = {"name": "a", "kind": "step", "place": {"faces": (1,)}, "across": (1.0, 0.0, 0.0), "point": (0.0, 0.0, 0.0)}
    with pytest.raises(ValueError, match=words):
        Feature(**{**table, key: value})


def test_a_bump_and_a_dent_are_two_regions_with_their_area_height_and_place():
    x, y = MESH.nodes[:, 0], MESH.nodes[:, 1]
    bump = np.exp(-((x - 20) ** 2 + (y - 20) ** 2) / 2 / 4**2)
    dent = np.exp(-((x - 45) ** 2 + (y - 30) ** 2) / 2 / 3**2)
    noise = np.random.default_rng(5).normal(0, SIGMA, len(MESH))
    first, second = Segmentation()(*mapped(0.1 * bump - 0.06 * dent + noise), MESH)
    np.testing.assert_allclose(first.place, [20, 20, 0], atol=1)
    np.testing.assert_allclose(second.place, [45, 30, 0], atol=1)
    assert first.height == pytest.approx(0.1, abs=3 * SIGMA)
    assert second.height == pytest.approx(-0.06, abs=3 * SIGMA)
    assert first.area == pytest.approx(MESH.areas[np.abs(0.1 * bump) > 0.012].sum(), rel=0.2)
    assert first.significance > 20


def test_noise_alone_makes_no_region():
    noise = np.random.default_rng(6).normal(0, SIGMA, len(MESH))
    assert not Segmentation()(*mapped(noise), MESH)


def test_of_many_regions_those_with_most_material_are_told():
    noise = mapped(np.random.default_rng(6).normal(0, SIGMA, len(MESH)))
    few, every = (Segmentation(stands_out=0.5, certain=0.1, most=most)(*noise, MESH) for most in (5, 1000))
    volumes = [abs(region.mean) * region.area for region in every]
    assert len(every) > 10
    assert volumes == sorted(volumes, reverse=True)
    assert [region.mean for region in few] == [region.mean for region in every[:5]]
