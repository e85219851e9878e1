"""How far the pictures disagree where the shape cannot make up for it: across the epipolar lines."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from inspect3d.arrays import Floats, Integers, unit
from inspect3d.camera import View
from inspect3d.correlation.picture import Stack
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.shift import slopes_of

NEAR, FAR = 1.5, 4.0  # facet sizes between the facets of a pair
SAMPLE = 4000  # facets whose neighbours are looked up
ENOUGH = 50  # pairs of facets


def disagreement(scene: Scene, stack: Stack, views: Sequence[View], motion: Floats) -> float:
    """Return the standard deviation (px) of a smooth shift of each picture that calibration and shape leave over.

    A node that moves along its normal moves a picture along epipolar lines only. What a facet's pictures are apart
    across them, d, is noise, which differs from facet to facet, and errors of the cameras, which neighbours share: the
    mean of d d' over neighbours is twice the variance of the shift of one picture. It is a lower bound where poses or
    lenses were free, since they absorb much of it.

    Parameters
    ----------
    stack : the pictures without blur
    motion : (k,) unknowns of the scene's space
    """
    from scipy.spatial import cKDTree

    centres = scene.nodes[scene.triangles].mean(axis=1)
    size = np.sqrt(np.median(np.linalg.norm(centres - scene.nodes[scene.triangles[:, 0]], axis=1) ** 2) * 3)
    sums, weights = 0.0, 0.0
    for pair in combinations(range(len(views)), 2):
        shown = np.flatnonzero(scene.taking[:, pair].all(axis=1))
        if len(shown) < ENOUGH:
            continue
        shift, variance = _shifts(scene, stack, [views[k] for k in pair], pair, motion, shown)
        tree = cKDTree(centres[shown])
        some = np.linspace(0, len(shown) - 1, min(SAMPLE, len(shown))).astype(np.int64)
        for one, others in zip(some, tree.query_ball_point(centres[shown[some]], FAR * size), strict=True):
            apart = np.linalg.norm(centres[shown[others]] - centres[shown[one]], axis=1)
            chosen = np.asarray(others)[apart > NEAR * size]
            weight = 1 / (variance[one] * variance[chosen])
            sums += float((weight * shift[one] * shift[chosen]).sum())
            weights += float(weight.sum())
    return float(np.sqrt(max(sums / weights, 0.0) / 2)) if weights > 0 else 0.0


def _shifts(
    scene: Scene, stack: Stack, views: Sequence[View], pair: tuple[int, ...], motion: Floats, shown: Integers
) -> tuple[Floats, Floats]:
    """Return how far two pictures are apart in each shown facet across the epipolar lines, px, and its variance.

    Both in pixels of the first view; the variance is up to a common factor.
    """
    points, facet = scene.space.bent(scene, scene.points, motion), scene.points.facet
    number = np.full(len(scene.triangles), -1)
    number[shown] = np.arange(len(shown))
    chosen = np.flatnonzero(number[facet] >= 0)
    group, corners = number[facet[chosen]], scene.triangles[facet[chosen]]
    normals = unit(np.einsum("pi,pij->pj", points.shapes[chosen], scene.normals[corners]))
    deviation = scene.space.rows(scene) @ motion
    lift = np.einsum("pi,pi->p", points.shapes[chosen], deviation[corners])
    places = points.places[chosen] + lift[:, None] * normals
    first_from_second, across = _local(scene, views, shown)
    levels, slopes = [], []
    for k, view in zip(pair, views, strict=True):
        sample = stack.sampled(k, view.project(places))
        level, contrast = _normalised(sample[:, 0], group, len(shown))
        levels.append(level)
        slopes.append(sample[:, 1:] / contrast[group][:, None])
    slopes[1] = np.einsum("pi,pij->pj", slopes[1], np.linalg.inv(first_from_second)[group])
    along = ((slopes[0] + slopes[1]) / 2 * across[group]).sum(axis=1)
    along -= (np.bincount(group, along) / np.bincount(group))[group]
    stiffness = np.bincount(group, along**2)
    return np.bincount(group, along * (levels[0] - levels[1])) / stiffness, 1 / stiffness


def _local(scene: Scene, views: Sequence[View], shown: Integers) -> tuple[Floats, Floats]:
    """Return, for each shown facet, the map (f, 2, 2) of shifts in the second picture to the first, and the direction
    (f, 2) in the first picture across the epipolar lines, unit."""
    slopes = np.moveaxis(slopes_of(scene, views)[shown], 1, 0)
    first_from_second = slopes[0][:, :, :2] @ np.linalg.inv(slopes[1][:, :, :2])
    epipolar = slopes[0][:, :, 2] - np.einsum("fij,fj->fi", first_from_second, slopes[1][:, :, 2])
    return first_from_second, unit(np.stack([-epipolar[:, 1], epipolar[:, 0]], axis=1))


def _normalised(levels: Floats, group: Integers, count: int) -> tuple[Floats, Floats]:
    """Return grey levels at mean 0 and variance 1 in each group, and the standard deviation of each group."""
    points = np.bincount(group, minlength=count)
    centred = levels - (np.bincount(group, levels, minlength=count) / points)[group]
    contrast = np.sqrt(np.bincount(group, centred**2, minlength=count) / points)
    return centred / contrast[group], contrast
