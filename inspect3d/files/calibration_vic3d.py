"""Calibrations in project files of VIC-3D."""

from __future__ import annotations

from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from inspect3d.files.calibration import Rig
from inspect3d.files.calibration_camera import Sizes, checked_camera, checked_pose, require_one_each
from inspect3d.outcome import InputError


def read_calibration_vic3d(root: Element, name: str, sizes: Sizes) -> Rig:
    """Return the cameras of a VIC-3D project.

    A camera is `cx cy fx fy skew k1 k2 k3`, its orientation `alpha beta gamma tx ty tz` in degrees and mm, with
    X_camera = Rz(gamma) Ry(beta) Rx(alpha) X + t. Pixels count from zero; the distortion is 1 + k1 r² + k2 r⁴ + k3 r⁶
    of the ideal place. VIC-3D knows nothing of the part: its world is the rig's.

    Raises
    ------
    InputError
        A camera is missing, or its line is not of that form.
    """
    entries = sorted(root.iterfind(".//calibration/camera"), key=lambda entry: entry.get("id", ""))
    require_one_each(len(entries), len(sizes), name)
    cameras, poses = [], []
    for k, (entry, size) in enumerate(zip(entries, sizes, strict=True), 1):
        where = f"{name}, camera {k}"
        cx, cy, fx, fy, skew, k1, k2, k3 = _numbers(entry.text, 8, where)
        alpha, beta, gamma, *translation = _numbers(entry.findtext("orientation"), 6, f"{where}, orientation")
        matrix = np.array([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        cameras.append(checked_camera(matrix, [k1, k2, 0.0, 0.0, k3], size, where))
        rotation = Rotation.from_euler("xyz", [alpha, beta, gamma], degrees=True).as_matrix()
        poses.append(checked_pose(rotation, translation, where))
    return Rig(tuple(cameras), camera_from_rig=tuple(poses))


def _numbers(text: str | None, count: int, where: str) -> list[float]:
    try:
        numbers = [float(word) for word in (text or "").split()]
    except ValueError as error:
        raise InputError(f"{where}: {error}.") from error
    if len(numbers) != count:
        raise InputError(f"{where} has {len(numbers)} numbers where {count} are wanted.")
    return numbers
