"""Camera systems as DICe writes them."""

from __future__ import annotations

from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from inspect3d.arrays import Floats
from inspect3d.files.calibration import Rig
from inspect3d.files.calibration_camera import (
    Sizes,
    checked_camera,
    checked_pose,
    require_one_each,
    require_size,
)
from inspect3d.outcome import InputError
from inspect3d.pose import Pose

PLAIN = {"NONE", "NO_LENS_DISTORTION"}
BROWN = {"OPENCV_LENS_DISTORTION", "OPENCV_DIS", "K1R3_K2R5_K3R7"}
UNHANDLED = ("K4", "K5", "K6", "S1", "S2", "S3", "S4", "T1", "T2")


def read_calibration_dice(root: Element, name: str, sizes: Sizes) -> Rig:
    """Return the cameras of a DICe camera system.

    The first camera is the frame of the rig where the file says `extrinsics_relative_camera_to_camera`, and its own
    extrinsics are then without meaning; else all cameras are given relative to a world. Angles are in degrees, with
    R = Rz(GAMMA) Ry(BETA) Rx(ALPHA); pixels count from zero. The unit of length is taken for mm.

    Raises
    ------
    InputError
        A camera or a number is missing, or the lens is of a model that is not Brown's.
    """
    entries = [entry for entry in root.iterfind("ParameterList") if entry.get("name", "").startswith("CAMERA ")]
    require_one_each(len(entries), len(sizes), name)
    relative = _value(root, "extrinsics_relative_camera_to_camera", "false").strip().lower() == "true"
    cameras, poses = [], []
    for k, (entry, size) in enumerate(zip(entries, sizes, strict=True)):
        where = f"{name}, {entry.get('name')}"
        stated = _braced(_value(entry, "IMAGE_HEIGHT_WIDTH", ""), where)
        if len(stated) == 2:
            require_size((int(stated[1]), int(stated[0])), size, where)
        cx, cy, fx, fy, skew = (_number(entry, key, where) for key in ("CX", "CY", "FX", "FY", "FS"))
        matrix = np.array([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        cameras.append(checked_camera(matrix, _distortion(entry, where), size, where))
        poses.append(Pose.identity() if relative and k == 0 else _pose(entry, where))
    return Rig(tuple(cameras), camera_from_rig=tuple(poses))


def _distortion(entry: Element, where: str) -> Floats:
    model = _value(entry, "LENS_DISTORTION_MODEL", "OPENCV_LENS_DISTORTION").strip().upper()
    if model in PLAIN:
        return np.zeros(5)
    odd = [key for key in UNHANDLED if _number(entry, key, where) != 0.0]
    distortion = np.array([_number(entry, key, where) for key in ("K1", "K2", "P1", "P2", "K3")])
    if odd or (model not in BROWN and distortion.any()):
        raise InputError(
            f"{where}: the lens has {odd[0] if odd else f'the model {model}'}, and inspect3d knows only K1, K2, P1, P2 "
            "and K3 of OPENCV_LENS_DISTORTION: calibrate with that model."
        )
    return distortion


def _pose(entry: Element, where: str) -> Pose:
    translation = [_number(entry, key, where) for key in ("TX", "TY", "TZ")]
    rows = entry.find("ParameterList[@name='rotation_3x3_matrix']")
    if rows is None:
        angles = [_number(entry, key, where) for key in ("ALPHA", "BETA", "GAMMA")]
        return checked_pose(Rotation.from_euler("xyz", angles, degrees=True).as_matrix(), translation, where)
    matrix = [_braced(_value(rows, f"ROW {k}", ""), where) for k in range(3)]
    if any(len(row) != 3 for row in matrix):
        raise InputError(f"{where}: the rotation matrix has not three rows of three numbers.")
    return checked_pose(np.array(matrix), translation, where)


def _value(entry: Element, key: str, default: str) -> str:
    found = entry.find(f"Parameter[@name='{key}']")
    return default if found is None else found.get("value", default)


def _number(entry: Element, key: str, where: str) -> float:
    """Return a parameter; DICe leaves those out that are zero."""
    try:
        return float(_value(entry, key, "0"))
    except ValueError as error:
        raise InputError(f"{where}, {key}: {error}.") from error


def _braced(text: str, where: str) -> list[float]:
    """Return the numbers of `{ a, b, ... }`."""
    try:
        return [float(word) for word in text.strip(" {}").split(",") if word.strip()]
    except ValueError as error:
        raise InputError(f"{where}: {error}.") from error
