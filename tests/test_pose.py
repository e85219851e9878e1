"""A pose is a group element: tested by the axioms of the group."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from inspect3d.pose import Pose

vectors = arrays(float, 3, elements=st.floats(-500, 500))
poses = st.builds(lambda r, t: Pose(Rotation.from_rotvec(r / 100).as_matrix(), t), vectors, vectors)
points = arrays(float, (4, 3), elements=st.floats(-1000, 1000))


@given(poses, poses, points)
def test_a_chain_of_poses_moves_points_as_its_links_do(c_from_b, b_from_a, points_a):
    np.testing.assert_allclose((c_from_b @ b_from_a)(points_a), c_from_b(b_from_a(points_a)), atol=1e-9)


@given(poses, points)
def test_a_pose_and_its_inverse_undo_each_other(b_from_a, points_a):
    np.testing.assert_allclose(b_from_a.inverse()(b_from_a(points_a)), points_a, atol=1e-9)


@given(poses, points)
def test_distances_are_kept(b_from_a, points_a):
    moved = b_from_a(points_a)
    np.testing.assert_allclose(
        np.linalg.norm(moved[1:] - moved[:-1], axis=1), np.linalg.norm(points_a[1:] - points_a[:-1], axis=1), atol=1e-8
    )


@given(poses)
def test_a_pose_survives_its_matrix(b_from_a):
    np.testing.assert_allclose(Pose.from_matrix(b_from_a.matrix).matrix, b_from_a.matrix, atol=1e-12)


@given(arrays(float, 6, elements=st.floats(-1, 1)), vectors)
def test_a_small_motion_turns_about_its_origin(motion, origin):
    moved = Pose.small(motion, origin)(origin[None])[0]
    np.testing.assert_allclose(moved, origin + motion[3:], atol=1e-9)


def test_a_reflection_is_no_pose():
    with pytest.raises(ValueError, match="proper"):
        Pose(np.diag([1.0, 1.0, -1.0]), np.zeros(3))
