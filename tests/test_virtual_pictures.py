"""Truths about the pictures of the virtual rig: geometry by closed formulas, paint by its own definition."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from inspect3d.camera import Camera, View
from inspect3d.outcome import InputError
from inspect3d.pose import Pose
from inspect3d.virtual.beam_kernel import first_met
from inspect3d.virtual.bracket import bracket
from inspect3d.virtual.deviation_field import Bump, Step, Uniform, Wave
from inspect3d.virtual.freeform import FreeformSizes, freeform
from inspect3d.virtual.milled import milled
from inspect3d.virtual.patch_kernel import MOST, packed, write_place
from inspect3d.virtual.scene import Scene
from inspect3d.virtual.sensor import Sensor
from inspect3d.virtual.speckle import Speckle
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d.virtual.virtual_camera import VirtualCamera
from inspect3d.virtual.warp import Warp
from tests.jit import printed

SMALL = StereoRig(scale=4.0, focal=1640.0, size=(300, 250), offset=2.0)
FORM = Wave(0.02, (0.009, 0.004, 0.0), 0.3) + Bump((52.0, 42.0, 5.0), 0.2, 12.0)
PARTS = {"bracket": bracket(), "freeform": freeform(), "milled": milled()}
FLAT = freeform(FreeformSizes(relief=0.0))
BROWN = np.array([-0.15, 0.08, 0.001, -0.0008, 0.02])


@pytest.fixture(scope="module")
def surfaces():
    return {name: part.surface() for name, part in PARTS.items()}


@pytest.fixture(scope="module")
def flat():
    return FLAT.surface()


@pytest.fixture(scope="module")
def sheet(surfaces):
    return Scene(surfaces["freeform"], FORM, Speckle(dot=4.0))


def middle(surface):
    return (surface.vertices.min(axis=0) + surface.vertices.max(axis=0)) / 2


def grid(view, step=1):
    width, height = view.camera.size
    return np.stack(np.meshgrid(np.arange(0, width, step), np.arange(0, height, step)), axis=-1).reshape(-1, 2) * 1.0


def lines_of_sight(view, pixels):
    ahead = np.column_stack([view.camera.undistorted(pixels), np.ones(len(pixels))])
    ahead = view.camera_from_cad.inverse().turned(ahead)
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)


@pytest.mark.parametrize("name", PARTS)
def test_the_kernel_of_a_patch_finds_what_the_patch_finds(name, surfaces):
    patches, random = surfaces[name].patches, np.random.default_rng(0)
    arrays, basis, place = packed(patches), np.empty((2, 2, MOST)), np.empty((4, 3))
    for k, patch in enumerate(patches):
        u, v = patch.knots_u, patch.knots_v
        degrees = len(u) - patch.poles.shape[0] - 1, len(v) - patch.poles.shape[1] - 1
        ends = [(knots[degree], knots[-degree - 1]) for knots, degree in zip((u, v), degrees, strict=True)]
        at = random.uniform(*np.transpose(ends), (20, 2))
        points, normals = patch(at)
        expected = np.stack([*patch.derivatives(at), normals], axis=1)
        for (x, y), wanted in zip(at, expected, strict=True):
            write_place(arrays, k, x, y, basis, place)
            np.testing.assert_allclose(place, wanted, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(points, expected[:, 0], atol=1e-12)


@pytest.mark.parametrize("name", PARTS)
def test_a_beam_meets_the_triangles_that_its_rays_meet_one_by_one(name, surfaces):
    from inspect3d.nominal.bvh import build

    surface = surfaces[name]
    view = SMALL(middle(surface), 3)[0]
    rays = lines_of_sight(view, grid(view, 3))
    tree = build(surface.vertices[surface.triangles], surface.triangulation.face_normals)
    triangle, distance = np.empty(len(rays), np.int64), np.empty(len(rays))
    first_met(view.centre, rays, tree, triangle, distance)
    expected = surface.triangulation.first_hit(view.centre, rays)
    np.testing.assert_array_equal(triangle, expected.triangle)
    np.testing.assert_allclose(distance, expected.distance, rtol=1e-13)


@pytest.mark.parametrize("name", PARTS)
def test_a_line_of_sight_ends_on_the_true_surface(name, surfaces):
    surface = surfaces[name]
    deviation = Wave(0.05, (0.02, 0.03, 0.01), 0.4) + Uniform(0.1)
    scene, view = Scene(surface, deviation, Speckle()), SMALL(middle(surface), 4)[1]
    rays = lines_of_sight(view, grid(view, 2))
    seen = scene.sights(view.centre, rays)
    ends = seen.points + seen.height[:, None] * seen.normals - view.centre
    off = np.linalg.norm(np.cross(ends, rays), axis=1)[seen.hit]
    steep = -np.einsum("ni,ni->n", seen.normals, rays)[seen.hit] > 0.3
    assert np.count_nonzero(steep) > 5000
    assert off[steep].max() < 1e-6
    np.testing.assert_allclose(seen.height[seen.hit], deviation(seen.points[seen.hit]), atol=1e-5)


@pytest.mark.parametrize("name", PARTS)
def test_a_camera_sees_what_nothing_hides(name, surfaces):
    surface = surfaces[name]
    scene, view = Scene(surface, Uniform(), Speckle()), SMALL(middle(surface), 5)[0]
    rays = lines_of_sight(view, grid(view, 3))
    seen = scene.sights(view.centre, rays)
    depth = np.linalg.norm(seen.points - view.centre, axis=1)[seen.hit]
    facing = -np.einsum("ni,ni->n", seen.normals, rays)[seen.hit]
    hits = surface.triangulation.first_hit(view.centre, rays[seen.hit], depth - 1.0)
    assert (hits.triangle[facing > 0.2] < 0).all()
    assert facing.min() > -0.2


def test_a_displaced_point_is_seen_at_its_displaced_place(surfaces):
    surface = surfaces["freeform"]
    scene, view = Scene(surface, FORM, Speckle()), StereoRig()(middle(surface), 6)[0]
    points, normals = surface.sample(4000, np.random.default_rng(6))
    inside = np.all((points[:, :2] > 1.0) & (points[:, :2] < [103.0, 83.0]), axis=1)
    points, normals = points[inside], normals[inside]
    pixels = view.project(points + FORM(points)[:, None] * normals)
    seen = scene.sights(view.centre, lines_of_sight(view, pixels))
    assert seen.hit.all()
    assert np.abs(view.project(seen.points) - view.project(points)).max() < 1e-3
    assert np.abs(pixels - view.project(points)).max() > 0.5


def plane_picture(flat, height, **settings):
    view = SMALL(np.array([52.0, 42.0, 0.0]), 7)[0]
    view = View(Camera(view.camera.matrix, BROWN, view.camera.size), view.camera_from_cad)
    return view, VirtualCamera(view, **settings).light(Scene(flat, Uniform(height), Speckle(dot=2.0, seed=3)))


def test_a_picture_of_a_plane_is_its_paint_at_the_back_projected_pixels(flat):
    view, light = plane_picture(flat, 0.25, samples=1, blur=0.0)
    pixels = grid(view)
    rays = lines_of_sight(view, pixels)
    on_plane = view.centre + ((0.25 - view.centre[2]) / rays[:, 2])[:, None] * rays - [0.0, 0.0, 0.25]
    inside = np.all((on_plane[:, :2] > 0.1) & (on_plane[:, :2] < [103.9, 83.9]), axis=1)
    assert np.count_nonzero(inside) > 30_000
    expected = Speckle(dot=2.0, seed=3)(on_plane[inside])
    np.testing.assert_allclose(light.ravel()[inside], expected, atol=1e-6)


def test_a_warped_picture_shows_at_a_pixel_what_stands_beside_it(flat):
    warp = Warp(tau=1.5, length=60.0, seed=4)
    view, light = plane_picture(flat, 0.0, samples=1, blur=0.0, warp=warp)
    pixels = grid(view) + warp(np.arange(300.0), np.arange(250.0)).reshape(-1, 2)
    rays = lines_of_sight(view, pixels)
    on_plane = view.centre - (view.centre[2] / rays[:, 2])[:, None] * rays
    inside = np.all((on_plane[:, :2] > 0.1) & (on_plane[:, :2] < [103.9, 83.9]), axis=1)
    np.testing.assert_allclose(light.ravel()[inside], Speckle(dot=2.0, seed=3)(on_plane[inside]), atol=1e-6)


def test_a_warp_has_its_size_and_its_length():
    at = np.array([0.0, 30.0, 60.0, 500.0])
    values = np.array([Warp(2.0, 60.0, seed)(at, np.array([7.0, 8.0]))[0] for seed in range(600)])
    assert values.std() == pytest.approx(2.0, rel=0.05)
    correlation = np.corrcoef(values[:, :, 0].T)[0]
    np.testing.assert_allclose(correlation, [1.0, np.exp(-1 / 8), np.exp(-1 / 2), 0.0], atol=0.12)


def test_a_warp_is_the_same_field_whichever_band_of_the_picture_asks():
    warp, columns, rows = Warp(0.5, 80.0, 1), np.arange(40.0), np.arange(200.0)
    whole = warp(columns, rows)
    np.testing.assert_allclose(warp(columns, rows[150:160]), whole[150:160], atol=2e-4)


def test_a_plane_raised_is_a_camera_lowered(flat):
    view = SMALL(np.array([52.0, 42.0, 0.0]), 8)[0]
    lowered = View(view.camera, view.camera_from_cad @ Pose(np.eye(3), np.array([0.0, 0.0, 0.3])))
    raised = VirtualCamera(view).light(Scene(flat, Uniform(0.3), Speckle(dot=2.0)))
    seen_lower = VirtualCamera(lowered).light(Scene(flat, Uniform(), Speckle(dot=2.0)))
    np.testing.assert_allclose(raised[60:-60, 70:-70], seen_lower[60:-60, 70:-70], atol=1e-5)


def test_two_cameras_see_the_same_grey_level_at_the_same_point(surfaces):
    surface = surfaces["freeform"]
    scene = Scene(surface, FORM, Speckle(dot=6.0, softness=1.0))
    rig = replace(SMALL, scale=5.0, focal=2050.0)
    points, normals = surface.sample(6000, np.random.default_rng(9))
    true = points + FORM(points)[:, None] * normals
    greys, inside = [], np.all((points[:, :2] > 5.0) & (points[:, :2] < [99.0, 79.0]), axis=1)
    for view in rig(middle(surface), 9):
        light = VirtualCamera(view, samples=1, blur=0.0).light(scene)
        pixels = view.project(true)
        inside &= np.all((pixels > 5) & (pixels < np.array(view.camera.size) - 6), axis=1)
        greys.append(map_coordinates(light, pixels[:, ::-1].T, order=5))
    assert np.count_nonzero(inside) > 1500
    difference = np.abs(greys[0] - greys[1])[inside]
    assert np.percentile(difference, 99) < 1e-3
    np.testing.assert_allclose(greys[0][inside], scene.speckle(points[inside]), atol=4e-3)


def test_a_pixel_converges_to_the_mean_of_its_area(sheet):
    view = SMALL(middle(sheet.surface), 10)[0]
    coarse, medium, exact = (VirtualCamera(view, samples=n, blur=0.0).light(sheet) for n in (1, 2, 4))
    inside = np.s_[60:-60, 60:-60]
    rough, better = (np.sqrt(np.mean((light - exact)[inside] ** 2)) for light in (coarse, medium))
    assert better < 0.35 * rough
    assert better < 0.01


def test_blur_is_a_gaussian_of_its_size_in_pixels(sheet):
    view = SMALL(middle(sheet.surface), 11)[0]
    sharp, blurred = (VirtualCamera(view, samples=2, blur=blur).light(sheet) for blur in (0.0, 1.5))
    expected = gaussian_filter(sharp, 1.5, truncate=5.0)
    np.testing.assert_allclose(blurred[10:-10, 10:-10], expected[10:-10, 10:-10], atol=4e-3)


def test_the_same_seed_gives_the_same_picture_and_another_one_other_noise(sheet):
    camera = VirtualCamera(SMALL(middle(sheet.surface), 12)[0])
    np.testing.assert_array_equal(camera(sheet, 1), camera(sheet, 1))
    assert np.count_nonzero(camera(sheet, 1) != camera(sheet, 2)) > 10_000


def test_a_step_is_seen_on_both_of_its_sides(flat):
    step = Step(0.2, (52.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    scene, view = Scene(flat, step, Speckle()), SMALL(np.array([52.0, 42.0, 0.0]), 13)[0]
    seen = scene.sights(view.centre, lines_of_sight(view, grid(view)))
    away = seen.hit & (np.abs(seen.points[:, 0] - 52.0) > 0.2)
    np.testing.assert_array_equal(seen.height[away], step(seen.points[away]))
    assert 0.3 < np.mean(seen.height[away] > 0.1) < 0.7


def test_a_lamp_lights_a_slope_by_the_cosine_and_a_lens_darkens_the_corners(flat):
    view = SMALL(np.array([52.0, 42.0, 0.0]), 14)[0]
    plain = Scene(flat, Uniform(), Speckle(ground=0.8, ink=0.8))
    lit = VirtualCamera(view, lamp=(0.0, np.sqrt(3.0), 1.0), ambient=0.2).light(plain)
    assert lit[125, 150] == pytest.approx(0.8 * (0.2 + 0.8 * 0.5), abs=1e-6)
    light = VirtualCamera(view, background=1.0).light(plain)
    dark = VirtualCamera(view, background=1.0, vignetting=0.3).light(plain)
    assert dark[0, 0] / light[0, 0] == pytest.approx(0.7, abs=0.005)
    assert dark[125, 150] / light[125, 150] == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(("bits", "kind"), [(8, np.uint8), (12, np.uint16), (16, np.uint16)])
def test_a_sensor_without_noise_rounds_and_clips(bits, kind):
    light = np.linspace(-0.5, 1.5, 3001).reshape(1, -1)
    levels = Sensor(bits, gain=0.8, offset=0.1, noise=0.0)(light, np.random.default_rng(0))
    wanted = np.clip((0.1 + 0.8 * light) * (2**bits - 1), 0, 2**bits - 1)
    assert levels.dtype == kind
    assert np.abs(levels - wanted).max() <= 0.5


def test_a_sensor_has_the_noise_it_states():
    levels = Sensor(16, noise=0.01)(np.full((500, 500), 0.5), np.random.default_rng(1))
    assert levels.std() / 65535 == pytest.approx(0.01, rel=0.01)


def test_paint_scales_with_its_dots_and_follows_its_seed():
    points = np.random.default_rng(15).uniform(-30, 30, (5000, 3))
    np.testing.assert_allclose(Speckle(0.6)(2 * points), Speckle(0.3)(points), atol=1e-12)
    same, other = Speckle(seed=4)(points), Speckle(seed=5)(points)
    np.testing.assert_array_equal(same, Speckle(seed=4)(points))
    assert abs(np.corrcoef(same, other)[0, 1]) < 0.05


def test_nearly_two_fifths_of_the_surface_are_painted_and_paint_keeps_its_range():
    points = np.random.default_rng(16).uniform(-40, 40, (100_000, 3))
    greys = Speckle(ground=0.9, ink=0.2)(points)
    assert greys.min() >= 0.2
    assert greys.max() <= 0.9
    assert np.mean(greys < 0.55) == pytest.approx(0.39, abs=0.02)


def test_paint_has_no_edges():
    along = np.linspace(0.0, 50.0, 200_001)[:, None] * [0.6, 0.64, 0.48]
    slope = np.diff(Speckle(dot=1.0)(along)) / (50.0 / 200_000)
    assert np.abs(np.diff(slope)).max() < 0.02 * np.abs(slope).max()


@pytest.mark.parametrize("cameras", [2, 3, 4])
def test_a_rig_sees_its_target_in_the_middle_at_its_scale(cameras):
    target, rig = np.array([52.0, 42.0, 5.0]), StereoRig(cameras=cameras)
    views = rig(target, 17)
    for view in views:
        pixel = view.project(target[None])[0]
        assert np.abs(pixel - [1223.5, 1023.5]).max() < 80
        right = view.camera_from_cad.rotation[0]
        assert np.linalg.norm(view.project((target + right)[None])[0] - pixel) == pytest.approx(20.0, rel=0.02)
    gaps = [np.linalg.norm(view.centre - target) for view in views]
    np.testing.assert_allclose(gaps, 410.0, rtol=1e-9)


def test_two_cameras_stand_left_and_right_as_far_apart_as_asked():
    target = np.array([1.0, 2.0, 3.0])
    left, right = StereoRig(angle=radians(30.0))(target, 18)
    a, b = left.centre - target, right.centre - target
    assert np.degrees(np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))) == pytest.approx(30.0)
    assert left.centre[0] < target[0] < right.centre[0]
    assert left.camera_from_cad.rotation[1, 1] < -0.99


def test_a_halved_rig_sees_the_same_with_half_the_pixels():
    target = np.array([52.0, 42.0, 5.0])
    points = target + np.random.default_rng(19).uniform(-30, 30, (50, 3))
    for full, half in zip(StereoRig()(target, 20), StereoRig().halved()(target, 20), strict=True):
        np.testing.assert_allclose((full.project(points) + 0.5) / 2 - 0.5, half.project(points), atol=1e-9)


def test_a_lens_that_folds_the_picture_is_an_error(sheet):
    view = SMALL(middle(sheet.surface), 21)[0]
    folded = View(Camera(view.camera.matrix, [-60.0, 0, 0, 0, 0], view.camera.size), view.camera_from_cad)
    with pytest.raises(InputError, match="cannot be undone"):
        VirtualCamera(folded).light(sheet)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Speckle(dot=0.0),
        lambda: Speckle(ink=1.5),
        lambda: Speckle(seed=-1),
        lambda: Sensor(bits=10),
        lambda: Sensor(noise=-1.0),
        lambda: StereoRig(cameras=1),
        lambda: StereoRig(scale=0.0),
    ],
)
def test_settings_that_cannot_be_are_refused(wrong):
    with pytest.raises(ValueError, match=r"is|has|lies"):
        wrong()


def test_the_kernels_give_the_same_with_and_without_the_compiler():
    program = (
        "import numpy as np; from inspect3d.virtual.freeform import freeform_patch, FreeformSizes;"
        "from inspect3d.virtual.part_surface import PartSurface; from inspect3d.virtual.scene import Scene;"
        "from inspect3d.virtual.speckle import Speckle; from inspect3d.virtual.deviation_field import Bump;"
        "p = freeform_patch(FreeformSizes()); at = np.array([[0, 0], [1, 0], [1, 1], [0, 1.]]);"
        "s = PartSurface((p,), p(at)[0], at, [[0, 1, 2], [0, 2, 3]], [0, 0]);"
        "c = Scene(s, Bump((50, 40, 5), .2, 12), Speckle(seed=2)); o = np.array([50., 40, 400]);"
        "d = p(np.linspace(.3, .6, 24).reshape(12, 2))[0] - o; d /= np.linalg.norm(d, axis=1)[:, None];"
        "r = c.sights(o, d); print(np.round([*r.points.T, r.height, c.speckle(r.points)], 9).tolist())"
    )
    assert printed(program, jit=True) == printed(program, jit=False)
