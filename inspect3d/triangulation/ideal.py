"""Cameras and pixels between our convention and COLMAP's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import Camera
from inspect3d.pose import Pose

if TYPE_CHECKING:
    import pycolmap

HALF = 0.5  # px; COLMAP's origin is the corner of the top-left pixel, ours its centre


def ideal_pixels(camera: Camera, pixels: Floats) -> Floats:
    """Return pixels (n, 2) as a lens without distortion and skew would have made them, in COLMAP's convention."""
    focal, centre = camera.matrix[[0, 1], [0, 1]], camera.matrix[:2, 2]
    return camera.undistorted(pixels) * focal + centre + HALF


def ideal_camera(camera: Camera, number: int) -> pycolmap.Camera:
    """Return the lens of `ideal_pixels` for COLMAP."""
    import pycolmap

    (fx, fy), (cx, cy) = camera.matrix[[0, 1], [0, 1]], camera.matrix[:2, 2] + HALF
    width, height = camera.size
    lens = pycolmap.Camera(model="PINHOLE", width=width, height=height, params=[fx, fy, cx, cy], camera_id=number)
    lens.has_prior_focal_length = True
    return lens


def rough_camera(focal: float, size: tuple[int, int], number: int) -> pycolmap.Camera:
    """Return a lens for COLMAP that is known roughly: its focal length, px, and two radial terms are to be found."""
    import pycolmap

    width, height = size
    params = [focal, width / 2, height / 2, 0.0, 0.0]
    lens = pycolmap.Camera(model="RADIAL", width=width, height=height, params=params, camera_id=number)
    lens.has_prior_focal_length = True
    return lens


def found_camera(lens: pycolmap.Camera) -> Camera:
    """Return a lens of `rough_camera` as COLMAP has refined it."""
    focal, cx, cy, k1, k2 = lens.params
    matrix = np.array([[focal, 0.0, cx - HALF], [0.0, focal, cy - HALF], [0.0, 0.0, 1.0]])
    return Camera(matrix, np.array([k1, k2, 0.0, 0.0, 0.0]), (lens.width, lens.height))


def rigid(pose: Pose) -> pycolmap.Rigid3d:
    """Return a pose for COLMAP."""
    import pycolmap

    return pycolmap.Rigid3d(pose.matrix[:3])
