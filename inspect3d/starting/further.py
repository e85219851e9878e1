"""Further cameras, placed by what they see of the CAD once the first ones stand before it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from inspect3d.arrays import Floats, Integers, unit
from inspect3d.camera import Camera, View
from inspect3d.correlation.freedom import Freedom
from inspect3d.nominal.surface import Surface
from inspect3d.starting.bundle import Bundle, Lines
from inspect3d.starting.fitting import FINAL, Fitted, fitted
from inspect3d.starting.relative import STRAY, too_little
from inspect3d.starting.resection import resected

MOST = 600  # tracks of a further camera


def with_further(
    fit: Fitted,
    placed: Sequence[int],
    cameras: Sequence[Camera],
    pixels: Floats,
    surface: Surface,
    freedom: Callable[[tuple[View, ...]], Freedom],
    noise: float,
    lines: Callable[[tuple[View, ...], float], Lines | None] | None = None,
) -> Fitted:
    """Return cameras and points on the CAD, with the cameras that had no place yet.

    What a placed camera sees lies where its line of sight meets the CAD; a picture that shares tracks with one placed
    camera only is so placed by perspective-n-point, and all are fitted to the CAD together.

    Parameters
    ----------
    fit : the placed cameras and their points
    placed : which of the cameras these are
    cameras : all, with the rough lenses
    pixels : (n, v, 2) px, tracks of all; NaN where a view does not have one
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
    seen = np.isfinite(pixels[:, :, 0])
    while len(views) < len(cameras):
        missing = [k for k in range(len(cameras)) if k not in views]
        shared = {k: np.flatnonzero(seen[:, k] & seen[:, list(views)].any(axis=1)) for k in missing}
        k = max(missing, key=lambda k: len(shared[k]))
        tracks = np.random.default_rng(0).permutation(shared[k])[:MOST]
        points, met = _on_the_cad(pixels[tracks], views, surface)
        rays = cameras[k].undistorted(pixels[tracks[met], k])
        pose, good = resected(points, rays, 2 * STRAY * noise / float(cameras[k].matrix[0, 0]))
        if pose is None:
            raise too_little(k)
        views[k] = View(cameras[k], pose)
        found.append(points[good])
        rows.append(pixels[tracks[met[good]]])
    bundle = Bundle(tuple(views[k] for k in range(len(cameras))), np.concatenate(found), np.concatenate(rows))
    bundle = bundle.chosen(bundle.ahead)
    return fitted(bundle, surface.closest(bundle.points).normals, surface, freedom, noise, FINAL, lines)


def _widened(pixels: Floats, placed: Sequence[int], count: int) -> Floats:
    """Return tracks (n, p, 2) of some cameras as tracks of all, (n, count, 2), NaN in the others."""
    wide = np.full((len(pixels), count, 2), np.nan)
    wide[:, list(placed)] = pixels
    return wide


def _on_the_cad(pixels: Floats, views: dict[int, View], surface: Surface) -> tuple[Floats, Integers]:
    """Return where the first placed camera that sees a track meets the CAD, (m, 3) mm, and the track of each, (m,)."""
    points, rows = [np.zeros((0, 3))], [np.zeros(0, np.int64)]
    left = np.ones(len(pixels), bool)
    for k, view in views.items():
        row = np.flatnonzero(np.isfinite(pixels[:, k, 0]) & left)
        rays = np.column_stack([view.camera.undistorted(pixels[row, k]), np.ones(len(row))])
        sights = unit(view.camera_from_cad.inverse().turned(rays))
        hits = surface.first_hit(view.centre, sights)
        met = hits.triangle >= 0
        points.append(view.centre + hits.distance[met, None] * sights[met])
        rows.append(row[met])
        left[row[met]] = False
    return np.concatenate(points), np.concatenate(rows)
