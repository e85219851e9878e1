"""Clouds of unknown scale: the algebra of similarities, and the scale taken from the CAD or refused."""

import numpy as np
import pytest

from inspect3d.deviate.deviate import Deviate
from inspect3d.measure import Cloud
from inspect3d.pose import Pose
from inspect3d.register.alignment import NoAlignmentError
from inspect3d.register.landmarks import landmark_covariance, similarity_from_landmarks
from inspect3d.register.register import Register
from inspect3d.register.similarity import Similarity
from tests.sheets import plane, plane_normals, scanned, sheet
from tests.test_register import any_pose


def any_similarity(seed):
    return Similarity(any_pose(seed), float(np.exp(np.random.default_rng(seed).uniform(-3, 3))))


def test_similarities_chain_and_undo():
    points = np.random.default_rng(0).normal(size=(20, 3))
    one, other = any_similarity(1), any_similarity(2)
    np.testing.assert_allclose((one @ other)(points), one(other(points)))
    np.testing.assert_allclose((one @ one.inverse())(points), points, atol=1e-9)
    homogeneous = np.column_stack([points, np.ones(20)])
    np.testing.assert_allclose(homogeneous @ one.matrix[:3].T, one(points))


def test_a_small_growth_is_about_its_origin():
    origin = np.array([3.0, -2.0, 5.0])
    grown = Similarity.small(np.array([0, 0, 0, 0, 0, 0, 0.01]), origin)
    np.testing.assert_allclose(grown(origin[None]), origin[None])
    np.testing.assert_allclose(grown(origin[None] + [1.0, 0, 0]), origin[None] + [1.01, 0, 0])
    assert Similarity.small(np.zeros(6), origin).scale == 1.0


def test_landmarks_tell_the_scale_and_how_well():
    random = np.random.default_rng(0)
    cad, truth = random.uniform(-50, 50, (6, 3)), any_similarity(3)
    measured = truth.inverse()(cad)
    found = similarity_from_landmarks(measured, cad, grows=True)
    np.testing.assert_allclose(found.matrix, truth.matrix, rtol=1e-9, atol=1e-9)
    origin = cad.mean(axis=0)
    shifts, claims = [], []
    for _ in range(400):
        noisy = measured + random.normal(0, 0.1 / truth.scale, measured.shape)
        error = similarity_from_landmarks(noisy, cad, grows=True) @ truth.inverse()
        shifts.append(np.concatenate([error.pose.rotation_vector, error(origin[None])[0] - origin]))
        claims.append(np.diag(landmark_covariance(noisy, cad, origin, grows=True)))
    ratio = np.std(shifts, axis=0) / np.sqrt(np.mean(claims, axis=0))
    assert ((ratio > 0.85) & (ratio < 1.15)).all(), ratio


@pytest.mark.parametrize("seed", range(2))
def test_a_cloud_in_any_unit_takes_its_scale_from_the_cad(seed):
    nominal, random = sheet(), np.random.default_rng(seed)
    points, _ = scanned(random, 8000, noise=0.02)
    points[:400] = random.uniform([0, 0, -6], [60, 45, 6], (400, 3))
    scan_from_cad = any_similarity(seed)
    cloud = Cloud("cloud", scan_from_cad(points))
    alignment = Register(nominal, scale_known=False)(cloud)
    (placed,) = Deviate(scale_known=False)((cloud,), (alignment,), nominal, np.ones(len(nominal.mesh), bool)).alignments
    assert placed.scale * scan_from_cad.scale == pytest.approx(1.0, abs=1e-3)
    nodes, normals = nominal.mesh.nodes, nominal.mesh.normals
    for found in (alignment, placed):
        along = np.abs(np.einsum("ni,ni->n", found(scan_from_cad(nodes)) - nodes, normals))
        assert along.max() < 0.01


def test_the_growth_of_the_part_is_taken_out_only_where_the_scale_is_unknown():
    nominal = sheet()
    points, _ = scanned(np.random.default_rng(3), 12_000, noise=0.005)
    cloud, counted = Cloud("cloud", 1.002 * points), np.ones(len(nominal.mesh), bool)
    known = Register(nominal, start=Pose.identity())(cloud)
    free = Register(nominal, start=Pose.identity(), scale_known=False)(cloud)
    kept = Deviate()((cloud,), (known,), nominal, counted).deviation
    taken = Deviate(scale_known=False)((cloud,), (free,), nominal, counted).deviation
    assert np.nanstd(kept.value) > 3 * np.nanstd(taken.value)
    assert np.nanmedian(np.abs(taken.value) / taken.sigma) < 1.0


def test_the_noise_of_a_cloud_is_in_its_own_unit():
    nominal = sheet()
    points, _ = scanned(np.random.default_rng(3), 8000, noise=0.02)
    cloud = Cloud("cloud", points / 50, noise=0.02 / 50)
    alignment = Register(nominal, start=Similarity(Pose.identity(), 50.0), scale_known=False)(cloud)
    found = Deviate(scale_known=False)((cloud,), (alignment,), nominal, np.ones(len(nominal.mesh), bool))
    assert found.noise == pytest.approx(0.02, rel=0.01)


def test_a_plane_has_no_scale_and_says_so():
    nominal = sheet(plane, plane_normals)
    points, _ = scanned(np.random.default_rng(1), 4000, plane, plane_normals, noise=0.01)
    with pytest.raises(NoAlignmentError, match="at any size"):
        Register(nominal, start=Pose.identity(), scale_known=False)(Cloud("cloud", points))
