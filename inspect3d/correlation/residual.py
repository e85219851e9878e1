"""How far the grey levels of the pictures are apart at the evaluation points (paper, figures 9 and 15)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inspect3d.arrays import Floats, unit
from inspect3d.camera import View
from inspect3d.correlation.picture import Stack
from inspect3d.correlation.scene import Scene


def residuals(scene: Scene, stack: Stack, views: Sequence[View], motion: Floats) -> tuple[Floats, Floats]:
    """Return where the evaluation points appear in the first picture (p, 2) px, and their residuals (p,) grey levels.

    The grey levels of each facet are brought to the same mean and contrast in all pictures, as in the solver. The
    residual is the difference |f - g| between two pictures; of more, sqrt(2) times their standard deviation. It is NaN
    in facets that the first picture does not show.

    Parameters
    ----------
    motion : (k,) unknowns of the scene's space
    """
    points, facet = scene.space.bent(scene, scene.points, motion), scene.points.facet
    corners, deviation = scene.triangles[facet], scene.space.rows(scene) @ motion
    normals = unit(np.einsum("pi,pij->pj", points.shapes, scene.normals[corners]))
    places = points.places + np.einsum("pi,pi->p", points.shapes, deviation[corners])[:, None] * normals
    taken = scene.taking[facet]
    grey = np.full(taken.shape, np.nan)
    pixels = np.full((len(places), 2), np.nan)
    for k, view in enumerate(views):
        at = view.project(places[taken[:, k]])
        grey[taken[:, k], k] = stack.sampled(k, at)[:, 0]
        if k == 0:
            pixels[taken[:, k]] = at
    counts = np.diff(points.starts)[:, None]
    mean = np.add.reduceat(grey, points.starts[:-1]) / counts
    grey -= mean[facet]
    contrast = np.sqrt(np.add.reduceat(grey**2, points.starts[:-1]) / counts)
    common = np.nanmean(contrast, axis=1)[facet]
    grey *= np.divide(common[:, None], contrast[facet], out=np.zeros_like(grey), where=contrast[facet] > 0)
    seen = taken.sum(axis=1)
    apart = np.nansum((grey - np.nanmean(grey, axis=1, keepdims=True)) ** 2, axis=1)
    residual = np.sqrt(2 * apart / np.maximum(seen - 1, 1))
    return pixels, np.where(taken[:, 0], residual, np.nan)
