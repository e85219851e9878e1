"""Pictures of a speckled wavy sheet whose shape is known in closed form, by inverting the projection.

The grey level at a pixel is that of the surface point on its line of sight. The speckle is a band-limited field over
the sheet, smooth enough for the sensor to sample without aliasing, so that the pictures are exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import gaussian_filter, map_coordinates, spline_filter

from inspect3d.camera import Camera, View
from inspect3d.pose import Pose
from tests.sheets import DEPTH, WIDTH, wave, wave_normals

GRID = 0.05


def rig(size=(620, 480), focal=2400.0, distance=300.0, angles=(-0.24, 0.24), distortion=(0, 0, 0, 0, 0)):
    """Return views of the sheet from a distance (mm), turned by angles about the y axis; about 8 px/mm."""
    centre = np.array([WIDTH / 2, DEPTH / 2, 0.0])
    views = []
    for angle in angles:
        back = np.array([np.sin(angle), 0.1 * angle, np.cos(angle)])
        back /= np.linalg.norm(back)
        right = np.cross([0.0, 1.0, 0.0], back)
        right /= np.linalg.norm(right)
        rotation = np.stack([right, -np.cross(back, right), -back])
        matrix = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1.0]])
        pose = Pose(rotation, -rotation @ (centre + distance * back))
        views.append(View(Camera(matrix, np.array(distortion, float), size), pose))
    return tuple(views)


@dataclass(frozen=True, eq=False)
class Speckle:
    """A random pattern over the sheet in its coordinates (x, y)."""

    coefficients: np.ndarray

    @classmethod
    def drawn(cls, random, dot):
        """Return a pattern whose dots are about `dot` mm wide, with grey levels around 20 to 220."""
        shape = (int((WIDTH + 20) / GRID), int((DEPTH + 20) / GRID))
        field = gaussian_filter(random.normal(size=shape), dot / GRID / 2.6, mode="wrap")
        return cls(spline_filter(120 + 100 * np.tanh(1.5 * field / field.std()), order=3, mode="mirror"))

    def __call__(self, x, y):
        """Return the grey level at places of the sheet, mm."""
        at = np.stack([(x + 10) / GRID, (y + 10) / GRID])
        return map_coordinates(self.coefficients, at, order=3, mode="nearest", prefilter=False)


def surface(x, y, deviation, height=wave, normals=wave_normals):
    """Return the points of the sheet (n, 3) with a deviation(x, y) along the normals."""
    return np.stack([x, y, height(x, y)], axis=1) + normals(x, y) * deviation(x, y)[:, None]


def picture(view, speckle, deviation=lambda x, y: 0 * x, height=wave, normals=wave_normals, step=6):
    """Return the exact picture, before noise: sheet coordinates of every `step`-th pixel by Newton, splined between."""
    columns, rows = view.camera.size
    u, v = np.arange(-step, columns + step + 1, step), np.arange(-step, rows + step + 1, step)
    uu, vv = (a.ravel().astype(float) for a in np.meshgrid(u, v))
    x, y = np.full(uu.shape, WIDTH / 2), np.full(uu.shape, DEPTH / 2)
    for _ in range(12):
        here = view.project(surface(x, y, deviation, height, normals))
        dx = (view.project(surface(x + 1e-4, y, deviation, height, normals)) - here) / 1e-4
        dy = (view.project(surface(x, y + 1e-4, deviation, height, normals)) - here) / 1e-4
        miss = np.stack([uu, vv], axis=1) - here
        over = dx[:, 0] * dy[:, 1] - dx[:, 1] * dy[:, 0]
        x = np.clip(x + (miss[:, 0] * dy[:, 1] - miss[:, 1] * dy[:, 0]) / over, -60, WIDTH + 60)
        y = np.clip(y + (miss[:, 1] * dx[:, 0] - miss[:, 0] * dx[:, 1]) / over, -60, DEPTH + 60)
    shape = (len(v), len(u))
    along = [RectBivariateSpline(v, u, a.reshape(shape))(np.arange(rows), np.arange(columns)) for a in (x, y)]
    return speckle(along[0].ravel(), along[1].ravel()).reshape(rows, columns)


def photographed(random, exact, noise=2.4, gain=1.0, offset=0.0):
    """Return the picture a camera takes of an exact one: noise (grey levels) and 8 bits."""
    return np.clip(np.rint(gain * exact + offset + random.normal(0, noise, exact.shape)), 0, 255)
