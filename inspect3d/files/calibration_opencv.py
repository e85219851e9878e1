"""Calibrations that programs with OpenCV write: YAML, XML or JSON of `cv::FileStorage`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import Camera
from inspect3d.files.calibration import Rig
from inspect3d.files.calibration_camera import Sizes, checked_camera, checked_pose, require_one_each, require_size
from inspect3d.outcome import InputError

MATRICES = ("M{}", "K{}", "cameraMatrix{}", "camera_matrix_{}", "camera_matrix{}")
LENSES = ("D{}", "d{}", "distCoeffs{}", "distortion_coefficients_{}", "dist_coeffs{}")
ALONE = (("camera_matrix", "cameraMatrix", "K", "M"), ("distortion_coefficients", "distCoeffs", "D", "dist_coeffs"))
BETWEEN = (("R",), ("T", "t"))

Matrices = dict[str, Floats]


def read_calibration_opencv(files: tuple[Path, ...], sizes: Sizes) -> Rig:
    """Return the cameras of OpenCV's files.

    One file, or intrinsics and extrinsics in two, hold a pair: M1, D1, M2, D2 and, where the rig is known, R and T
    with X_2 = R X_1 + T, as the programs after `stereo_calib` write them. Else each picture has a file of its own with
    `camera_matrix` and `distortion_coefficients`, and only the lenses are known.

    Raises
    ------
    InputError
        A file is not of that kind, or its lens has more coefficients than k1, k2, p1, p2, k3.
    """
    contents = [_matrices(path) for path in files]
    both = {key: value for content in contents for key, value in content.items()}
    name = " and ".join(path.name for path in files)
    if _first(both, MATRICES, 1) is not None:
        return _pair(both, sizes, name)
    require_one_each(len(files), len(sizes), name)
    cameras = []
    for path, content, size in zip(files, contents, sizes, strict=True):
        stated = [content[key].item() for key in ("image_width", "image_height") if key in content]
        if len(stated) == 2:
            require_size((int(stated[0]), int(stated[1])), size, path.name)
        cameras.append(_camera(_first(content, ALONE[0]), _first(content, ALONE[1]), size, path.name))
    return Rig(tuple(cameras))


def _pair(content: Matrices, sizes: Sizes, name: str) -> Rig:
    require_one_each(2, len(sizes), name)
    cameras = tuple(
        _camera(_first(content, MATRICES, k), _first(content, LENSES, k), size, f"{name}, camera {k}")
        for k, size in enumerate(sizes, 1)
    )
    rotation, translation = _first(content, BETWEEN[0]), _first(content, BETWEEN[1])
    if rotation is None or translation is None:
        return Rig(cameras)
    second = checked_pose(rotation, translation.ravel(), f"{name}, R and T")
    return Rig(cameras, camera_from_rig=(checked_pose(np.eye(3), np.zeros(3), name), second))


def _camera(matrix: Floats | None, lens: Floats | None, size: tuple[int, int], where: str) -> Camera:
    if matrix is None:
        raise InputError(
            f"{where} has no camera matrix: it wants M1, D1, M2, D2 (and R, T) of a pair, or camera_matrix and "
            "distortion_coefficients of one camera."
        )
    coefficients = np.zeros(5) if lens is None else lens.ravel()
    if coefficients[5:].any():
        raise InputError(
            f"{where}: the lens has {len(coefficients)} coefficients; calibrate with k1, k2, p1, p2, k3 only."
        )
    return checked_camera(matrix, np.pad(coefficients[:5], (0, max(0, 5 - len(coefficients)))), size, where)


def _first(content: Matrices, keys: tuple[str, ...], number: int = 0) -> Floats | None:
    """Return the value under the first of some keys that is there, `number` put in."""
    return next((content[name] for key in keys if (name := key.format(number)) in content), None)


def _matrices(path: Path) -> Matrices:
    """Return the matrices and numbers of a file by their keys."""
    import cv2

    try:
        storage = cv2.FileStorage(path.read_text(encoding="utf-8"), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        keys = storage.root().keys()
        found = {}
        for key in keys:
            node = storage.getNode(key)
            value = node.real() if node.isReal() or node.isInt() else node.mat() if node.isMap() else None
            if value is not None:
                found[key] = np.array(value, dtype=np.float64)
    except (cv2.error, SystemError, UnicodeDecodeError, ValueError) as error:
        raise InputError(f"{path.name} is no file of OpenCV's FileStorage (YAML, XML or JSON).") from error
    return found
