"""Our own calibration files: `{"cameras": [{"matrix", "distortion", "size", "camera_from_cad", "sigma"}, ...]}`.

Cameras stand in the order of the pictures. Where every one names its `image`, a recipe may use some of the pictures.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from inspect3d.camera import Camera
from inspect3d.files.calibration import CameraSigma, Rig
from inspect3d.files.calibration_camera import Sizes, checked_camera, require_one_each, require_size
from inspect3d.outcome import InputError
from inspect3d.pose import Pose

KEYS = {"image", "matrix", "distortion", "size", "camera_from_cad", "camera_from_rig", "sigma"}
DEFAULTS = (("matrix", None), ("distortion", [0.0] * 5))
SIGMAS = {"focal", "centre", "distortion", "rotation", "translation"}


def read_calibration_json(text: str, name: str, names: tuple[str, ...], sizes: Sizes) -> Rig:
    """Return the cameras of a calibration file of ours; see `load_calibration`."""
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"{name} is not valid JSON: {error}.") from error
    if not isinstance(content, dict) or not isinstance(content.get("cameras"), list):
        raise InputError(f'{name} is no calibration: it wants {{ "cameras": [ ... ] }}, one entry per picture.')
    entries = _of_pictures(content["cameras"], name, names)
    require_one_each(len(entries), len(sizes), name)
    cameras = tuple(_camera(*pair, f"{name}, camera {k}") for k, pair in enumerate(zip(entries, sizes, strict=True), 1))
    sigmas = tuple(_sigma(entry.get("sigma"), f"{name}, camera {k}") for k, entry in enumerate(entries, 1))
    placed = {key: [key in entry for entry in entries] for key in ("camera_from_cad", "camera_from_rig")}
    if any(any(there) and not all(there) for there in placed.values()) or all(map(any, placed.values())):
        raise InputError(
            f"{name}: give every camera a camera_from_cad, or every one a camera_from_rig, or none either."
        )
    return Rig(
        cameras,
        camera_from_cad=_poses(entries, "camera_from_cad", name),
        camera_from_rig=_poses(entries, "camera_from_rig", name),
        sigmas=sigmas,
    )


def write_calibration_json(path: Path, rig: Rig, names: tuple[str, ...] = ()) -> None:
    """Write cameras as a calibration file of ours; it reads back to the last digit.

    Parameters
    ----------
    names : of the pictures, if the file is to tell which camera took which
    """
    cameras = []
    for k, camera in enumerate(rig.cameras):
        entry: dict[str, Any] = {"image": names[k]} if names else {}
        entry |= {
            "matrix": camera.matrix.tolist(),
            "distortion": camera.distortion.tolist(),
            "size": list(camera.size),
        }
        for key in ("camera_from_cad", "camera_from_rig"):
            poses = getattr(rig, key)
            if poses is not None:
                entry[key] = poses[k].matrix.tolist()
        sigma = rig.sigmas[k]
        if sigma is not None:
            entry["sigma"] = {**vars(sigma), "distortion": sigma.distortion.tolist()}
        cameras.append(entry)
    path.write_text(json.dumps({"schema": 1, "cameras": cameras}, indent=2) + "\n", encoding="utf-8")


def _of_pictures(entries: list[Any], name: str, names: tuple[str, ...]) -> list[Any]:
    """Return the entries that belong to the pictures: by their `image` where all have one, else as they stand."""
    by_image = {entry["image"]: entry for entry in entries if isinstance(entry, Mapping) and "image" in entry}
    if not by_image:
        return entries
    if len(by_image) < len(entries):
        raise InputError(f"{name}: give every camera an image of its own, or none.")
    missing = [picture for picture in names if picture not in by_image]
    if missing:
        raise InputError(f"{name} holds no camera whose image is {missing[0]}: it has {', '.join(map(str, by_image))}.")
    return [by_image[picture] for picture in names]


def _camera(entry: Any, size: tuple[int, int], where: str) -> Camera:
    if not isinstance(entry, Mapping):
        raise InputError(f"{where} is not a table of values.")
    unknown = sorted(set(entry) - KEYS)
    if unknown:
        raise InputError(f"{where}: {unknown[0]!r} is unknown; the keys are {', '.join(sorted(KEYS))}.")
    if "matrix" not in entry:
        raise InputError(f"{where} has no matrix, which is [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels.")
    try:
        width, height = entry.get("size", size)
        matrix, distortion = (np.array(entry.get(key, default), float) for key, default in DEFAULTS)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{where}: {error}.") from error
    require_size((width, height), size, where)
    return checked_camera(matrix, distortion, size, where)


def _poses(entries: list[Any], key: str, name: str) -> tuple[Pose, ...] | None:
    if not all(key in entry for entry in entries):
        return None
    poses = []
    for k, entry in enumerate(entries, 1):
        try:
            poses.append(Pose.from_matrix(np.array(entry[key], float)))
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"{name}, camera {k}, {key}: {error}.") from error
    return tuple(poses)


def _sigma(content: Any, where: str) -> CameraSigma | None:
    if content is None:
        return None
    if not isinstance(content, Mapping) or set(content) - SIGMAS:
        raise InputError(f"{where}: sigma is a table with {', '.join(sorted(SIGMAS))}, each of them optional.")
    try:
        focal, centre, rotation, translation = (
            float(content.get(key, 0.0)) for key in ("focal", "centre", "rotation", "translation")
        )
        distortion = np.array(content.get("distortion", [0.0] * 5), float)
        return CameraSigma(focal, centre, distortion, rotation, translation)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{where}, sigma: {error}.") from error
