"""Truths about cameras: OpenCV's model, its inverse and its derivatives."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from inspect3d.camera import Camera, View
from inspect3d.camera_kernel import project_point, project_with_slope
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from tests.jit import printed

MATRIX = np.array([[8200.0, 0.0, 1230.0], [0.0, 8190.0, 1015.0], [0.0, 0.0, 1.0]])
WIDE = np.array([[1300.0, 2.5, 610.0], [0.0, 1290.0, 505.0], [0.0, 0.0, 1.0]])
BROWN = np.array([-0.21, 0.09, 0.0011, -0.0007, 0.03])


def random_view(seed, matrix=MATRIX, distortion=BROWN):
    rotation = Rotation.from_rotvec(np.random.default_rng(seed).normal(0, 0.6, 3)).as_matrix()
    return View(Camera(matrix, distortion, (2448, 2048)), Pose(rotation, np.array([5.0, -8.0, 400.0])))


def random_points(seed):
    return np.random.default_rng(seed).uniform(-40, 40, (50, 3))


@pytest.mark.parametrize("seed", range(4))
def test_a_point_is_seen_where_opencv_sees_it(seed):
    view, points = random_view(seed), random_points(seed)
    pose = view.camera_from_cad
    vector = cv2.Rodrigues(pose.rotation)[0]
    expected, _ = cv2.projectPoints(points, vector, pose.translation, MATRIX, BROWN)
    np.testing.assert_allclose(view.project(points), expected[:, 0], atol=1e-8)


@pytest.mark.parametrize("matrix", [MATRIX, WIDE], ids=["long lens", "wide lens with skew"])
def test_the_kernel_sees_a_point_where_the_view_sees_it(matrix):
    view, points = random_view(1, matrix), random_points(1)
    pose = view.camera_from_cad
    given_to_kernel = matrix, BROWN, pose.rotation, pose.translation
    seen = np.array([project_point(*given_to_kernel, *point) for point in points])
    np.testing.assert_allclose(seen[:, :2], view.project(points), atol=1e-9)
    np.testing.assert_allclose(seen[:, 2], view.depth(points), atol=1e-10)


@settings(max_examples=60, deadline=None)
@given(
    pixels=arrays(np.float64, (20, 2), elements=some.floats(0.0, 2047.0)),
    k1=some.floats(-0.3, 0.3),
    k2=some.floats(-0.1, 0.1),
    tangential=some.tuples(some.floats(-0.005, 0.005), some.floats(-0.005, 0.005)),
)
def test_undistorting_and_projecting_give_a_pixel_back(pixels, k1, k2, tangential):
    camera = Camera(MATRIX, np.array([k1, k2, *tangential, 0.01]), (2448, 2048))
    sights = np.column_stack([camera.undistorted(pixels), np.ones(len(pixels))])
    np.testing.assert_allclose(camera.project(300.0 * sights), pixels, atol=1e-8)


def test_undistorting_agrees_with_opencv():
    pixels = np.random.default_rng(3).uniform(0, 1000, (100, 2))
    camera = Camera(WIDE * [[1, 0, 1], [1, 1, 1], [1, 1, 1]], BROWN, (1220, 1010))
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-14)
    expected = cv2.undistortPoints(pixels[:, None], camera.matrix, BROWN, criteria=criteria)
    np.testing.assert_allclose(camera.undistorted(pixels), expected[:, 0], atol=1e-9)


def test_a_lens_that_folds_the_picture_is_an_error_that_names_the_pixel():
    camera = Camera(WIDE, np.array([-3.0, 0.0, 0.0, 0.0, 0.0]), (1220, 1010))
    with pytest.raises(MeasurementError, match=r"pixel \(1219, 1009\)"):
        camera.undistorted([[600.0, 500.0], [1219.0, 1009.0]])


def test_a_point_behind_the_camera_is_an_error():
    with pytest.raises(MeasurementError, match="1 of 2 points lie behind"):
        random_view(0).camera.project([[0, 0, 10], [0, 0, -10]])


@pytest.mark.parametrize("matrix", [MATRIX, WIDE], ids=["long lens", "wide lens with skew"])
def test_the_slope_of_a_pixel_is_that_of_its_projection(matrix):
    view, step = random_view(2, matrix), 1e-4
    pose = view.camera_from_cad
    for point in random_points(2)[:10]:
        pixel, slope = project_with_slope(matrix, BROWN, pose.rotation, pose.translation, *point)
        np.testing.assert_allclose(pixel[:2], view.project(point[None])[0], atol=1e-9)
        ahead, behind = view.project(point + step * np.eye(3)), view.project(point - step * np.eye(3))
        np.testing.assert_allclose(np.reshape(slope, (2, 3)), (ahead - behind).T / (2 * step), atol=1e-5)


def test_the_centre_of_a_view_is_the_origin_of_its_camera():
    view = random_view(5)
    np.testing.assert_allclose(view.camera_from_cad(view.centre[None]), 0.0, atol=1e-12)
    assert view.depth(view.centre[None])[0] == pytest.approx(0.0, abs=1e-12)


def test_moving_part_and_camera_together_changes_no_pixel():
    view, points = random_view(6), random_points(6)
    motion = Pose.small([0.3, -0.2, 0.5, 10, 20, -30], np.zeros(3))
    moved = View(view.camera, view.camera_from_cad @ motion.inverse())
    np.testing.assert_allclose(moved.project(motion(points)), view.project(points), atol=1e-8)


@pytest.mark.parametrize(
    ("matrix", "size"),
    [(np.eye(3)[::-1], (10, 10)), (np.diag([-1.0, 1.0, 1.0]), (10, 10)), (MATRIX, (0, 10)), (MATRIX[:2], (10, 10))],
)
def test_what_is_no_camera_is_refused(matrix, size):
    with pytest.raises(ValueError, match=r"camera matrix|focal length|size of a picture"):
        Camera(matrix, np.zeros(5), size)


def test_the_kernel_gives_the_same_with_and_without_the_compiler():
    program = (
        "import numpy as np; from inspect3d.camera_kernel import project_with_slope as p;"
        "k = np.array([[900., 1, 500], [0, 880, 400], [0, 0, 1]]); d = np.array([-.2, .1, .001, .002, .03]);"
        "print(np.round(np.concatenate(p(k, d, np.eye(3), np.array([1., 2, 300]), 10., -20., 5.)), 9).tolist())"
    )
    assert printed(program, jit=True) == printed(program, jit=False)
