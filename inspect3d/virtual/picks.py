"""Points of the part that someone has clicked on in the pictures."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians

import numpy as np

from inspect3d.arrays import Floats, unit
from inspect3d.camera import View
from inspect3d.outcome import InputError
from inspect3d.virtual.scene import Scene

CANDIDATES = 2000
STEEPEST = radians(60.0)
MARGIN = 0.03  # of the width and height of a picture
LIFT = 0.02  # mm; a line of sight starts this far above the surface, clear of the triangle it leaves


@dataclass(frozen=True, eq=False)
class Picks:
    """Clicked points.

    Parameters
    ----------
    points_cad : (n, 3) mm, on the nominal surface
    pixels : (n, views, 2) px
    """

    points_cad: Floats
    pixels: Floats

    def rows(self) -> str:
        """Return the points as the `landmarks` of a recipe, one row each."""
        return "".join(
            f"  {{ cad = {np.round(point, 4).tolist()}, pixels = {np.round(pixels, 2).tolist()} }},\n"
            for point, pixels in zip(self.points_cad, self.pixels, strict=True)
        )


def picks(scene: Scene, views: tuple[View, ...], count: int, noise: float, seed: int) -> Picks:
    """Return points, far apart from each other, that every camera sees, as an unsteady hand clicks on them.

    The CAD point is nominal; what is clicked on is where that point of the true part appears.

    Parameters
    ----------
    count : how many points
    noise : px, standard deviation of each coordinate of a click
    seed : the same seed gives the same picks

    Raises
    ------
    InputError
        The cameras have fewer points in common.
    """
    random = np.random.default_rng(seed)
    points, normals = scene.surface.sample(CANDIDATES, random)
    true = points + scene.deviation(points)[:, None] * normals
    common = np.ones(len(points), bool)
    for view in views:
        to_camera = view.centre - points
        size = np.array(view.camera.size)
        pixels = view.project(true)
        common &= np.einsum("ni,ni->n", normals, unit(to_camera)) > cos(STEEPEST)
        common &= np.all((pixels > MARGIN * size) & (pixels < (1.0 - MARGIN) * size), axis=1)
        away = np.linalg.norm(to_camera, axis=1)
        common &= scene.surface.triangulation.first_hit(points + LIFT * normals, to_camera, away).triangle < 0
    seen = np.flatnonzero(common)
    if len(seen) < count:
        raise InputError(
            f"The cameras have only {len(seen)} of {CANDIDATES} points in common: move them closer together."
        )
    chosen = [seen[np.argmax(np.linalg.norm(points[seen] - points[seen].mean(axis=0), axis=1))]]
    while len(chosen) < count:
        gaps = np.linalg.norm(points[seen, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(seen[np.argmax(gaps)])
    exact = np.stack([view.project(true[chosen]) for view in views], axis=1)
    return Picks(points[chosen], exact + random.normal(0.0, noise, exact.shape))
