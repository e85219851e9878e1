"""Cameras: a pinhole with Brown's distortion, and the place from which it looks at the part.

The camera frame has its origin in the centre of projection, x to the right of the picture, y down it and z along the
optical axis. Pixel (0, 0) is the centre of the top-left pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inspect3d.arrays import Floats, floats
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose

STEPS = 30
EXACT = 1e-12


@dataclass(frozen=True, eq=False)
class Camera:
    """A lens and a sensor.

    Parameters
    ----------
    matrix : (3, 3) px, [fx s cx; 0 fy cy; 0 0 1]
    distortion : (5,), k1, k2, p1, p2, k3 as OpenCV orders them
    size : width and height of the picture, px

    Notes
    -----
    D. C. Brown, Close-Range Camera Calibration, Photogrammetric Engineering 37(8), 1971, in the form of OpenCV.
    """

    matrix: Floats
    distortion: Floats
    size: tuple[int, int]

    def __post_init__(self) -> None:
        matrix = floats(self.matrix, "camera matrix", 3, 3)
        if not np.allclose([matrix[1, 0], *matrix[2]], [0, 0, 0, 1]):
            raise ValueError("a camera matrix has the form [fx s cx; 0 fy cy; 0 0 1]")
        if matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
            raise ValueError(f"a focal length is positive, not {matrix[0, 0]:g} and {matrix[1, 1]:g} px")
        if len(self.size) != 2 or min(self.size) < 1:
            raise ValueError(f"the size of a picture is a width and a height in pixels, not {self.size}")
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "distortion", floats(self.distortion, "distortion", 5))
        object.__setattr__(self, "size", (int(self.size[0]), int(self.size[1])))

    def project(self, points_camera: ArrayLike) -> Floats:
        """Return the pixels (n, 2) of points (n, 3) mm of the camera frame.

        Raises
        ------
        MeasurementError
            A point is not in front of the camera.
        """
        points = floats(points_camera, "points_camera", None, 3)
        behind = np.count_nonzero(points[:, 2] <= 0)
        if behind:
            raise MeasurementError(
                f"{behind} of {len(points)} points lie behind the camera, which has no picture of them: "
                "check its pose relative to the part."
            )
        distorted, _ = _distorted(points[:, :2] / points[:, 2:], self.distortion)
        return distorted @ self.matrix[:2, :2].T + self.matrix[:2, 2]

    def undistorted(self, pixels: ArrayLike) -> Floats:
        """Return where lines of sight (n, 2) cross z = 1 of the camera frame: (x / z, y / z) of what a pixel shows.

        Parameters
        ----------
        pixels : (n, 2) px

        Raises
        ------
        MeasurementError
            The lens folds the picture there, so that a pixel has no line of sight or several.
        """
        pixels = floats(pixels, "pixels", None, 2)
        wanted = floats(np.linalg.solve(self.matrix[:2, :2], (pixels - self.matrix[:2, 2]).T).T, "places", None, 2)
        found = wanted.copy()
        for _ in range(STEPS):
            distorted, slope = _distorted(found, self.distortion)
            upright = np.linalg.det(slope) > 0
            if not upright.all():
                break
            step = np.linalg.solve(slope, (wanted - distorted)[:, :, None])[:, :, 0]
            found += step
            if np.abs(step).max(initial=0.0) < EXACT:
                return found
        x, y = pixels[np.argmax(np.linalg.norm(wanted, axis=1))]
        raise MeasurementError(
            f"The distortion of the lens cannot be undone as far out as pixel ({x:.0f}, {y:.0f}): it folds the picture "
            "there. Check its coefficients (order k1, k2, p1, p2, k3) and that they belong to this size of picture."
        )


@dataclass(frozen=True, eq=False)
class View:
    """A camera in its place before the part.

    Parameters
    ----------
    camera : lens and sensor
    camera_from_cad : mm
    """

    camera: Camera
    camera_from_cad: Pose

    @property
    def centre(self) -> Floats:
        """Return the centre of projection (3,) mm in the CAD frame."""
        return self.camera_from_cad.inverse().translation

    def project(self, points_cad: ArrayLike) -> Floats:
        """Return the pixels (n, 2) of points (n, 3) mm of the CAD frame; see `Camera.project`."""
        return self.camera.project(self.camera_from_cad(floats(points_cad, "points_cad", None, 3)))

    def depth(self, points_cad: ArrayLike) -> Floats:
        """Return how far in front of the camera points (n, 3) mm lie along its axis, (n,) mm; negative behind it."""
        return self.camera_from_cad(floats(points_cad, "points_cad", None, 3))[:, 2]


def _distorted(ideal: Floats, distortion: Floats) -> tuple[Floats, Floats]:
    """Return the distorted places (n, 2) of ideal ones (n, 2), all on z = 1, and the derivatives (n, 2, 2)."""
    k1, k2, p1, p2, k3 = distortion
    x, y = ideal.T
    squared = x * x + y * y
    radial = 1.0 + squared * (k1 + squared * (k2 + squared * k3))
    slope = k1 + squared * (2.0 * k2 + squared * 3.0 * k3)
    places = np.column_stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (squared + 2.0 * x * x),
            y * radial + p1 * (squared + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    )
    derivative = np.empty((len(ideal), 2, 2))
    derivative[:, 0, 0] = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
    derivative[:, 0, 1] = derivative[:, 1, 0] = 2.0 * (x * y * slope + p1 * x + p2 * y)
    derivative[:, 1, 1] = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
    return places, derivative
