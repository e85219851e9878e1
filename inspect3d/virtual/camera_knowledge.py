"""What an inspector knows about the cameras of a virtual rig beforehand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from inspect3d.camera import Camera, View
from inspect3d.files.calibration import CameraSigma, Rig

CameraKnowledge = Callable[[tuple[View, ...], np.random.Generator], Rig]
"""Makes the content of a calibration file out of the true cameras."""


def places_known(views: tuple[View, ...], random: np.random.Generator) -> Rig:
    """Return the cameras as they are, in their places before the part."""
    return Rig(_lenses(views), camera_from_cad=tuple(view.camera_from_cad for view in views))


def rig_known(views: tuple[View, ...], random: np.random.Generator) -> Rig:
    """Return the cameras as they are, in their places relative to the first one; where the part is stays unknown."""
    first = views[0].camera_from_cad.inverse()
    return Rig(_lenses(views), camera_from_rig=tuple(view.camera_from_cad @ first for view in views))


@dataclass(frozen=True)
class LensesKnown:
    """The lenses are known to stated standard uncertainties, and where the cameras stand is not.

    Parameters
    ----------
    focal, centre : px; the errors are drawn from them, one for both focal lengths of a camera
    """

    focal: float = 0.5
    centre: float = 0.5

    def __call__(self, views: tuple[View, ...], random: np.random.Generator) -> Rig:
        """Return the lenses with errors drawn at random, and their uncertainties."""
        cameras = []
        for view in views:
            matrix = view.camera.matrix.copy()
            matrix[[0, 1], [0, 1]] += random.normal(0.0, self.focal)
            matrix[:2, 2] += random.normal(0.0, self.centre, 2)
            cameras.append(Camera(matrix, view.camera.distortion, view.camera.size))
        sigma = CameraSigma(focal=self.focal, centre=self.centre)
        return Rig(tuple(cameras), sigmas=(sigma,) * len(views))


def _lenses(views: tuple[View, ...]) -> tuple[Camera, ...]:
    return tuple(view.camera for view in views)
