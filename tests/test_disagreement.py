"""What pictures say about themselves: how fine their speckle is, and how far they disagree."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from inspect3d.correlation.disagreement import disagreement
from inspect3d.correlation.freedom import Freedom, Lens, Stand
from inspect3d.correlation.picture import Pictures
from inspect3d.correlation.seen import scene
from inspect3d.correlation.shift import shift_of, slopes_of
from inspect3d.correlation.systematic import Systematic
from inspect3d.correlation.texture import speckle_size
from tests.sheets import sheet
from tests.speckled import Speckle, photographed, picture, rig

STEEPEST = np.radians(65.0)


@pytest.mark.parametrize("width", [1.5, 3.0, 5.0])
def test_filtered_noise_has_dots_as_wide_as_its_filter_makes_them(width):
    grey = gaussian_filter(np.random.default_rng(0).normal(size=(600, 700)), width)
    places = np.array([[100.0, 100.0], [600.0, 500.0]])
    assert speckle_size(grey, places) == pytest.approx(4 * np.sqrt(np.log(2)) * width, rel=0.15)


def test_a_broad_light_is_no_speckle_and_a_blank_picture_has_none():
    grey = gaussian_filter(np.random.default_rng(0).normal(size=(600, 700)), 2.0)
    places = np.array([[300.0, 300.0]])
    light = 0.5 * np.sin(np.arange(700) / 120)
    assert speckle_size(grey + light, places) == pytest.approx(speckle_size(grey, places), rel=0.1)
    assert speckle_size(np.full((600, 700), 9.0), places) == 0.0


@pytest.mark.parametrize("size", [0.0, 0.05])
def test_pictures_disagree_by_the_shift_that_the_shape_cannot_explain(size):
    views = rig()
    random = np.random.default_rng(1)
    speckle = Speckle.drawn(np.random.default_rng(0), 0.7)
    grey = [photographed(random, picture(view, speckle)) for view in views]
    rows, columns = np.mgrid[: grey[1].shape[0], : grey[1].shape[1]].astype(float)
    shift = size * np.sin(columns / 250 + 0.4)  # down the picture, across the epipolar lines
    grey[1] = map_coordinates(grey[1], [rows + shift, columns], order=3, mode="nearest") if size else grey[1]
    seen = scene(sheet(edge=4.0), views, 2.5, STEEPEST, [None, None])
    found = disagreement(seen, Pictures(grey).sharp, views, np.zeros(len(seen.nodes)))
    shown = shift[60:-60, 60:-60]
    assert found == pytest.approx(np.sqrt((shown**2).mean() / 2), rel=0.15, abs=0.003)  # shared out to both pictures


@pytest.mark.parametrize("length", [6.0, 15.0, 60.0])
def test_a_stated_shift_is_not_made_larger_by_chance(length):
    seen = scene(sheet(edge=6.0), rig(), 5.0, STEEPEST, [None, None])
    stated = Systematic(0.02, length)
    centres = seen.nodes[seen.triangles].mean(axis=1)
    squared = ((centres[:, None] - centres[None]) ** 2).sum(axis=2)
    values, vectors = np.linalg.eigh(np.exp(-squared / (2 * length**2)))
    random = np.random.default_rng(0)
    fields = (vectors * np.sqrt(np.maximum(values, 0))) @ random.normal(size=(len(values), 3000))
    sizes = stated.size * np.sqrt((fields**2).mean(axis=0))
    larger = np.mean([stated.at_least(size, seen).size > stated.size for size in sizes])
    assert 0.002 < larger < 0.03
    assert stated.at_least(4 * stated.size, seen).size == 4 * stated.size


@pytest.mark.parametrize("angles", [(-0.2, 0.2), (-0.25, 0.0, 0.25)])
def test_what_pictures_show_of_a_shift_is_neither_a_deviation_nor_a_slide(angles):
    views = rig(angles=angles)
    seen = scene(sheet(edge=6.0), views, 5.0, STEEPEST, [None] * len(views))
    known, slopes = shift_of(seen, views, Systematic(0.02, 15.0)), slopes_of(seen, views).reshape(-1, 2 * len(views), 3)
    alike = known.shown @ slopes
    everywhere = seen.taking.all(axis=1)
    assert np.abs(alike[everywhere]).max() < 1e-6 * np.abs(slopes).max()
    assert np.trace(known.shown[everywhere], axis1=1, axis2=2) == pytest.approx(2 * len(views) - 3)
    assert known.shown[everywhere] @ known.shown[everywhere] == pytest.approx(known.shown[everywhere], abs=1e-9)
    sizes = np.sqrt((known.deviation**2).sum(axis=1))
    per_pixel = np.linalg.norm(np.linalg.pinv(slopes[everywhere])[:, 2], axis=1)
    assert np.median(sizes) == pytest.approx(0.02 * np.median(per_pixel), rel=0.05)


def test_the_stands_of_a_rig_that_move_as_one_move_the_part():
    views = rig()
    stands = (Stand(1e-3, 0.1),) * 2
    free = Freedom("common", (Lens(),) * 2, views, np.array([30.0, 22.0, 0.0]), stands, (5.0, -3.0, 100.0))
    assert free.unknowns == 18
    points = sheet(edge=9.0).mesh.nodes
    redundant = free.redundant
    assert redundant.shape == (18, 6)
    parts = np.eye(18)[:, :6]
    pixels = [
        np.concatenate([v.project(points) for v in free.moved(views, 1e-5 * step)]).ravel() for step in redundant.T
    ]
    still = np.concatenate([v.project(points) for v in views]).ravel()
    moved = [np.concatenate([v.project(points) for v in free.moved(views, 1e-5 * step)]).ravel() for step in parts.T]
    spanned = np.stack(moved, axis=1) - still[:, None]
    left = (np.stack(pixels, axis=1) - still[:, None]) - spanned @ np.linalg.lstsq(
        spanned, np.stack(pixels, axis=1) - still[:, None], rcond=None
    )[0]
    assert np.abs(left).max() < 1e-6
    assert np.abs(free.offset(free.moved(views, 1e-4 * redundant[:, 0]))).max() < 1e-9


def test_how_far_a_stand_has_moved_is_told_as_it_was_made():
    views = rig()
    stands = (Stand(1e-3, 0.1),) * 2
    free = Freedom("known", (Lens(),) * 2, views, np.array([30.0, 22.0, 0.0]), stands, (5.0, -3.0, 100.0))
    step = 1e-6 * np.random.default_rng(3).normal(size=free.unknowns)
    assert free.offset(free.moved(views, step)) == pytest.approx(step, abs=1e-9)
