"""Further cameras, placed by what they see of the CAD once the first ones stand before it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from inspect3d.arrays import Floats, unit
from inspect3d.camera import Camera, View
from inspect3d.correlation.freedom import Freedom
from inspect3d.nominal.surface import Surface
from inspect3d.starting.bundle import Bundle, Lines
from inspect3d.starting.features import Features
from inspect3d.starting.fitting import FINAL, Fitted, fitted
from inspect3d.starting.relative import STRAY, too_little
from inspect3d.starting.resection import resected
from inspect3d.starting.tracks import matches


def with_further(
    fit: Fitted,
    placed: Sequence[int],
    cameras: Sequence[Camera],
    features: Sequence[Features],
    surface: Surface,
    freedom: Callable[[tuple[View, ...]], Freedom],
    noise: float,
    lines: Callable[[tuple[View, ...], float], Lines | None] | None = None,
) -> Fitted:
    """Return cameras and points on the CAD, with the cameras that had no place yet.

    What a placed camera sees lies where its line of sight meets the CAD. A picture that shares a few features with one
    placed camera is so placed by perspective-n-point, most of them wrong perhaps, and all are fitted to the CAD
    together.

    Parameters
    ----------
    fit : the placed cameras and their points
    placed : which of the cameras these are
    cameras : all, with the rough lenses
    features : of all pictures
    freedom : what may change about all cameras at given places
    noise : px, of a feature's place
    lines : where the outline of the part was found in all pictures, as `fitted` takes it

    Raises
    ------
    MeasurementError
        A picture shares too little with those whose cameras have a place.
    """
    views: dict[int, View] = dict(zip(placed, fit.bundle.views, strict=True))
    found, rows = [fit.bundle.points], [_widened(fit.bundle.pixels, placed, len(cameras))]
    while len(views) < len(cameras):
        offers = {k: _met(k, views, features, surface) for k in range(len(cameras)) if k not in views}
        k = max(offers, key=lambda k: len(offers[k][0]))
        points, pixels = offers[k]
        rays = cameras[k].undistorted(pixels[:, k])
        pose, good = resected(points, rays, 2 * STRAY * noise / float(cameras[k].matrix[0, 0]))
        if pose is None:
            raise too_little(k)
        views[k] = View(cameras[k], pose)
        found.append(points[good])
        rows.append(pixels[good])
    bundle = Bundle(tuple(views[k] for k in range(len(cameras))), np.concatenate(found), np.concatenate(rows))
    bundle = bundle.chosen(bundle.ahead)
    return fitted(bundle, surface.closest(bundle.points).normals, surface, freedom, noise, FINAL, lines)


def _widened(pixels: Floats, placed: Sequence[int], count: int) -> Floats:
    """Return tracks (n, p, 2) of some cameras as tracks of all, (n, count, 2), NaN in the others."""
    wide = np.full((len(pixels), count, 2), np.nan)
    wide[:, list(placed)] = pixels
    return wide


def _met(number: int, views: dict[int, View], features: Sequence[Features], surface: Surface) -> tuple[Floats, Floats]:
    """Return where features of placed pictures lie on the CAD that a further one shows as well, perhaps.

    Points (n, 3) mm and pixels (n, v, 2) of the two pictures each, NaN in the others.
    """
    points, rows = [np.zeros((0, 3))], [np.zeros((0, len(features), 2))]
    for k, view in views.items():
        match = matches(features[k], features[number])
        row = np.full((len(match), len(features), 2), np.nan)
        row[:, k], row[:, number] = features[k].pixels[match[:, 0]], features[number].pixels[match[:, 1]]
        rays = np.column_stack([view.camera.undistorted(row[:, k]), np.ones(len(row))])
        sights = unit(view.camera_from_cad.inverse().turned(rays))
        hits = surface.first_hit(view.centre, sights)
        met = hits.triangle >= 0
        points.append(view.centre + hits.distance[met, None] * sights[met])
        rows.append(row[met])
    return np.concatenate(points), np.concatenate(rows)
