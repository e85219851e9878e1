"""Without landmarks the pictures themselves tell where the cameras stand, or it is said why they do not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from PIL import Image

from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.correlation.picks import ideal_camera
from inspect3d.correlation.start import DISTORTION
from inspect3d.correlation.stereo import Stereo
from inspect3d.inspection import check, run
from inspect3d.measure import Files
from inspect3d.nominal.load import load_nominal
from inspect3d.outcome import InputError, MeasurementError, Status
from inspect3d.pose import Pose
from inspect3d.register.similarity import Similarity
from inspect3d.starting.bundle import Bundle, adjusted
from inspect3d.starting.finder import FindStart
from inspect3d.starting.relative import relative, triangulated
from inspect3d.starting.shown import Pictured
from inspect3d.virtual.deviation_field import Sum, Wave
from inspect3d.virtual.part import Part
from inspect3d.virtual.scene import Scene
from inspect3d.virtual.speckle import Speckle
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d.virtual.virtual_camera import VirtualCamera
from tests.jit import printed
from tests.speckled import Speckle as SheetSpeckle
from tests.speckled import photographed, picture, rig
from tests.test_stereocorrelation import cad, errors, photographs, recipe, rms

EXACT = Lens()


def cloud(count=300, seed=1):
    """Return points in a box about the middle of the sheet."""
    return np.random.default_rng(seed).uniform([0, 0, -20], [60, 45, 20], (count, 3))


def seen(views, points):
    """Return where the views see points, as tracks."""
    return np.stack([view.project(points) for view in views], axis=1)


def turn_between(views):
    """Return the pose of each view before the first one's frame."""
    return [view.camera_from_cad @ views[0].camera_from_cad.inverse() for view in views]


@pytest.mark.parametrize(("focal", "angles"), [(2400, (-0.24, 0.24)), (9000, (-0.1, 0.15)), (2400, (-0.3, 0.0, 0.3))])
def test_exact_tracks_give_the_places_of_the_cameras_up_to_a_scale(focal, angles):
    views = rig(focal=focal, distance=focal / 8, angles=angles)
    pixels = seen(views, cloud())
    bundle = relative([view.camera for view in views], [EXACT] * len(views), pixels, 0.3)[0]
    for found, true in zip(turn_between(bundle.views), turn_between(views), strict=True):
        assert (found @ true.inverse()).angle < np.radians(0.01)
    assert len(bundle.points) == 300
    assert bundle.misses.max() < 1e-2


def test_a_known_rig_gives_the_points_themselves():
    views = rig()
    points = cloud()
    bundle = triangulated(views, seen(views, points), 0.3)
    np.testing.assert_allclose(bundle.points, points, atol=1e-4)


def test_pictures_that_do_not_obey_the_calibration_are_refused():
    views = rig()
    pixels = seen(views, cloud())
    pixels[:, 1, 1] += 40.0
    with pytest.raises(MeasurementError, match="do not obey the calibration"):
        triangulated(views, pixels, 0.3)


def disturbed(views, points, seed=4):
    """Return a bundle whose cameras and points are a little off where its pixels were seen, and what may change."""
    random = np.random.default_rng(seed)
    moved = tuple(
        View(v.camera, v.camera_from_cad @ Pose.small(1e-3 * random.normal(size=6), points[0])) for v in views
    )
    bundle = Bundle(moved, points + 0.05 * random.normal(size=points.shape), seen(views, points))
    return bundle, Freedom("free", (EXACT,) * len(views), views, points.mean(axis=0))


def test_an_adjusted_bundle_appears_where_it_was_seen():
    bundle, freedom = disturbed(rig(), cloud(80))
    assert adjusted(bundle, freedom, 0.3).bundle.misses.max() < 1e-3


def test_the_kernels_do_the_same_without_the_compiler():
    code = """
from tests.test_click_free import cloud, disturbed, rig
from inspect3d.starting.bundle import adjusted
bundle, freedom = disturbed(rig(), cloud(12))
print(*(float(adjusted(bundle, freedom, 0.3, steps=steps).cost) for steps in (0, 1)))
"""
    compiled, plain = (np.array(printed(code, jit).split(), float) for jit in (True, False))
    assert compiled[0] > 1.0
    np.testing.assert_allclose(compiled, plain, rtol=1e-6, atol=1e-9)


def test_a_similarity_of_the_cad_keeps_what_the_cameras_see():
    views, points = rig(), cloud(20)
    bundle = Bundle(views, points, seen(views, points))
    moved = bundle.placed(Similarity(Pose.small(np.array([0.3, -0.2, 0.9, 5.0, 6.0, 7.0]), points[0]), 1.7))
    np.testing.assert_allclose(seen(moved.views, moved.points), bundle.pixels, atol=1e-6)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the sheet and its photographs."""
    folder = tmp_path_factory.mktemp("sheet")
    cad(folder)
    photographs(folder, rig())
    return folder


def test_a_start_without_landmarks_ends_at_the_true_map(folder):
    record = run(recipe(folder, "focal = 2450.0\nsystematic = 0.0\n"), folder / "out")
    (part,) = record.parts
    assert part.status is Status.OK, part.reason
    error, z = errors(part, record.nominal, growth=True)
    assert len(error) > 0.8 * len(record.nominal.mesh)
    assert rms(z) < 1.5
    assert "found from the pictures alone" in " ".join(part.remarks)
    assert {"start_picture_1", "start_picture_2"} <= {figure.name for figure in part.figures}


def test_pictures_of_different_sizes_are_those_of_cameras_of_their_own(folder):
    views = rig()
    grey = [cv2.imread(str(folder / name), cv2.IMREAD_UNCHANGED).astype(float) for name in ("left.png", "right.png")]
    grey[1] = grey[1][30:-30, 40:-40]
    lens = Lens(0.05 * 2450.0, 15.0, DISTORTION)
    pictured = [Pictured(each, None, ideal_camera(2450.0, each.shape[::-1]), lens) for each in grey]
    said = FindStart(load_nominal(folder / "part.ply"))(pictured)
    points, off = load_nominal(folder / "part.ply").mesh.nodes, np.array([[0.0, 0.0], [40.0, 30.0]])
    (best,) = said.trials
    for found, true, cut in zip(best.views, views, off, strict=True):
        assert rms(np.linalg.norm(found.project(points) + cut - true.project(points), axis=1)) < 4.0


def test_without_a_focal_length_it_is_asked_for_before_anything_is_measured(folder):
    with pytest.raises(InputError, match=r"Nothing tells the focal length of left\.png"):
        check(recipe(folder))


def test_pictures_of_two_parts_have_too_little_in_common(folder):
    views, random = rig(), np.random.default_rng(0)
    grey = [
        photographed(random, picture(view, SheetSpeckle.drawn(np.random.default_rng(k), 0.7)))
        for k, view in enumerate(views)
    ]
    pictured = [Pictured(each, None, view.camera, EXACT) for each, view in zip(grey, views, strict=True)]
    with pytest.raises(MeasurementError, match="too little in common"):
        FindStart(load_nominal(folder / "part.ply"))(pictured)


def test_a_picture_without_speckle_is_named_though_the_others_are_enough(folder):
    views = rig(angles=(-0.3, 0.0, 0.3))
    grey = [picture(view, SheetSpeckle.drawn(np.random.default_rng(0), 0.7)) for view in views[:2]]
    grey.append(np.tile(np.linspace(20.0, 200.0, grey[0].shape[1]), (len(grey[0]), 1)))
    pictured = [Pictured(each, None, view.camera, EXACT) for each, view in zip(grey, views, strict=True)]
    with pytest.raises(MeasurementError, match="Picture 3 shows 0 features, and 30 are needed"):
        FindStart(load_nominal(folder / "part.ply"))(pictured, views)


def test_a_blank_picture_is_refused_and_one_to_be_turned_is_told_of(folder, tmp_path):
    cv2.imwrite(str(tmp_path / "blank.png"), np.full((512, 612), 90, np.uint8))
    with Image.open(folder / "right.png") as right:
        exif = right.getexif()
        exif[0x0112] = 6
        right.save(tmp_path / "turned.png", exif=exif)
    method = Stereo(2450.0, (), False, "cubic", 65.0, 0.0, None, None, True)
    blank, turned = ({"images": (folder / "left.png", tmp_path / name)} for name in ("blank.png", "turned.png"))
    with pytest.raises(InputError, match=r"blank\.png is blank"):
        method.open(Files(tmp_path, blank))
    (remark,) = method.open(Files(tmp_path, turned)).remarks
    assert "turned.png asks viewers to turn it" in remark


def block(pocket):
    """Return a square block, perhaps with a pocket in the underside beside the middle."""

    def shape():
        from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
        from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
        from OCP.gp import gp_Pnt

        body = BRepPrimAPI_MakeBox(60.0, 60.0, 25.0).Shape()
        hole = BRepPrimAPI_MakeBox(gp_Pnt(5.0, 8.0, -1.0), gp_Pnt(30.0, 22.0, 12.0)).Shape()
        return BRepAlgoAPI_Cut(body, hole).Shape() if pocket else body

    return Part("block", shape)


@pytest.fixture(scope="module")
def shots():
    """Return two pictures of the block from above, which do not show its underside, and the true cameras."""
    stereo = StereoRig(angle=0.45, scale=6.0, focal=2600.0, size=(612, 512), toward=(0.5, 0.3, 0.8), offset=2.0)
    views = stereo(np.array([30.0, 30.0, 12.0]), 3)
    scene = Scene(block(pocket=False).surface(), Sum((Wave(0.02, (0.01, 0.005, 0.0), 0.3),)), Speckle(dot=0.8, seed=2))
    return [VirtualCamera(view)(scene, k).astype(float) for k, view in enumerate(views)], views


@pytest.mark.parametrize("pocket", [False, True])
def test_a_symmetric_block_is_one_answer_and_one_with_a_hidden_pocket_is_several(tmp_path, shots, pocket):
    block(pocket).write_step(tmp_path / "block.step")
    grey, views = shots
    lens = Lens(100.0, 15.0, (0.2, 0.3, 1e-3, 1e-3, 0.0))
    pictured = [Pictured(each, None, ideal_camera(2650.0, (612, 512)), lens) for each in grey]
    said = FindStart(load_nominal(tmp_path / "block.step", element_size=5.0))(pictured)
    assert said.trials, "the block was not found"
    assert said.symmetric is not pocket
    assert (len(said.trials) > 1) is pocket
    corners = np.array([[x, y, z] for z in (25.0, 0.0) for x in (0.0, 60.0) for y in (0.0, 60.0)])
    for view, true in zip(said.trials[0].views, views, strict=True):
        there, wanted = view.project(corners), true.project(corners[:4])  # of the one face that both cameras see
        assert np.linalg.norm(there[:, None] - wanted, axis=2).min(axis=0).max() < 0.05 * 360  # its width, px
