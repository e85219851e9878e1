"""The stereocorrelation plugin, from a recipe with photographs to the results on disk."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import pyvista as pv

from inspect3d.files.calibration import CameraSigma, Rig
from inspect3d.files.calibration_json import write_calibration_json
from inspect3d.inspection import check, run
from inspect3d.outcome import InputError, Status
from inspect3d.register.gauge import best_fit
from tests.sheets import grid, plane, plane_normals, wave
from tests.speckled import Speckle, photographed, picture, rig

CHECKER = Path(__file__).parents[2] / "shared" / "tools" / "check_contract.py"
PICKS = np.array([[4.0, 4.0], [56.0, 5.0], [54.0, 41.0], [6.0, 40.0], [30.0, 22.0], [16.0, 30.0]])


def bump(x, y, height=0.03):
    """Return a deviation in the middle of the sheet, mm."""
    return height * np.exp(-((x - 25) ** 2 + (y - 20) ** 2) / 2 / 8**2)


def surface(height=wave):
    """Return the points that are picked on the CAD."""
    return np.column_stack([PICKS, height(*PICKS.T)])


def photographs(folder, views, deviation=bump, pattern=0, noise=2.4, **form):
    """Write pictures of the sheet as left.png and right.png."""
    random = np.random.default_rng(5)
    speckle = Speckle.drawn(np.random.default_rng(pattern), 0.7)
    for name, view in zip(("left.png", "right.png"), views, strict=True):
        grey = photographed(random, picture(view, speckle, deviation, **form), noise, random.uniform(0.8, 1.0), 4)
        cv2.imwrite(str(folder / name), grey.astype(np.uint8))


def cad(folder, height=wave):
    """Write the sheet as a mesh file."""
    nodes, triangles = grid(height, 0.5)
    pv.PolyData.from_regular_faces(nodes, triangles).save(folder / "part.ply")


def recipe(folder, measurement="", element=4.0, part=""):
    """Write a recipe and return its path."""
    text = f"""
schema = 1
[part]
name = "Sheet"
cad = "part.ply"
element_size = {element}
tolerance = [-0.02, 0.02]
{part}
[[measurements]]
name = "stereo"
method = "stereocorrelation"
images = ["left.png", "right.png"]
{measurement}
"""
    (folder / "recipe.toml").write_text(text, encoding="utf-8")
    return folder / "recipe.toml"


def landmarks(views, error=0.0, height=wave):
    """Return picked points as a recipe has them."""
    random = np.random.default_rng(2)
    points = surface(height)
    pixels = np.stack([view.project(points) for view in views], axis=1)
    pixels = pixels + error * random.normal(size=pixels.shape)
    rows = (f"{{ cad = {p.tolist()}, pixels = {q.tolist()} }}" for p, q in zip(points, pixels, strict=True))
    return "landmarks = [" + ", ".join(rows) + "]\n"


@pytest.fixture(scope="module")
def views():
    """Return two cameras 27 degrees apart."""
    return rig()


@pytest.fixture(scope="module")
def folder(tmp_path_factory, views):
    """Return a folder with the part, its photographs and calibrations."""
    folder = tmp_path_factory.mktemp("sheet")
    cad(folder)
    photographs(folder, views)
    lenses = tuple(view.camera for view in views)
    places = tuple(view.camera_from_cad for view in views)
    write_calibration_json(folder / "placed.json", Rig(lenses, camera_from_cad=places))
    first = places[0].inverse()
    write_calibration_json(folder / "rig.json", Rig(lenses, camera_from_rig=tuple(place @ first for place in places)))
    write_calibration_json(folder / "lenses.json", Rig(lenses, sigmas=(CameraSigma(focal=1.0, centre=1.0),) * 2))
    return folder


def inspected(folder, measurement, **more):
    """Run a recipe and return its only part, the nominal and the folder of results."""
    record = run(recipe(folder, measurement, **more), folder / "out")
    return record.parts[0], record.nominal


def errors(part, nominal, deviation=bump, growth=False):
    """Return errors and their ratio to the claim at the observed nodes, in the common gauge."""
    seen = part.deviation.observed
    mesh = nominal.mesh
    value = part.deviation.value[seen]
    gauge = best_fit(mesh.nodes[seen], mesh.normals[seen], mesh.areas[seen], value, growth)
    error = value - gauge(deviation(mesh.nodes[seen, 0], mesh.nodes[seen, 1]))
    return error, error / part.deviation.sigma[seen]


def rms(values):
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.fixture(scope="module")
def placed(folder):
    """Return the inspection with cameras in known places."""
    part, nominal = inspected(folder, 'cameras = "placed.json"\nsystematic = 0.0\nalignment = { start = "identity" }\n')
    (folder / "out").rename(folder / "placed")
    return part, nominal, folder / "placed"


def test_a_map_that_is_smoothed_is_called_so(folder):
    found, _ = inspected(folder, 'cameras = "placed.json"\nsmoothing = 0.1')
    assert found.remarks[0].startswith("This map is smoothed (smoothing = 0.1), by ")
    assert "smoothing" in [source for source, _, _ in found.contributions]
    with pytest.raises(InputError, match=r"smoothing = 0\.3 is not between 0 and 0\.1"):
        check(recipe(folder, 'cameras = "placed.json"\nsmoothing = 0.3'))


def test_the_bump_is_found_with_a_true_uncertainty(placed):
    part, nominal, _ = placed
    error, z = errors(part, nominal)
    assert part.status is Status.OK
    assert part.deviation.observed.mean() > 0.9
    assert rms(error) < 0.0035
    assert 0.8 < rms(z) < 1.2


def test_the_results_keep_the_contract(placed):
    if not CHECKER.exists():
        pytest.skip("the contract's checker is not beside the repository")
    checked = subprocess.run([sys.executable, CHECKER, placed[2]], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout


def test_the_results_hold_cameras_residuals_and_figures(placed, views):
    part, _, out = placed
    values = json.loads((out / "results.json").read_text(encoding="utf-8"))["measurements"]["stereo"]
    for camera, view in zip(values["cameras"], views, strict=True):
        np.testing.assert_allclose(camera["camera_from_cad"], view.camera_from_cad.matrix, atol=0.2)
        np.testing.assert_allclose(camera["matrix"], view.camera.matrix)
    assert values["hidden"] == []
    residual = np.asarray(pv.read(out / "stereo.vtp").point_data["residual"])
    assert np.isfinite(residual[part.deviation.observed]).all()
    assert np.nanmax(residual) < 0.3
    drawn = {path.stem for path in (out / "pictures").glob("*.png")}
    assert {"stereo_picture_1", "stereo_picture_2", "stereo_residual_start", "stereo_residual_shape"} <= drawn
    assert "stereo_convergence" in drawn


def test_in_place_nothing_is_taken_out(tmp_path, folder, views):
    for name in ("part.ply", "placed.json"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    photographs(tmp_path, views, lambda x, y: 0.05 + 0 * x)
    part, _ = inspected(
        tmp_path, 'cameras = "placed.json"\nalignment = { start = "identity", refine = false }\nsystematic = 0.0\n'
    )
    assert np.nanmean(part.deviation.value) == pytest.approx(0.05, abs=0.001)
    np.testing.assert_allclose(part.alignments[0].cad_from_measured.matrix, np.eye(4), atol=1e-9)


def test_a_rig_is_placed_by_picks(folder, views):
    part, nominal = inspected(folder, 'cameras = "rig.json"\nsystematic = 0.0\n' + landmarks(views, 1.0))
    error, z = errors(part, nominal)
    assert rms(error) < 0.0035
    assert 0.75 < rms(z) < 1.25
    cad_from_rig = part.alignments[0].cad_from_measured
    np.testing.assert_allclose((cad_from_rig @ views[0].camera_from_cad).matrix, np.eye(4), atol=0.02)
    assert part.alignments[0].scale == 1.0


def test_calibrated_lenses_and_picks_see_all_but_the_scale(folder, views):
    part, nominal = inspected(folder, 'cameras = "lenses.json"\nsystematic = 0.0\n' + landmarks(views, 1.0))
    error, z = errors(part, nominal, growth=True)
    assert "growth of the whole part: the scale is not known" in part.hidden
    assert rms(error) < 0.006
    assert 0.5 < rms(z) < 1.4


def test_a_rough_focal_length_and_picks_suffice(folder, views):
    part, nominal = inspected(folder, "focal = 2472.0\n" + landmarks(views, 1.0))
    _, z = errors(part, nominal, growth=True)
    assert part.status is Status.OK
    assert part.deviation.observed.mean() > 0.9
    assert rms(z) < 1.4
    assert any("2472 px ± 5 % by the recipe" in remark for remark in part.remarks)
    assert any("6 landmarks" in remark for remark in part.remarks)


def test_masked_out_nodes_are_not_observed(folder, views):
    for name in ("left", "right"):
        mask = np.zeros((480, 620), np.uint8)
        mask[:, :310] = 255
        cv2.imwrite(str(folder / f"{name}_mask.png"), mask)
    part, nominal = inspected(
        folder,
        'cameras = "placed.json"\nmasks = ["left_mask.png", "right_mask.png"]\nalignment = { start = "identity" }\n',
    )
    shown = np.stack([view.project(nominal.mesh.nodes)[:, 0] < 310 for view in views]).all(axis=0)
    seen = part.deviation.observed
    assert seen.sum() > 0.8 * shown.sum()
    assert np.count_nonzero(seen & ~shown) < 0.1 * seen.sum()


def failed(folder, measurement, **more):
    """Run a recipe that gives no map, and return the reason."""
    part, _ = inspected(folder, measurement, **more)
    assert part.status is Status.FAILED
    assert part.deviation is None
    return part.reason


def test_swapped_pictures_are_refused(folder):
    swapped = 'cameras = "placed.json"\n'
    text = recipe(folder, swapped).read_text().replace('["left.png", "right.png"]', '["right.png", "left.png"]')
    (folder / "recipe.toml").write_text(text)
    part = run(folder / "recipe.toml", folder / "out").parts[0]
    assert part.status is Status.FAILED
    assert "in the order of the cameras" in part.reason


def test_pictures_of_different_parts_are_refused(tmp_path, folder, views):
    for name in ("part.ply", "placed.json", "left.png"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    photographs(tmp_path, views, pattern=7)
    (tmp_path / "left.png").write_bytes((folder / "left.png").read_bytes())
    assert "show this part with its speckle" in failed(tmp_path, 'cameras = "placed.json"\n')


def test_a_part_that_turns_its_back_is_refused(folder):
    reason = failed(folder, 'cameras = "placed.json"\n', part="flip = true")
    assert "normals of the part point out of the material" in reason


def test_picks_in_the_wrong_order_are_refused(folder, views):
    text = landmarks(views)
    rows = text.split("pixels = ")
    rows[1:] = [*(tail.split(" }", 1)[0] for tail in rows[1:])]
    pixels = rows[1:][::-1]
    points = surface()
    mixed = ", ".join(f"{{ cad = {p.tolist()}, pixels = {q} }}" for p, q in zip(points, pixels, strict=True))
    reason = failed(folder, f"focal = 2400.0\nlandmarks = [{mixed}]\n")
    assert "order" in reason


def test_a_mesh_ten_times_too_fine_is_refused_with_a_size_that_serves(folder):
    reason = failed(folder, 'cameras = "placed.json"\n', element=0.35)
    assert reason.startswith("The mesh is too fine for the speckle")
    size = float(reason.split("element_size of ")[1].split(" mm")[0])
    assert 1.0 < size < 4.0


def test_a_flat_part_with_free_lenses_claims_no_more_than_it_tells(tmp_path, views):
    cad(tmp_path, plane)
    photographs(tmp_path, views, height=plane, normals=plane_normals)
    part, nominal = inspected(tmp_path, "focal = 2472.0\n" + landmarks(views, 1.0, plane))
    _, z = errors(part, nominal, growth=True)
    assert len(part.hidden) > 3
    assert rms(z) < 1.5


@pytest.mark.parametrize(
    ("measurement", "says"),
    [
        ("", "Nothing tells the focal length of left.png: give a rough `focal`"),
        ('cameras = "part.ply"', "is no calibration that inspect3d reads"),
        ("landmarks = [{ cad = [0, 0, 0], pixels = [[1, 2]] }]", "Landmark 1 has 1 pixels for 2 pictures"),
        ("landmarks = [{ cad = [0, 0, 0], pixels = [[1, 2], [3, 4]] }]", "There are 1 landmarks, and 4 or more"),
        ("landmarks = [{ cad = [0, 0], pixels = [[1, 2], [3, 4]] }]", "landmarks"),
        ("focal = -3.0", "focal = -3 is not a focal length"),
        ("focal = [2400.0, 2400.0, 2400.0]", "`focal` has 3 values for 2 pictures"),
        ('masks = ["left.png"]\ncameras = "placed.json"', "`masks` names 1 files for 2 pictures"),
        ("systematic = -1.0", "systematic = -1 is negative"),
        ("steepest = 90.0", "not between 0 and 90 degrees"),
        ('solve = "twice"', "solve"),
    ],
)
def test_mistakes_in_the_recipe_are_told_before_anything_is_measured(folder, measurement, says):
    with pytest.raises(InputError, match=says):
        check(recipe(folder, measurement))


@pytest.mark.parametrize("known", ["rig", "lenses"])
def test_a_place_that_nothing_tells_is_not_kept(folder, views, known):
    text = f'cameras = "{known}.json"\nalignment = {{ refine = false }}\n' + landmarks(views)
    with pytest.raises(InputError, match="refine = false keeps the part in the place it is said to have"):
        check(recipe(folder, text))


def test_one_picture_twice_and_a_single_picture_are_refused(folder):
    text = recipe(folder, 'cameras = "placed.json"').read_text()
    for images, says in (('"left.png", "left.png"', "the same picture"), ('"left.png"', "two pictures or more")):
        (folder / "recipe.toml").write_text(text.replace('"left.png", "right.png"', images))
        with pytest.raises(InputError, match=says):
            check(folder / "recipe.toml")


def test_a_check_tells_what_is_known_of_the_cameras(folder):
    for name, words in (("placed", "in their places before the part"), ("lenses", "of calibrated lenses")):
        more = landmarks(rig()) if name == "lenses" else ""
        assert any(words in line for line in check(recipe(folder, f'cameras = "{name}.json"\n{more}')))


def test_a_calibration_of_vague_places_is_believed_no_more_than_it_says(folder, views):
    lenses = tuple(view.camera for view in views)
    places = tuple(view.camera_from_cad for view in views)
    random = np.random.default_rng(11)
    wrong = [replace(place, translation=place.translation + random.normal(0, 0.02, 3)) for place in places]
    vague = Rig(lenses, camera_from_cad=tuple(wrong), sigmas=(CameraSigma(translation=0.02),) * 2)
    write_calibration_json(folder / "vague.json", vague)
    part, nominal = inspected(folder, 'cameras = "vague.json"\nsystematic = 0.0\nalignment = { start = "identity" }\n')
    _, z = errors(part, nominal)
    assert 0.5 < rms(z) < 1.5
