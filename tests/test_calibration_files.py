"""Truths about calibration files: what programs wrote is what is read, and what does not fit is refused in words."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from inspect3d.camera import Camera, View
from inspect3d.files.calibration import CameraSigma, Rig
from inspect3d.files.calibration_json import write_calibration_json
from inspect3d.files.calibration_load import load_calibration
from inspect3d.outcome import InputError
from inspect3d.pose import Pose

DATA = Path(__file__).parents[1].parent / "shared" / "data"
PAIR = ("left.png", "right.png")
SIZES = ((1200, 1000), (1300, 1000))
MATRICES = [np.array([[4000.0 + k, 0.5 * k, 600.0 + k], [0, 4002, 500 - k], [0, 0, 1]]) for k in (0, 1)]
LENSES = [np.array([-0.2, 0.1, 1e-3, -2e-3, 0.03]), np.array([-0.1, 0.2, 0.0, 1e-3, -0.3])]
SECOND = Pose(Rotation.from_euler("xyz", [1.0, -20.0, 2.0], degrees=True).as_matrix(), np.array([130.0, 1.0, 22.0]))

needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the real data lie beside the repository and are not there")


def rig(**poses):
    sigma = CameraSigma(focal=1.5, centre=2.0, distortion=np.full(5, 0.01), rotation=1e-4, translation=0.1)
    return Rig(tuple(map(Camera, MATRICES, LENSES, SIZES)), sigmas=(sigma, None), **poses)


def same_cameras(one, other):
    for a, b in zip(one.cameras, other.cameras, strict=True):
        np.testing.assert_allclose(a.matrix, b.matrix, rtol=1e-12)
        np.testing.assert_allclose(a.distortion, b.distortion, rtol=1e-12)
        assert a.size == b.size


def storage(path, **matrices):
    """Write a file as OpenCV's programs do."""
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in matrices.items():
        file.write(key, value)
    file.release()


def test_cameras_that_name_their_images_are_found_by_them_in_any_order_and_number(tmp_path):
    file = tmp_path / "calibration.json"
    written = rig(camera_from_cad=(Pose.identity(), SECOND))
    write_calibration_json(file, written, PAIR)
    same_cameras(load_calibration((file,), PAIR, SIZES), written)
    turned = load_calibration((file,), PAIR[::-1], SIZES[::-1])
    same_cameras(turned, Rig(written.cameras[::-1]))
    np.testing.assert_allclose(turned.camera_from_cad[0].matrix, SECOND.matrix, atol=1e-15)
    assert load_calibration((file,), PAIR[1:], SIZES[1:]).sigmas == (None,)
    with pytest.raises(InputError, match=r"no camera whose image is other.png: it has left.png, right.png"):
        load_calibration((file,), ("other.png",), SIZES[:1])
    content = json.loads(file.read_text())
    del content["cameras"][0]["image"]
    file.write_text(json.dumps(content))
    with pytest.raises(InputError, match="every camera an image of its own, or none"):
        load_calibration((file,), PAIR, SIZES)


@pytest.mark.parametrize("key", ["camera_from_cad", "camera_from_rig", None])
def test_our_own_file_gives_the_rig_back_to_the_last_digit(key, tmp_path):
    poses = (Pose.identity(), SECOND)
    written = rig(**({key: poses} if key else {}))
    write_calibration_json(tmp_path / "calibration.json", written)
    read = load_calibration((tmp_path / "calibration.json",), PAIR, SIZES)
    same_cameras(read, written)
    for name in ("camera_from_cad", "camera_from_rig"):
        assert (getattr(read, name) is None) == (name != key)
    if key:
        np.testing.assert_allclose(getattr(read, key)[1].matrix, SECOND.matrix, atol=1e-15)
    assert read.sigmas[0].focal == 1.5
    np.testing.assert_array_equal(read.sigmas[0].distortion, 0.01)
    assert read.sigmas[1] is None
    assert read.scaled


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_a_pair_of_opencv_is_read_with_its_rig(suffix, tmp_path):
    path = tmp_path / f"stereo.{suffix}"
    shift = SECOND.translation[:, None].copy()
    names = ("M1", "D1", "M2", "D2", "R", "T")
    lenses = [lens[None] for lens in LENSES]
    values = (MATRICES[0], lenses[0], MATRICES[1], lenses[1], SECOND.rotation.copy(), shift)
    storage(path, **dict(zip(names, values, strict=True)))
    read = load_calibration((path,), PAIR, SIZES)
    same_cameras(read, rig())
    np.testing.assert_allclose(read.camera_from_rig[0].matrix, np.eye(4))
    np.testing.assert_allclose(read.camera_from_rig[1].matrix, SECOND.matrix, atol=1e-12)


def test_intrinsics_and_extrinsics_of_opencv_may_be_two_files(tmp_path):
    storage(tmp_path / "in.yml", M1=MATRICES[0], D1=LENSES[0], M2=MATRICES[1], D2=LENSES[1])
    storage(tmp_path / "ex.yml", R=SECOND.rotation.copy(), T=SECOND.translation.copy())
    both = load_calibration((tmp_path / "in.yml", tmp_path / "ex.yml"), PAIR, SIZES)
    np.testing.assert_allclose(both.camera_from_rig[1].matrix, SECOND.matrix, atol=1e-12)
    alone = load_calibration((tmp_path / "in.yml",), PAIR, SIZES)
    same_cameras(alone, both)
    assert alone.camera_from_rig is None


def test_each_picture_may_have_a_file_of_opencv_with_its_lens(tmp_path):
    for k, (matrix, lens) in enumerate(zip(MATRICES, LENSES, strict=True)):
        width, height = SIZES[k]
        values = {"image_width": width, "image_height": height, "camera_matrix": matrix}
        storage(tmp_path / f"{k}.yml", **values, distortion_coefficients=lens)
    files = tmp_path / "0.yml", tmp_path / "1.yml"
    same_cameras(load_calibration(files, PAIR, SIZES), rig())
    with pytest.raises(InputError, match="belongs to pictures of 1200 x 1000"):
        load_calibration(files, PAIR, SIZES[::-1])


def colmap(folder, model="OPENCV", extra=()):
    """Write a model of COLMAP in which the pictures come in another order."""
    folder.mkdir()
    quaternion = np.roll(Rotation.from_matrix(SECOND.rotation).as_quat(), 1)
    rows = ["# Camera list"]
    for k, (matrix, lens, (width, height)) in enumerate(zip(MATRICES, LENSES, SIZES, strict=True)):
        values = [matrix[0, 0], matrix[1, 1], matrix[0, 2] + 0.5, matrix[1, 2] + 0.5, *lens[:4], *extra]
        rows.append(f"{k + 7} {model} {width} {height} {' '.join(map(repr, map(float, values)))}")
    (folder / "cameras.txt").write_text("\n".join(rows) + "\n")
    numbers = " ".join(map(repr, map(float, [*quaternion, *SECOND.translation])))
    text = f"# Image list\n1 {numbers} 8 right.png\n\n2 1 0 0 0 0 0 0 7 left.png\n10.5 11.5 -1\n"
    (folder / "images.txt").write_text(text)
    return folder


def test_colmap_counts_pixels_from_the_corner_and_finds_pictures_by_name(tmp_path):
    read = load_calibration((colmap(tmp_path / "sparse"),), PAIR, SIZES)
    for camera, matrix, lens in zip(read.cameras, MATRICES, LENSES, strict=True):
        np.testing.assert_allclose(camera.matrix, matrix - [[0, matrix[0, 1], 0], [0, 0, 0], [0, 0, 0]], rtol=1e-12)
        np.testing.assert_allclose(camera.distortion, [*lens[:4], 0.0])
    np.testing.assert_allclose(read.camera_from_rig[1].matrix, SECOND.matrix, atol=1e-12)
    assert not read.scaled


def test_pycolmap_projects_a_point_to_the_same_place(tmp_path):
    pycolmap = pytest.importorskip("pycolmap")
    read = load_calibration((colmap(tmp_path / "sparse") / "cameras.txt",), PAIR, SIZES)
    model = pycolmap.Camera(
        model="OPENCV", width=1200, height=1000, params=[4000, 4002, 600.5, 500.5, *LENSES[0][:4]], camera_id=7
    )
    point = np.array([12.0, -20.0, 300.0])
    expected = np.ravel(model.img_from_cam(point[None])) - 0.5
    np.testing.assert_allclose(read.cameras[0].project(point[None])[0], expected, atol=1e-9)


@pytest.mark.data
@needs_data
def test_vic3d_and_dice_calibrations_of_one_rig_tell_the_same_rig():
    folder, sizes = DATA / "dice_dspecimen", ((1920, 1200),) * 2
    vic = load_calibration((folder / "cal_vic3d.xml",), PAIR, sizes)
    dice = load_calibration((folder / "cal_pyaldic_dice_format.xml",), PAIR, sizes)
    between = [one.camera_from_rig[1] @ one.camera_from_rig[0].inverse() for one in (vic, dice)]
    np.testing.assert_allclose(between[0].translation, [121.446, 0.187, 20.748], atol=1e-3)
    np.testing.assert_allclose(between[1].translation, [121.4048, 0.5744, 23.1926], atol=1e-3)
    assert np.degrees(between[0].angle) == pytest.approx(18.83, abs=0.01)
    assert np.degrees(between[1].angle) == pytest.approx(18.88, abs=0.05)
    assert vic.cameras[0].matrix[0, 0] == pytest.approx(6636.033383)
    assert dice.cameras[0].distortion[4] == pytest.approx(55.92468005109)


@pytest.mark.data
@needs_data
def test_a_vic3d_rig_sees_the_specimen_at_its_plane():
    rig = load_calibration((DATA / "dice_dspecimen" / "cal_vic3d.xml",), PAIR, ((1920, 1200),) * 2)
    for camera, pose in zip(rig.cameras, rig.camera_from_rig, strict=True):
        pixel = View(camera, pose).project([[-0.72, 3.48, -367.36]])[0]
        assert np.all((pixel > 0) & (pixel < camera.size))


@pytest.mark.data
@needs_data
def test_a_rendered_plate_of_dice_is_seen_by_its_cameras():
    rig = load_calibration((DATA / "dice_epipolar_plane_synthetic" / "cal.xml",), PAIR, ((1920, 1080),) * 2)
    np.testing.assert_allclose(rig.camera_from_rig[0].matrix, np.eye(4))
    turn = Rotation.from_euler("y", 20.0, degrees=True).as_matrix()
    np.testing.assert_allclose(rig.camera_from_rig[1].rotation, turn, atol=1e-12)
    np.testing.assert_allclose(rig.cameras[1].distortion, [-0.2361956, -0.0985805, 0, 0, -0.3652319], atol=1e-6)
    middle = View(rig.cameras[1], rig.camera_from_rig[1]).project([[0.0, 0.0, 15.0]])[0]
    assert np.abs(middle - [959.5, 539.5]).max() < 100


def triangulated(rig, pictures):
    """Return the points (n, 3) of the rig that SIFT finds in both pictures, those off their plane left out."""
    sift = cv2.SIFT_create(nfeatures=4000)
    (spots, words), (others, known) = (sift.detectAndCompute(picture, None) for picture in pictures)
    pairs = [
        first for first, second in cv2.BFMatcher().knnMatch(words, known, k=2) if first.distance < 0.7 * second.distance
    ]
    pixels = [spots[pair.queryIdx].pt for pair in pairs], [others[pair.trainIdx].pt for pair in pairs]
    places = [camera.undistorted(np.array(seen)).T for camera, seen in zip(rig.cameras, pixels, strict=True)]
    points = cv2.triangulatePoints(*(pose.matrix[:3] for pose in rig.camera_from_rig), *places)
    points = (points[:3] / points[3]).T
    for _ in range(6):
        away = np.abs(off_plane(points))
        points = points[away < 4 * 1.4826 * np.median(away)]
    return points


def off_plane(points):
    middle = points.mean(axis=0)
    return (points - middle) @ np.linalg.svd(points - middle, full_matrices=False)[2][2]


@pytest.mark.data
@needs_data
@pytest.mark.parametrize("name", ["cal_vic3d.xml", "cal_pyaldic_dice_format.xml"])
def test_a_flat_sheet_is_flat_within_15_um_by_either_calibration(name):
    folder = DATA / "dice_dspecimen"
    rig = load_calibration((folder / name,), PAIR, ((1920, 1200),) * 2)
    pictures = [cv2.imread(str(folder / "images" / f"GT4-0000_{k}.tif"), cv2.IMREAD_GRAYSCALE) for k in (0, 1)]
    points = triangulated(rig, pictures)
    assert len(points) > 1500
    assert off_plane(points).std() < 0.015


@pytest.mark.data
@needs_data
def test_a_rendered_plate_stands_where_it_was_rendered_after_undistortion():
    folder = DATA / "dice_epipolar_plane_synthetic"
    rig = load_calibration((folder / "cal.xml",), PAIR, ((1920, 1080),) * 2)
    pictures = [cv2.imread(str(folder / f"{side}_dist.png"), cv2.IMREAD_GRAYSCALE) for side in ("left", "right")]
    points = triangulated(rig, pictures)
    assert len(points) > 1500
    assert np.median(points[:, 2]) == pytest.approx(15.0, abs=0.001)
    assert off_plane(points).std() < 0.002


DICE = """<ParameterList><ParameterList name="CAMERA 0">
<Parameter name="FX" value="{fx}"/><Parameter name="FY" value="900"/><Parameter name="K1" value="0.1"/>
<Parameter name="{key}" value="{value}"/></ParameterList></ParameterList>"""
VIC = (
    '<project><calibration><camera id="0">{line}<orientation>0 0 0 0 0 0</orientation></camera></calibration></project>'
)
ONE = '{{"cameras": [{}]}}'
MATRIX = '"matrix": [[900, 0, 5], [0, 900, 5], [0, 0, 1]]'


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "no calibration that inspect3d reads"),
        ("hello", "no calibration that inspect3d reads"),
        ("<project>", "not valid XML"),
        ("<project/>", "no calibration that inspect3d reads"),
        ("%YAML:1.0\n---\nM1: [", "FileStorage"),
        ("%YAML:1.0\n---\nA: 1.0\n", "no camera matrix"),
        ('{"cameras": 3}', "is no calibration"),
        ('{"cameras": [', "not valid JSON"),
        ('{"cameras": []}', "holds 0 cameras, and the recipe names 1 pictures"),
        (ONE.format("3"), "not a table"),
        (ONE.format("{}"), "has no matrix"),
        (ONE.format('{"matrix": [[1, 2], [3]]}'), "camera 1"),
        (ONE.format('{"matrix": [[-9, 0, 5], [0, 9, 5], [0, 0, 1]]}'), "focal length is positive"),
        (ONE.format("{" + MATRIX + ', "fokal": 3}'), "'fokal' is unknown"),
        (ONE.format("{" + MATRIX + ', "size": [7, 8]}'), "pictures of 7 x 8 px"),
        (ONE.format("{" + MATRIX + ', "size": 7}'), "camera 1"),
        (ONE.format("{" + MATRIX + ', "distortion": [1, 2]}'), "distortion"),
        (ONE.format("{" + MATRIX + ', "sigma": {"f": 1}}'), "sigma is a table"),
        (ONE.format("{" + MATRIX + ', "sigma": {"focal": -1}}'), "not negative"),
        (ONE.format("{" + MATRIX + ', "camera_from_cad": [[1]]}'), "pose matrix"),
        (ONE.format('{"matrix": [[1' + "0" * 400 + ", 0, 5], [0, 9, 5], [0, 0, 1]]}"), "too large"),
        ('{"a":' * 100_000, "no calibration that inspect3d reads"),
        (DICE.format(fx="many", key="K2", value="0"), "FX"),
        (DICE.format(fx="0", key="K2", value="0"), "focal length is positive"),
        (DICE.format(fx="9", key="K4", value="1"), "K4"),
        (DICE.format(fx="9", key="LENS_DISTORTION_MODEL", value="K1R1_K2R2_K3R3"), "K1R1_K2R2_K3R3"),
        (DICE.format(fx="9", key="IMAGE_HEIGHT_WIDTH", value="{ 3, 4 }"), "pictures of 4 x 3 px"),
        (VIC.format(line="1 2 3"), "3 numbers where 8"),
        (VIC.format(line="1 2 3 4 5 6 7 x"), "camera 1"),
    ],
)
def test_what_is_no_calibration_of_the_pictures_is_an_error_in_words(content, words, tmp_path):
    path = tmp_path / "cameras.dat"
    path.write_text(content)
    with pytest.raises(InputError, match=words) as caught:
        load_calibration((path,), ("left.png",), ((10, 20),))
    assert "cameras.dat" in str(caught.value)


def test_poses_for_some_cameras_only_are_an_error(tmp_path):
    entry = {"matrix": MATRICES[0].tolist()}
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps({"cameras": [entry, {**entry, "camera_from_cad": np.eye(4).tolist()}]}))
    with pytest.raises(InputError, match="every camera a camera_from_cad"):
        load_calibration((path,), PAIR, SIZES)


def test_a_picture_that_colmap_does_not_know_is_an_error(tmp_path):
    with pytest.raises(InputError, match=r"no picture 'middle\.png'"):
        load_calibration((colmap(tmp_path / "sparse"),), ("middle.png", "right.png"), SIZES)


@pytest.mark.parametrize(
    ("model", "extra", "words"),
    [
        ("OPENCV_FISHEYE", (), "OPENCV_FISHEYE is unknown"),
        ("FULL_OPENCV", (0.0, 0.1, 0.0, 0.0), "k4, k5, k6"),
        ("PINHOLE", (), "is no camera"),
    ],
)
def test_a_lens_of_colmap_that_is_not_browns_is_an_error(model, extra, words, tmp_path):
    with pytest.raises(InputError, match=words):
        load_calibration((colmap(tmp_path / "sparse", model, extra),), PAIR, SIZES)


def test_a_binary_model_of_colmap_is_an_error_that_says_what_to_do(tmp_path):
    (tmp_path / "cameras.bin").write_bytes(b"\x00")
    with pytest.raises(InputError, match="export the model of COLMAP as text"):
        load_calibration((tmp_path,), PAIR, SIZES)


def test_a_lens_of_opencv_with_eight_coefficients_is_an_error(tmp_path):
    storage(tmp_path / "a.yml", camera_matrix=MATRICES[0], distortion_coefficients=np.arange(8.0))
    with pytest.raises(InputError, match="8 coefficients"):
        load_calibration((tmp_path / "a.yml",), ("a.png",), SIZES[:1])


def test_a_rig_with_unknown_places_has_no_views():
    with pytest.raises(ValueError, match="unknown"):
        _ = rig().views
    views = rig(camera_from_cad=(Pose.identity(), SECOND)).views
    np.testing.assert_allclose(views[1].camera_from_cad.matrix, SECOND.matrix)
