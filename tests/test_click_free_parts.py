"""What the start without a click is made of: which cameras can be placed, further ones, the outline of the part."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.nominal.surface import Surface
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from inspect3d.starting.bundle import Bundle, Lines, adjusted
from inspect3d.starting.contour import Contours
from inspect3d.starting.features import Features
from inspect3d.starting.fitting import fitted
from inspect3d.starting.further import with_further
from inspect3d.starting.relative import joined, relative
from inspect3d.starting.texture import Texture
from tests.sheets import DEPTH, WIDTH, grid, wave
from tests.speckled import rig

EXACT = Lens()
NOISE = 0.3
THREE = (-0.3, 0.0, 0.3)


def sheet_points(count, seed):
    """Return points of the wavy sheet, (count, 3) mm."""
    x, y = np.random.default_rng(seed).uniform([3, 3], [WIDTH - 3, DEPTH - 3], (count, 2)).T
    return np.stack([x, y, wave(x, y)], axis=1)


def tracks(views, points, shown):
    """Return where views see points (n, 3), NaN where `shown` (n, v) says that they do not."""
    pixels = np.stack([view.project(points) for view in views], axis=1)
    return np.where(shown[:, :, None], pixels, np.nan)


def apart():
    """Return three views, and tracks of which the third view shares none with both of the others."""
    views, points = rig(angles=THREE), sheet_points(400, 1)
    shown = np.ones((400, 3), bool)
    shown[:250, 2] = False
    shown[250:, 0] = False
    return views, points, tracks(views, points, shown)


def test_a_camera_is_placed_if_it_shows_what_two_others_show():
    views, points, pixels = apart()
    assert joined(pixels) == (0, 1)
    assert set(joined(tracks(views, points, np.ones((400, 3), bool)))) == {0, 1, 2}
    with pytest.raises(MeasurementError, match="Picture 3 has too little in common"):
        relative([view.camera for view in views], [EXACT] * 3, pixels, NOISE)


def free(views):
    """Return the freedom of cameras with exact lenses."""
    return Freedom("free", (EXACT,) * len(views), views, np.zeros(3))


def test_a_camera_that_shares_with_one_other_only_is_placed_by_what_it_sees_of_the_cad():
    views, points, pixels = apart()
    nodes, triangles = grid(wave, 0.5)
    surface = Surface(nodes, triangles)
    few = slice(0, 200)
    fit = fitted(Bundle(views[:2], points[few], pixels[few, :2]), np.zeros((200, 3)), surface, free, NOISE, (1e-3,))
    cameras = [view.camera for view in views]
    looks = np.random.default_rng(2).normal(size=(400, 128)).astype(np.float32)
    looks /= np.linalg.norm(looks, axis=1, keepdims=True)
    seen = np.isfinite(pixels[:, :, 0])
    features = [Features(pixels[seen[:, k], k], looks[seen[:, k]], 1.0) for k in range(3)]
    whole = with_further(fit, (0, 1), cameras, features, surface, free, NOISE)
    for found, true in zip(whole.bundle.views, views, strict=True):
        np.testing.assert_allclose(found.project(points), true.project(points), atol=0.2)
    features[2] = Features(features[2].pixels, np.roll(features[2].looks, 64, axis=1), 1.0)
    with pytest.raises(MeasurementError, match="Picture 3 has too little in common"):
        with_further(fit, (0, 1), cameras, features, surface, free, NOISE)


def test_cameras_in_one_place_are_refused():
    view, random = rig()[0], np.random.default_rng(0)
    points = random.uniform([0, 0, -20], [60, 45, 20], (300, 3))
    pixels = tracks((view, view), points, np.ones((300, 2), bool)) + random.normal(0, 0.2, (300, 2, 2))
    with pytest.raises(MeasurementError, match="hardly cross"):
        relative([view.camera] * 2, [EXACT] * 2, pixels, NOISE)


def ball(radius=15.0):
    """Return a ball in the middle of what the views see, and its middle."""
    middle = np.array([WIDTH / 2, DEPTH / 2, 0.0])
    mesh = pv.Icosphere(radius=radius, center=tuple(middle), nsub=5)
    return Surface(np.asarray(mesh.points, np.float64), mesh.faces.reshape(-1, 4)[:, 1:]), middle


def test_the_outline_of_a_ball_is_where_lines_of_sight_touch_it():
    surface, middle = ball()
    view = rig()[0]
    contour = Contours(surface)(view, 1.0)
    assert len(contour.points) > 100
    normals = (contour.points - middle) / 15.0
    sights = view.centre - contour.points
    cosine = (normals * sights).sum(axis=1) / np.linalg.norm(sights, axis=1)
    assert np.abs(cosine).max() < 0.06  # two triangles of this mesh
    out = view.project(contour.points + normals) - view.project(contour.points)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    assert (out * contour.outward).sum(axis=1).min() > 0.98


def filled(view, surface, random):
    """Return features all over the picture of a surface."""
    pixels = random.uniform([0, 0], view.camera.size, (40_000, 2))
    rays = np.column_stack([view.camera.undistorted(pixels), np.ones(len(pixels))])
    met = surface.first_hit(view.centre, view.camera_from_cad.inverse().turned(rays)).triangle >= 0
    return Features(pixels[met], np.zeros((int(met.sum()), 128), np.float32), 1.0)


def test_the_end_of_the_texture_brings_a_camera_to_where_it_is():
    surface, middle = ball()
    true = rig()[0]
    texture = Texture.closed([filled(true, surface, np.random.default_rng(0))], [true.camera.size])
    motion = Pose.small(np.array([0.0, 0.0, 0.0, 0.6, -0.8, 3.0]), middle)
    view = View(true.camera, true.camera_from_cad @ motion)
    off = [np.linalg.norm(each.project(middle[None]) - true.project(middle[None])) for each in (view, true)]
    assert off[0] > 7
    for _ in range(4):
        contour = Contours(surface)(view, 1.0)
        at = view.project(contour.points)
        away = texture.ends(0, at, contour.outward, 8)
        found = np.isfinite(away)
        assert found.mean() > 0.9
        ends = (at + away[:, None] * contour.outward)[found]
        lines = Lines(contour.points[found], np.zeros(found.sum(), np.int64), ends, contour.outward[found], 3.0)
        nothing = Bundle((view,), np.zeros((0, 3)), np.zeros((0, 1, 2)))
        view = adjusted(nothing, free((view,)), NOISE, lines=lines).bundle.views[0]
    assert np.linalg.norm(view.project(middle[None]) - true.project(middle[None])) < 1.0
    assert view.depth(middle[None]) == pytest.approx(true.depth(middle[None]), rel=0.02)
