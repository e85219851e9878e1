"""Cameras around a virtual part."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sin, tau

import numpy as np

from inspect3d.arrays import Floats, unit
from inspect3d.camera import Camera, View
from inspect3d.pose import Pose
from inspect3d.virtual.deviation_field import Vector


@dataclass(frozen=True)
class StereoRig:
    """Two or more cameras that look at the same place of the part, from a cone around one direction.

    Two cameras stand left and right of it, more of them evenly around it; opposite ones are `angle` apart. Their
    lenses differ a little, as real ones do.

    Parameters
    ----------
    cameras : how many
    angle : rad, between opposite cameras
    scale : px/mm on the part
    focal : px
    size : width and height of a picture, px
    distortion : k1, k2, p1, p2, k3
    toward : direction from the part toward the rig, CAD frame
    up : direction that is up in the pictures, as far as it can be
    spread : standard deviation of the focal lengths, as a share of them
    offset : px, standard deviation of the principal points about the middle of the picture
    turn : rad, standard deviation by which a camera is turned about each of its axes, off its aim
    """

    cameras: int = 2
    angle: float = radians(27.0)
    scale: float = 20.0
    focal: float = 8200.0
    size: tuple[int, int] = (2448, 2048)
    distortion: tuple[float, float, float, float, float] = (-0.12, 0.15, 2e-4, -1e-4, 0.0)
    toward: Vector = (0.0, 0.0, 1.0)
    up: Vector = (0.0, 1.0, 0.0)
    spread: float = 0.002
    offset: float = 6.0
    turn: float = 0.002

    def __post_init__(self) -> None:
        if self.cameras < 2:
            raise ValueError(f"a stereo rig has at least two cameras, not {self.cameras}")
        if not 0.0 < self.angle < pi or self.scale <= 0.0:
            raise ValueError("the cameras are less than 180 degrees apart, and the scale is positive")

    def __call__(self, target: Floats, seed: int) -> tuple[View, ...]:
        """Return the cameras, those of two from left to right.

        Parameters
        ----------
        target : (3,) mm, where they look, CAD frame
        seed : of the lenses and the aim; the same seed gives the same rig
        """
        random = np.random.default_rng(seed)
        return tuple(self._view(k, np.asarray(target, dtype=np.float64), random) for k in range(self.cameras))

    def halved(self) -> StereoRig:
        """Return a rig with half the pixels along each side and the same field of view."""
        from dataclasses import replace

        width, height = self.size
        return replace(
            self, scale=self.scale / 2, focal=self.focal / 2, size=(width // 2, height // 2), offset=self.offset / 2
        )

    def _view(self, number: int, target: Floats, random: np.random.Generator) -> View:
        toward = unit(np.array(self.toward))
        right = unit(np.cross(np.array(self.up), toward))
        azimuth = pi + tau * number / self.cameras
        sideways = cos(azimuth) * right + sin(azimuth) * np.cross(toward, right)
        backwards = cos(self.angle / 2) * toward + sin(self.angle / 2) * sideways
        x = unit(np.cross(np.array(self.up), backwards))
        rotation = np.stack([x, np.cross(x, backwards), -backwards])
        centre = target + self.focal / self.scale * backwards
        aimed = Pose(rotation, -rotation @ centre)
        turned = Pose.small(np.concatenate([random.normal(0.0, self.turn, 3), np.zeros(3)]), np.zeros(3))

        focal = self.focal * (1.0 + self.spread * random.normal())
        middle = (np.array(self.size) - 1) / 2 + random.normal(0.0, self.offset, 2)
        matrix = np.array([[focal, 0.0, middle[0]], [0.0, focal, middle[1]], [0.0, 0.0, 1.0]])
        return View(Camera(matrix, np.array(self.distortion), self.size), turned @ aimed)
