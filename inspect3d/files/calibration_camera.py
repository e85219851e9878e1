"""What the readers of calibration files share."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inspect3d.camera import Camera
from inspect3d.outcome import InputError
from inspect3d.pose import Pose

Sizes = tuple[tuple[int, int], ...]
"""Width and height of each picture, px."""


def checked_camera(matrix: ArrayLike, distortion: ArrayLike, size: tuple[int, int], where: str) -> Camera:
    """Return a camera.

    Raises
    ------
    InputError
        Its numbers are wrong; the sentence says in which place of which file, `where`.
    """
    try:
        return Camera(np.array(matrix, float), np.array(distortion, float), size)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{where}: {error}.") from error


def checked_pose(rotation: ArrayLike, translation: ArrayLike, where: str) -> Pose:
    """Return a pose.

    Raises
    ------
    InputError
        Its numbers are wrong; the sentence says in which place of which file, `where`.
    """
    try:
        return Pose(np.array(rotation, float), np.array(translation, float))
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{where}: {error}.") from error


def require_one_each(found: int, pictures: int, name: str) -> None:
    """Refuse a file that has not one camera per picture, with an `InputError`."""
    if found != pictures:
        raise InputError(f"{name} holds {found} cameras, and the recipe names {pictures} pictures: give one for each.")


def require_size(stated: tuple[int, int], size: tuple[int, int], where: str) -> None:
    """Refuse a camera calibrated for pictures of another size, width and height in px, by an `InputError`."""
    if stated != size:
        raise InputError(
            f"{where} belongs to pictures of {stated[0]} x {stated[1]} px, and this one has {size[0]} x {size[1]} px."
        )
