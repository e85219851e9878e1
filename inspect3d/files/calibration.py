"""Calibrated cameras, as calibration files hold them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from inspect3d.arrays import Floats, floats
from inspect3d.camera import Camera, View
from inspect3d.pose import Pose


@dataclass(frozen=True, eq=False)
class CameraSigma:
    """How well a camera is known: standard uncertainties, zero where it is exact.

    Parameters
    ----------
    focal, centre : px, of each focal length and of each coordinate of the principal point
    distortion : (5,), of k1, k2, p1, p2, k3
    rotation, translation : rad and mm, of each component of the pose
    """

    focal: float = 0.0
    centre: float = 0.0
    distortion: Floats = field(default_factory=lambda: np.zeros(5))
    rotation: float = 0.0
    translation: float = 0.0

    def __post_init__(self) -> None:
        distortion = floats(self.distortion, "sigma of the distortion", 5)
        if not min(self.focal, self.centre, self.rotation, self.translation, *distortion) >= 0.0:
            raise ValueError("a standard uncertainty is not negative")
        object.__setattr__(self, "distortion", distortion)


@dataclass(frozen=True, eq=False)
class Rig:
    """Cameras, with their places where these are known.

    Parameters
    ----------
    cameras : one per picture, in the order of the pictures
    camera_from_cad : mm, their poses relative to the part; None where these are unknown
    camera_from_rig : mm, or in the unknown unit of `scaled = False`: their poses relative to each other, the part's
        pose among them unknown; None where these are unknown or `camera_from_cad` is there
    scaled : whether the translations are in mm
    sigmas : one per camera; None where a file states no uncertainty
    """

    cameras: tuple[Camera, ...]
    camera_from_cad: tuple[Pose, ...] | None = None
    camera_from_rig: tuple[Pose, ...] | None = None
    scaled: bool = True
    sigmas: tuple[CameraSigma | None, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.cameras)
        if not self.sigmas:
            object.__setattr__(self, "sigmas", (None,) * count)
        if self.camera_from_cad is not None and self.camera_from_rig is not None:
            raise ValueError("cameras are placed before the part or in their rig, not both")
        if any(len(values) != count for values in (self.camera_from_cad, self.camera_from_rig, self.sigmas) if values):
            raise ValueError(f"there are {count} cameras, and not as many poses or uncertainties")

    @property
    def views(self) -> tuple[View, ...]:
        """Return the cameras in their places before the part.

        Raises
        ------
        ValueError
            These are unknown.
        """
        if self.camera_from_cad is None:
            raise ValueError("the places of the cameras before the part are unknown")
        return tuple(map(View, self.cameras, self.camera_from_cad))


def what_is_known(rig: Rig | None) -> str:
    """Return what a calibration tells about the cameras, for a line that names them; None: there is no calibration."""
    if rig is None:
        return "not calibrated"
    if rig.camera_from_cad:
        return "calibrated, in their places before the part"
    return "calibrated, in their places in the rig" if rig.camera_from_rig else "of calibrated lenses"
