"""A known distance between two marked points, which gives photographs their scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats, floats
from inspect3d.camera import View
from inspect3d.outcome import MeasurementError

Pixel = tuple[float, float]
STEPS = 10


@dataclass(frozen=True)
class Mark:
    """The two ends of the known distance in one photograph, px; `image` is the name of its file."""

    image: str
    pixels: tuple[Pixel, Pixel]


@dataclass(frozen=True)
class ScaleBar:
    """A known distance between two points that were marked in two photographs or more.

    Parameters
    ----------
    length : mm
    marks : the two points in each of these photographs, in the same order
    sigma : mm, standard uncertainty of the length
    noise : px, standard uncertainty of a mark
    """

    length: float
    marks: tuple[Mark, ...]
    sigma: float = 0.0
    noise: float = 0.5

    def __post_init__(self) -> None:
        if not (self.length > 0 and self.sigma >= 0 and self.noise > 0):
            raise ValueError(
                "the length of a scale bar and the noise of its marks are positive, its sigma not negative"
            )
        if len({mark.image for mark in self.marks}) < max(2, len(self.marks)):
            raise ValueError("a scale bar is marked in two photographs or more, once in each")

    def scale(self, names: Sequence[str], views: Sequence[View]) -> tuple[float, float]:
        """Return what brings the unit of the views to mm, and its relative standard uncertainty.

        Parameters
        ----------
        names, views : of the photographs that were placed

        Raises
        ------
        MeasurementError
            The marks are in photographs that could not be placed, or do not fit together.
        """
        used = [(views[list(names).index(mark.image)], mark.pixels) for mark in self.marks if mark.image in names]
        if len(used) < 2:
            raise MeasurementError(
                f"The scale bar is marked in {len(used)} of the photographs that could be placed, and two are needed."
            )
        ends, covariances = zip(
            *(_point([view for view, _ in used], np.array([pixels[k] for _, pixels in used])) for k in (0, 1)),
            strict=True,
        )
        between = ends[1] - ends[0]
        distance = float(np.linalg.norm(between))
        if not distance > 0:
            raise MeasurementError("The two ends of the scale bar are marked at the same point.")
        along = between / distance
        variance = self.noise**2 * sum(along @ covariance @ along for covariance in covariances)
        return self.length / distance, float(np.hypot(np.sqrt(variance) / distance, self.sigma / self.length))


def _point(views: Sequence[View], pixels: Floats) -> tuple[Floats, Floats]:
    """Return the point (3,) that pixels (k, 2) of k views show, and its covariance (3, 3) for marks of 1 px noise."""
    rays = [view.camera_from_cad.rotation.T @ _sight(view, pixel) for view, pixel in zip(views, pixels, strict=True)]
    across = [np.eye(3) - np.outer(ray, ray) for ray in rays]
    right = sum(part @ view.centre for part, view in zip(across, views, strict=True))
    point = np.linalg.solve(sum(across, np.zeros((3, 3))), right)
    for _ in range(STEPS):
        depths = [view.depth(point[None])[0] for view in views]
        if min(depths) <= 0:
            raise MeasurementError("The marks of the scale bar do not fit together: their lines of sight part.")
        rest = np.concatenate([view.project(point[None])[0] for view in views]) - pixels.ravel()
        step = 1e-4 * min(depths)
        moved = [np.concatenate([v.project((point + step * axis)[None])[0] for v in views]) for axis in np.eye(3)]
        slope = (np.stack(moved, axis=1) - rest[:, None] - pixels.ravel()[:, None]) / step
        normal = slope.T @ slope
        point = point - np.linalg.solve(normal, slope.T @ rest)
    return floats(point, "point", 3), floats(np.linalg.inv(normal), "covariance", 3, 3)


def _sight(view: View, pixel: Floats) -> Floats:
    """Return the line of sight of a pixel, (3,), unit, in the camera frame."""
    ray = np.append(view.camera.undistorted(pixel[None])[0], 1.0)
    return ray / np.linalg.norm(ray)
