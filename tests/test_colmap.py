"""COLMAP: points on the true surface, cameras in their places, a scale whose origin is told, and refusals."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from math import radians

import cv2
import numpy as np
import pytest

from inspect3d.deviate.deviate import Deviate
from inspect3d.files.calibration import Rig
from inspect3d.files.calibration_json import write_calibration_json
from inspect3d.inspection import run
from inspect3d.measure import Files
from inspect3d.nominal.load import load_nominal
from inspect3d.outcome import InputError, MeasurementError
from inspect3d.pose import Pose
from inspect3d.register.gauge import best_fit
from inspect3d.register.landmarks import similarity_from_landmarks
from inspect3d.register.register import Register
from inspect3d.triangulation.patches import FitPatches
from inspect3d.triangulation.scale_bar import Mark, ScaleBar
from inspect3d.virtual.deviation_field import Bump, Wave
from inspect3d.virtual.picture_truth import PictureTruth
from inspect3d.virtual.stereo_datasets import milled_photographs
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d_plugins.colmap import Colmap
from tests.jit import printed

RIG = StereoRig(cameras=5, angle=radians(40.0)).halved().halved()
NAMES = tuple(f"view{k}.png" for k in range(1, 6))


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Five photographs of 612 x 512 px, 5 px/mm, of the milled block with a smooth deviation."""
    folder = tmp_path_factory.mktemp("photographs")
    field = Wave(0.02, (0.010, 0.013, 0.005), 1.0) + Bump((60.0, 40.0, 33.0), 0.15, 14.0)
    replace(milled_photographs(1, RIG), deviation=field).write(folder, 1)
    return folder


@pytest.fixture(scope="session")
def truth(folder):
    return PictureTruth.read(folder / "truth.json")


@pytest.fixture(scope="session")
def nominal(folder):
    return load_nominal(folder / "part.step", element_size=4.0)


def files(folder, names=NAMES, **others):
    images = tuple(folder / name for name in names)
    return Files(folder, {"images": images, **{key: (folder / name,) for key, name in others.items()}})


def measured(method, folder, nominal, **others):
    return method(method.open(files(folder, **others)), nominal)


@pytest.fixture(scope="session")
def placed(folder, nominal):
    """The measurement with all cameras known."""
    return measured(Colmap(), folder, nominal, cameras="calibration.json")


@pytest.fixture(scope="session")
def lenses(folder, truth):
    """A calibration of the lenses alone."""
    write_calibration_json(folder / "lenses.json", Rig(tuple(view.camera for view in truth.views)))
    return "lenses.json"


@pytest.fixture(scope="session")
def loose(folder, nominal, lenses):
    """The measurement with the lenses known and nothing else."""
    return measured(Colmap(), folder, nominal, cameras=lenses)


def test_points_lie_on_the_true_surface_within_a_twentieth_of_a_pixel(placed, nominal, truth):
    (cloud,) = placed.clouds
    feet = nominal.surface.closest(cloud.points)
    error = feet.distance - truth.deviation(feet.points)
    assert placed.frame == "cad"
    assert len(cloud) > 1000
    assert np.median(np.abs(error)) < 0.010
    assert np.mean(np.abs(error) > 0.1) < 0.02


def test_the_map_holds_the_truth_as_often_as_it_says(placed, nominal, truth):
    (cloud,) = placed.clouds
    alignment = Register(nominal, start=Pose.identity())(cloud)
    found = Deviate()((cloud,), (alignment,), nominal, np.ones(len(nominal.mesh), bool)).deviation
    mesh, seen = nominal.mesh, found.observed
    gauge = best_fit(mesh.nodes[seen], mesh.normals[seen], mesh.areas[seen], found.value[seen])
    off = (found.value[seen] - gauge(truth.deviation(mesh.nodes[seen]))) / found.sigma[seen]
    assert np.count_nonzero(seen) > 300
    assert 0.7 < np.sqrt(np.mean(np.clip(off, -4, 4) ** 2)) < 1.4
    assert np.mean(np.abs(off) < 1.96) > 0.85


@pytest.fixture(scope="session")
def scaled(loose, nominal):
    """Its alignment, with the scale of the CAD."""
    return Register(nominal, scale_known=False)(loose.clouds[0])


def test_known_lenses_place_the_cameras_and_take_the_scale_from_the_cad(loose, scaled, nominal, truth):
    assert not loose.scale_known
    assert any("taken from the CAD" in remark for remark in loose.remarks)
    assert any("centres of the cameras are known to" in remark for remark in loose.remarks)
    centres = np.array([view.centre for view in scaled.views(loose.views)])
    true = np.array([view.centre for view in truth.views])
    stand_off = np.linalg.norm(true - nominal.mesh.nodes.mean(axis=0), axis=1)
    assert (np.linalg.norm(centres - true, axis=1) < 0.003 * stand_off).all()


def test_a_scale_bar_gives_the_scale_and_says_how_well(folder, nominal, truth, lenses, loose, scaled):
    ends = np.array([[12.0, 10.0, 20.0], [10.0, 60.0, 20.0]])
    random = np.random.default_rng(0)
    marks = tuple(
        Mark(name, tuple(map(tuple, view.project(ends) + random.normal(0, 0.1, (2, 2)))))
        for name, view in list(zip(NAMES, truth.views, strict=True))[:3]
    )
    bar = ScaleBar(float(np.linalg.norm(ends[1] - ends[0])), marks, noise=0.1)
    scale, sigma = bar.scale(NAMES, loose.views)
    assert 1e-5 < sigma < 2e-3
    assert abs(scale / scaled.scale - 1) < 3 * sigma + 1e-3
    with_bar = measured(Colmap(scale_bar=bar), folder, nominal, cameras=lenses)
    assert with_bar.scale_known
    assert with_bar.scale_sigma == pytest.approx(sigma, rel=0.2)
    assert any("scale bar" in remark for remark in with_bar.remarks)


def test_a_recipe_measures_a_folder_of_photographs(folder, tmp_path):
    text = (folder / "recipe.toml").read_text(encoding="utf-8")
    start = text.index("images = [")
    lines = text[start:].splitlines()
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for name in NAMES:
        (pictures / name).write_bytes((folder / name).read_bytes())
    for name in ("part.step", "calibration.json"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    recipe = text[:start].replace("element_size = 2.0", "element_size = 4.0") + 'images = "pictures"\n'
    (tmp_path / "recipe.toml").write_text(recipe + "\n".join(lines[1:]), encoding="utf-8")
    run(tmp_path / "recipe.toml", tmp_path / "out")
    results = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    found = results["measurements"]["photographs"]
    assert found["status"] == "ok"
    assert found["alignment"]["scale"] == 1.0
    assert len(found["cameras"]) == 5
    assert any("points per mm²" in remark for remark in found["remarks"])
    assert any("scale is that of the given cameras" in remark for remark in found["remarks"])


def test_one_photograph_is_too_few(folder):
    with pytest.raises(InputError, match="two photographs or more"):
        Colmap().open(files(folder, NAMES[:1]))


def test_focal_lengths_for_other_photographs_are_refused_before_measuring(folder):
    with pytest.raises(InputError, match="focal names 2 values for 5 photographs"):
        Colmap(focal=(2050.0, 2050.0)).open(files(folder))


def test_the_same_photograph_twice_is_refused(folder, tmp_path):
    (tmp_path / "copy.png").write_bytes((folder / NAMES[0]).read_bytes())
    paths = (folder / NAMES[0], tmp_path / "copy.png")
    with pytest.raises(InputError, match=r"view1.png and copy.png are the same picture"):
        Colmap().open(Files(folder, {"images": paths}))


def test_a_blank_photograph_is_refused(folder, tmp_path):
    cv2.imwrite(str(tmp_path / "blank.png"), np.full((512, 612), 90, np.uint8))
    with pytest.raises(InputError, match="blank"):
        Colmap().open(Files(folder, {"images": (folder / NAMES[0], tmp_path / "blank.png")}))


def test_a_photograph_without_speckle_is_named(folder, tmp_path, nominal):
    grey = np.linspace(20, 200, 612)[None] + np.zeros((512, 1))
    cv2.imwrite(str(tmp_path / "bare.png"), grey.astype(np.uint8))
    source = Colmap().open(Files(folder, {"images": (folder / NAMES[0], tmp_path / "bare.png")}))
    with pytest.raises(MeasurementError, match=r"bare.png shows \d+ features"):
        Colmap()(source, nominal)


@pytest.fixture
def other(tmp_path):
    """A photograph of something else."""
    noise = cv2.GaussianBlur(np.random.default_rng(0).normal(size=(512, 612)), (0, 0), 2.0)
    path = tmp_path / "other.png"
    cv2.imwrite(str(path), cv2.normalize(noise, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8))
    return path


@pytest.mark.parametrize("known", [True, False])
def test_photographs_of_different_things_do_not_fit_together(folder, tmp_path, nominal, truth, other, known):
    paths = {"images": (folder / NAMES[0], other)}
    if known:
        two = truth.views[:2]
        rig = Rig(tuple(v.camera for v in two), camera_from_cad=tuple(v.camera_from_cad for v in two))
        write_calibration_json(tmp_path / "two.json", rig)
        paths["cameras"] = (tmp_path / "two.json",)
    method = Colmap(focal=None if known else 2050.0)
    with pytest.raises(MeasurementError, match="do not fit together"):
        method(method.open(Files(folder, paths)), nominal)


def test_a_rough_focal_length_places_all_cameras_as_well_as_is_said_and_leaves_out_what_shows_something_else(
    folder, nominal, truth, other
):
    method = Colmap(focal=1.03 * 2050.0)
    found = method(method.open(Files(folder, {"images": (*(folder / name for name in NAMES), other)})), nominal)
    assert any("other.png could not be placed" in remark for remark in found.remarks)
    (said,) = [remark for remark in found.remarks if "centres of the cameras are known" in remark]
    share = 1e-6 * float(re.search(r"known to ([\d.e+]+) µm", said)[1])
    centres, true = (np.array([view.centre for view in views]) for views in (found.views, truth.views))
    off = similarity_from_landmarks(centres, true, grows=True)(centres) - true
    sigma = share * np.linalg.norm(true - nominal.mesh.nodes.mean(axis=0), axis=1)[:, None]
    assert np.sqrt(np.mean((off / sigma) ** 2)) < 1.5


def test_a_photograph_that_asks_to_be_turned_is_told_of(folder, tmp_path):
    from PIL import Image

    with Image.open(folder / NAMES[1]) as picture:
        exif = picture.getexif()
        exif[0x0112] = 6
        picture.save(tmp_path / "turned.png", exif=exif)
    source = Colmap().open(Files(folder, {"images": (folder / NAMES[0], tmp_path / "turned.png")}))
    assert any("turned.png asks viewers to turn it" in remark for remark in source.remarks)


def test_photographs_of_different_sizes_are_told_of_and_refused_by_a_calibration(folder, tmp_path):
    picture = cv2.imread(str(folder / NAMES[1]), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(tmp_path / "view2.png"), picture[:-8])
    images = (folder / NAMES[0], tmp_path / "view2.png")
    assert any("different sizes" in remark for remark in Colmap().open(Files(folder, {"images": images})).remarks)
    with pytest.raises(InputError):
        Colmap().open(Files(folder, {"images": images, "cameras": (folder / "calibration.json",)}))


def test_photographs_of_different_sizes_are_those_of_cameras_of_their_own(folder, tmp_path, nominal):
    """One photograph is cut to a strip: its principal point is then taken to be in the middle of that."""
    picture = cv2.imread(str(folder / NAMES[1]), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(tmp_path / "view2.png"), picture[20:-20])
    images = (folder / NAMES[0], tmp_path / "view2.png", *(folder / name for name in NAMES[2:]))
    method = Colmap(focal=2050.0)
    found = method(method.open(Files(folder, {"images": images})), nominal)
    sizes = {view.camera.size for view in found.views}
    assert sizes == {(612, 512), (612, 472)}
    assert len(found.clouds[0]) > 1000


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ({"focal": -3.0}, "focal"),
        ({"half_window": 1}, "half_window"),
        ({"spacing": 0.0}, "spacing"),
        ({"features": 3}, "few"),
    ],
)
def test_a_wrong_setting_is_named(setting, words):
    with pytest.raises(ValueError, match=words):
        Colmap(**setting)


def test_a_mask_keeps_points_off_what_it_hides(folder, nominal, tmp_path, truth, placed):
    middle = nominal.mesh.nodes.mean(axis=0)
    for name, view in zip(NAMES, truth.views, strict=True):
        mask = np.full((512, 612), 255, np.uint8)
        mask[:, : int(view.project(middle[None])[0, 0])] = 0
        cv2.imwrite(str(tmp_path / name), mask)
    paths = {"images": [folder / n for n in NAMES], "masks": [tmp_path / n for n in NAMES]}
    source = Colmap().open(Files(folder, {**paths, "cameras": (folder / "calibration.json",)}))
    (cloud,) = Colmap()(source, nominal).clouds
    assert 200 < len(cloud) < 0.8 * len(placed.clouds[0])
    assert np.percentile(cloud.points[:, 0], 2) > middle[0] - 5.0


def test_the_patch_kernel_agrees_with_the_jit_off():
    program = """
import numpy as np
from inspect3d.camera import Camera, View
from inspect3d.correlation.picture import Pictures
from inspect3d.pose import Pose
from inspect3d.triangulation.patches import FitPatches

def texture(x, y):
    return 100 + 40 * np.sin(3.9 * x) * np.cos(3.3 * y) + 30 * np.sin(2.1 * x - 4.1 * y)

u, v = np.meshgrid(np.arange(81.0), np.arange(61.0))
grey, views = 3 * [texture((u - 40) / 4, (30 - v) / 4)], []  # all see the plane z = 0 alike
for x in (-30.0, 0.0, 25.0):
    camera = Camera(np.array([[400.0, 0, 40 + 4 * x], [0, 400.0, 30], [0, 0, 1]]), np.zeros(5), (81, 61))
    views.append(View(camera, Pose(np.diag([1.0, -1.0, -1.0]), np.array([-x, 0.0, 100.0]))))
fit = FitPatches(half=4, steps=8)
points, normals = np.array([[0.5, 0.2, 0.15]]), np.array([[0.0, 0.0, 1.0]])
found = fit._fitted(Pictures(grey).sharp, views, [None] * 3, points, normals)
print(f"{found.points[0, 2]:.9f} {found.normals[0, 2]:.9f} {found.views[0]}")
assert abs(found.points[0, 2]) < 0.01
"""
    with_jit, without = (printed(program, jit) for jit in (True, False))
    assert with_jit == without


def test_two_patches_are_kept_apart(placed):
    from scipy.spatial import cKDTree

    spacing = FitPatches().spacing / 5.0
    gaps = cKDTree(placed.clouds[0].points).query(placed.clouds[0].points, 2)[0][:, 1]
    assert gaps.min() > 0.5 * spacing
