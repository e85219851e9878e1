"""Calibration files of any kind that is known."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import ParseError, fromstring

import numpy as np

from inspect3d.files.calibration import Rig
from inspect3d.files.calibration_camera import Sizes
from inspect3d.files.calibration_colmap import read_calibration_colmap
from inspect3d.files.calibration_dice import read_calibration_dice
from inspect3d.files.calibration_json import read_calibration_json
from inspect3d.files.calibration_opencv import read_calibration_opencv
from inspect3d.files.calibration_vic3d import read_calibration_vic3d
from inspect3d.outcome import InputError

KINDS = "our own JSON, OpenCV's YAML or XML, a VIC-3D project, a DICe camera system, COLMAP's cameras.txt"
DEEPEST = 50  # brackets within each other; the deepest of a calibration are a handful


def load_calibration(files: tuple[Path, ...], names: tuple[str, ...], sizes: Sizes) -> Rig:
    """Return the cameras that calibration files hold, one per picture.

    The kind of a file shows in its content, not in its name.

    Parameters
    ----------
    files : one file; or one per picture, or intrinsics and extrinsics, both of OpenCV
    names : file names of the pictures
    sizes : their widths and heights, px

    Raises
    ------
    InputError
        A file is not readable, not of a known kind, or does not fit the pictures.
    """
    first = files[0]
    if first.is_dir() or first.name in ("cameras.txt", "images.txt"):
        return read_calibration_colmap(first, names, sizes)
    try:
        data = first.read_bytes()
    except OSError as error:
        raise InputError(f"{first.name} cannot be read: {error.strerror}.") from error
    if data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        return _read_xml(data, files, sizes)
    if _depth(data) > DEEPEST:
        raise InputError(f"{first.name} is no calibration that inspect3d reads: {KINDS}.")
    if b'"cameras"' in data:
        return read_calibration_json(data.decode("utf-8-sig", errors="replace"), first.name, names, sizes)
    if data.startswith((b"%YAML", b"---", b"{")):
        return read_calibration_opencv(files, sizes)
    raise InputError(f"{first.name} is no calibration that inspect3d reads: {KINDS}.")


def _depth(data: bytes) -> int:
    """Return how deep brackets are nested: OpenCV's reader crashes where they are without end, and json gives up."""
    letters = np.frombuffer(data, np.uint8)
    opened = np.isin(letters, np.frombuffer(b"{[", np.uint8)).astype(np.int64)
    closed = np.isin(letters, np.frombuffer(b"}]", np.uint8)).astype(np.int64)
    return int(np.cumsum(opened - closed).max(initial=0))


def _read_xml(data: bytes, files: tuple[Path, ...], sizes: Sizes) -> Rig:
    name = files[0].name
    try:
        root = fromstring(data)
    except (ParseError, ValueError) as error:
        raise InputError(f"{name} is not valid XML: {error}.") from error
    if root.tag == "opencv_storage":
        return read_calibration_opencv(files, sizes)
    if root.tag == "ParameterList":
        return read_calibration_dice(root, name, sizes)
    if root.find(".//calibration/camera") is not None:
        return read_calibration_vic3d(root, name, sizes)
    raise InputError(f"{name} is XML, but no calibration that inspect3d reads: {KINDS}.")
