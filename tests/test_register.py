"""Clouds found from any pose, refused where they do not fit, and named where they are not fixed."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from inspect3d.measure import Cloud
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.surface import Surface
from inspect3d.outcome import InputError, Status
from inspect3d.pose import Pose
from inspect3d.register.alignment import NoAlignmentError
from inspect3d.register.landmarks import landmark_covariance, pose_from_landmarks
from inspect3d.register.mobility import jacobian
from inspect3d.register.register import Register
from inspect3d.register.symmetry import is_symmetry, surface_points
from tests.jit import printed
from tests.sheets import plane, plane_normals, scanned, sheet


def box(size, subdivided=2):
    """A closed box, triangles outward, as a nominal part whose inspection mesh nobody needs here."""
    import trimesh

    mesh = trimesh.creation.box(size)
    for _ in range(subdivided):
        mesh = mesh.subdivide()
    surface = Surface(mesh.vertices, mesh.faces)
    count = len(mesh.vertices)
    none = np.zeros(count, bool)
    return Nominal(
        "box", surface, InspectionMesh(mesh.vertices, mesh.faces, mesh.vertex_normals, none, np.full(count, -1))
    )


def on_surface(surface, count, seed, noise=0.0):
    """Points at random on a surface, and its normals there."""
    from inspect3d.register.symmetry import surface_points

    points, normals = surface_points(surface, count, seed)
    return points + normals * np.random.default_rng(seed).normal(0, noise or 1e-12, count)[:, None], normals


def any_pose(seed):
    random = np.random.default_rng(seed)
    return Pose(Rotation.random(random_state=seed).as_matrix(), random.uniform(-300, 300, 3))


@pytest.mark.parametrize("seed", range(4))
def test_a_scan_with_foreign_points_is_found_from_any_pose(seed):
    nominal, random = sheet(), np.random.default_rng(seed)
    points, _ = scanned(random, 20_000, noise=0.02)
    points[:2000] = random.uniform([-10, -10, -12], [70, 55, 12], (2000, 3))
    scan_from_cad = any_pose(seed)
    alignment = Register(nominal)(Cloud("scan", scan_from_cad(points)))
    left = alignment.cad_from_measured @ scan_from_cad
    nodes = nominal.mesh.nodes
    along = np.abs(np.einsum("ni,ni->n", left(nodes) - nodes, nominal.mesh.normals))
    assert along.max() < 0.003
    assert alignment.status is Status.OK
    assert not alignment.free


def test_the_pose_turns_with_the_instrument():
    nominal = sheet()
    points, _ = scanned(np.random.default_rng(7), 8000, noise=0.01)
    register = Register(nominal)
    one, other = any_pose(1), any_pose(2)
    first = register(Cloud("scan", one(points))).cad_from_measured @ one
    second = register(Cloud("scan", other(points))).cad_from_measured @ other
    np.testing.assert_allclose(first(nominal.mesh.nodes), second(nominal.mesh.nodes), atol=2e-3)


def test_the_claimed_covariance_tells_the_scatter_of_the_pose():
    nominal = sheet()
    nodes, normals = nominal.mesh.nodes, nominal.mesh.normals
    register = Register(nominal, start=Pose.identity())
    found, claimed = [], []
    for seed in range(40):
        points, _ = scanned(np.random.default_rng(seed), 3000, noise=0.03)
        alignment = register(Cloud("scan", points))
        moved = alignment.cad_from_measured(nodes) - nodes
        rows = jacobian(nodes, normals, alignment.origin)
        found.append(np.einsum("ni,ni->n", moved, normals))
        claimed.append(np.einsum("ni,ij,nj->n", rows, alignment.covariance, rows))
    ratio = np.sqrt(np.mean(np.square(found)) / np.mean(claimed))
    assert 0.8 < ratio < 1.25


def test_a_box_is_symmetric_and_the_smallest_turn_is_taken():
    nominal = box([60.0, 40.0, 25.0])
    points, normals = on_surface(nominal.surface, 6000, 3, noise=0.01)
    turn = Pose(Rotation.from_rotvec([0.02, -0.03, 0.05]).as_matrix(), np.array([5.0, -3.0, 2.0]))
    alignment = Register(nominal)(Cloud("scan", turn(points), turn.turned(normals)))
    assert alignment.status is Status.SYMMETRIC
    left = alignment.cad_from_measured @ turn
    assert np.degrees(left.angle) < 0.1
    half = Pose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
    assert is_symmetry(nominal.surface, half)
    assert not is_symmetry(nominal.surface, Pose(Rotation.from_rotvec([0, 0, np.pi / 2]).as_matrix(), np.zeros(3)))


def test_one_face_of_a_cube_leaves_six_poses_and_is_ambiguous():
    nominal = box([30.0, 40.0, 50.0])
    random = np.random.default_rng(0)
    patch = np.stack([random.uniform(-8, 8, 4000), random.uniform(-8, 8, 4000), random.normal(0, 0.01, 4000)], axis=1)
    with pytest.raises(NoAlignmentError, match="equally well") as refused:
        Register(nominal)(Cloud("patch", patch, np.tile([0.0, 0.0, 1.0], (4000, 1))))
    assert refused.value.status is Status.AMBIGUOUS
    assert len(refused.value.candidates) > 1


def test_a_sheet_without_relief_is_measured_with_its_motions_held():
    nominal = sheet(plane, plane_normals)
    points, _ = scanned(np.random.default_rng(1), 5000, plane, plane_normals, noise=0.01)
    alignment = Register(nominal, start=Pose.identity())(Cloud("scan", points + np.array([0.0, 0.0, 0.4])))
    assert alignment.status is Status.FREE_MOTIONS
    assert len(alignment.free) == 3
    np.testing.assert_allclose(alignment.cad_from_measured.translation, [0, 0, -0.4], atol=2e-3)
    for motion in alignment.free:
        np.testing.assert_allclose(alignment.covariance @ motion.direction, 0, atol=1e-9)


@pytest.mark.parametrize(("factor", "words"), [(1e-3, "1000 times"), (1 / 25.4, "25.4 times"), (10.0, "a tenth")])
def test_wrong_units_are_refused_with_the_factor(factor, words):
    nominal = sheet()
    points, normals = scanned(np.random.default_rng(5), 6000, noise=0.02)
    pose = any_pose(4)
    with pytest.raises(NoAlignmentError, match=words):
        Register(nominal)(Cloud("scan", factor * pose(points), pose.turned(normals)))


def test_another_part_is_refused_with_its_best_candidates():
    nominal = box([60.0, 40.0, 25.0])
    points, normals = scanned(np.random.default_rng(5), 6000, noise=0.02)
    with pytest.raises(NoAlignmentError) as refused:
        Register(nominal)(Cloud("scan", 2.0 * points, normals))
    assert refused.value.candidates
    assert "scan" in str(refused.value)


def test_three_points_are_too_few():
    with pytest.raises(NoAlignmentError, match="3 points"):
        Register(sheet())(Cloud("few", np.eye(3)))


def test_a_given_pose_is_kept_when_it_is_not_to_be_refined():
    nominal = sheet()
    points, _ = scanned(np.random.default_rng(5), 6000, noise=0.02)
    start = Pose(np.eye(3), np.array([0.0, 0.0, 0.05]))
    alignment = Register(nominal, start=start, refine=False)(Cloud("scan", points))
    np.testing.assert_allclose(alignment.cad_from_measured.matrix, start.matrix, atol=1e-12)
    assert not alignment.covariance.any()


def test_landmarks_give_the_exact_pose_and_a_true_covariance():
    random = np.random.default_rng(0)
    cad = random.uniform(-50, 50, (6, 3))
    cad_from_measured = any_pose(3)
    measured = cad_from_measured.inverse()(cad)
    np.testing.assert_allclose(pose_from_landmarks(measured, cad).matrix, cad_from_measured.matrix, atol=1e-9)
    origin = cad.mean(axis=0)
    turns, claims = [], []
    for _ in range(500):
        noisy = measured + random.normal(0, 0.1, measured.shape)
        error = pose_from_landmarks(noisy, cad) @ cad_from_measured.inverse()
        turn = Rotation.from_matrix(error.rotation).as_rotvec()
        turns.append(np.concatenate([turn, error(origin[None])[0] - origin]))
        claims.append(np.diag(landmark_covariance(noisy, cad, origin)))
    ratio = np.std(turns, axis=0) / np.sqrt(np.mean(claims, axis=0))
    assert ((ratio > 0.85) & (ratio < 1.15)).all(), ratio


def test_landmarks_on_a_line_are_refused():
    line = np.outer(np.arange(4.0), [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="one line"):
        pose_from_landmarks(line, line)


def test_the_search_kernels_agree_with_the_jit_off():
    program = """
import numpy as np
from inspect3d.register.search_kernel import costs, descend, solve_spd
random = np.random.default_rng(0)
a = random.normal(size=(6, 6)); a = a @ a.T + np.eye(6); b = random.normal(size=6)
np.testing.assert_allclose(solve_spd(a.copy(), b.copy()), np.linalg.solve(a, b), rtol=1e-9)
from inspect3d.register.field import Field
axis = np.linspace(-2, 2, 9)
centres = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
feet = centres * [1, 1, 0]
normals = np.broadcast_to([0.0, 0.0, 1.0], feet.shape).copy()
points = random.uniform(-1, 1, (40, 3)) * [1, 1, 0]
none = np.zeros_like(points)
rotations, translations, sizes = np.eye(3)[None].copy(), np.array([[0.0, 0.0, 0.3]]), np.ones(1)
grid = (np.full(3, -2.0), 0.5, feet, normals)
before = costs(rotations, translations, sizes, points, none, False, 1.0, *grid)[0]
descend(rotations, translations, sizes, False, points, none, False, np.full(10, 1.0), points.mean(axis=0), 1.0, *grid)
print(f"{before:.12f} {translations[0, 2]:.12f}")
assert abs(before - 0.3) < 1e-12 and abs(translations[0, 2]) < 1e-6
"""
    with_jit, without = (printed(program, jit) for jit in (True, False))
    assert with_jit == without


@pytest.mark.parametrize("started", [False, True])
def test_normals_that_point_into_the_material_do_not_hinder(started):
    nominal = sheet()
    points, normals = scanned(np.random.default_rng(5), 6000, noise=0.02)
    pose = any_pose(8)
    start = Pose.small(np.array([2e-3, -1e-3, 2e-3, 0.1, -0.1, 0.2]), np.zeros(3)) @ pose.inverse() if started else None
    register = Register(nominal, start=start)
    inward = register(Cloud("scan", pose(points), -pose.turned(normals))).cad_from_measured
    plain = register(Cloud("scan", pose(points))).cad_from_measured
    assert np.abs((inward @ pose)(nominal.mesh.nodes) - nominal.mesh.nodes).max() < 0.02
    np.testing.assert_allclose(inward(pose(points)), plain(pose(points)), atol=1e-3)


def test_points_of_the_cad_itself_lie_on_it():
    nominal = box((60.0, 40.0, 20.0))
    points, _ = surface_points(nominal.surface, 3000)
    alignment = Register(nominal, start=Pose.identity())(Cloud("cad", points))
    np.testing.assert_allclose(alignment.cad_from_measured(points), points, atol=1e-9)
    assert np.count_nonzero(alignment.used) > 2000
