"""Cameras as COLMAP writes them: cameras.txt, with images.txt beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from inspect3d.arrays import Floats
from inspect3d.files.calibration import Rig
from inspect3d.files.calibration_camera import Sizes, checked_camera, checked_pose, require_size
from inspect3d.outcome import InputError
from inspect3d.pose import Pose

MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
}
HALF = 0.5  # px; COLMAP's origin is the corner of the top-left pixel, ours its centre

Lens = tuple[tuple[int, int], Floats, Floats]


def read_calibration_colmap(path: Path, names: tuple[str, ...], sizes: Sizes) -> Rig:
    """Return the cameras of the pictures, found by their file names, in COLMAP's frame and unknown unit of length.

    Parameters
    ----------
    path : cameras.txt, or the folder it is in; images.txt lies beside it
    names, sizes : of the pictures

    Raises
    ------
    InputError
        A picture is not in the model, or its camera is of a model that is not Brown's.
    """
    folder = path if path.is_dir() else path.parent
    lenses = dict(_lens(words, f"{folder.name}/cameras.txt") for words in _lines(folder / "cameras.txt"))
    pictures = [words for words in _lines(folder / "images.txt")[::2] if words]
    poses = dict(_image(words, f"{folder.name}/images.txt") for words in pictures)
    cameras, places = [], []
    for name, size in zip(names, sizes, strict=True):
        if name not in poses:
            raise InputError(
                f"{folder.name}/images.txt has no picture {name!r}; it has {', '.join(sorted(poses)[:5])}."
            )
        camera, pose = poses[name]
        if camera not in lenses:
            raise InputError(f"{folder.name}/cameras.txt has no camera {camera}, with which {name} was taken.")
        stated, matrix, distortion = lenses[camera]
        require_size(stated, size, f"{folder.name}/cameras.txt, camera {camera}")
        cameras.append(checked_camera(matrix, distortion, size, f"{folder.name}/cameras.txt, camera {camera}"))
        places.append(pose)
    return Rig(tuple(cameras), camera_from_rig=tuple(places), scaled=False)


def _lens(words: list[str], where: str) -> tuple[str, Lens]:
    """Return the number of a camera, its size, matrix and distortion."""
    try:
        number, model, width, height, *rest = words
        keys = MODELS.get(model)
        if keys is None:
            raise InputError(f"{where}, camera {number}: the model {model} is unknown; use one of {', '.join(MODELS)}.")
        values = dict(zip(keys, map(float, rest), strict=True))
        size = int(width), int(height)
    except ValueError as error:
        raise InputError(f"{where}: {' '.join(words)!r} is no camera: {error}.") from error
    if any(values.get(key, 0.0) for key in ("k4", "k5", "k6")):
        raise InputError(f"{where}, camera {number}: k4, k5, k6 are not zero; calibrate with the model OPENCV.")
    fx, fy = (values.get(key, values.get("f", 0.0)) for key in ("fx", "fy"))
    matrix = np.array([[fx, 0.0, values["cx"] - HALF], [0.0, fy, values["cy"] - HALF], [0.0, 0.0, 1.0]])
    return number, (size, matrix, np.array([values.get(key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3")]))


def _image(words: list[str], where: str) -> tuple[str, tuple[str, Pose]]:
    """Return the name of a picture, its camera, and the pose of that."""
    try:
        w, x, y, z, *translation = (float(word) for word in words[1:8])
        rotation = Rotation.from_quat([x, y, z, w]).as_matrix()
        return " ".join(words[9:]), (words[8], checked_pose(rotation, translation, where))
    except (ValueError, IndexError) as error:
        raise InputError(f"{where}: {' '.join(words)!r} is no picture: {error}.") from error


def _lines(path: Path) -> list[list[str]]:
    """Return the words of each line that is no comment; the points of a picture may be an empty line."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path.parent.name}/{path.name} cannot be read; export the model of COLMAP as text."
        ) from error
    lines = [line.split() for line in text.splitlines() if not line.startswith("#")]
    return lines if path.name == "images.txt" else [words for words in lines if words]
