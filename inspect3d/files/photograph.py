"""Photographs: PNG, TIFF and JPEG of 8 or 16 bits, colour or grey."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from inspect3d.arrays import Booleans, Floats, floats
from inspect3d.outcome import InputError

KINDS = "PNG, TIFF or JPEG"
FILM = 36.0  # mm, longer side of a 35 mm frame
PER_MILLIMETRE = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}  # of EXIF's units of resolution: inch, cm, mm, um
FOCAL, FOCAL_FILM, RESOLUTION, RESOLUTION_UNIT, ORIENTATION, EXIF = 0x920A, 0xA405, 0xA20E, 0xA210, 0x0112, 0x8769
LEAST = 32


@dataclass(frozen=True, eq=False)
class Photograph:
    """A photograph as it is stored: no turn that its EXIF data ask for is made, so that pixels stay what they are.

    Parameters
    ----------
    name : of the file
    grey : (rows, columns) grey levels, 0 to `white`
    white : the largest grey level the file could hold
    focal : px, focal length by its EXIF data; None where there is none
    turned : whether the EXIF data ask viewers to turn it
    """

    name: str
    grey: Floats
    white: float
    focal: float | None = None
    turned: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "grey", floats(self.grey, "a photograph", None, None))

    @property
    def size(self) -> tuple[int, int]:
        """Return width and height, px."""
        return self.grey.shape[1], self.grey.shape[0]


def read_photograph(path: Path) -> Photograph:
    """Return a photograph; colours become their luminance (ITU-R BT.601), an alpha channel is left out.

    Raises
    ------
    InputError
        The file is no picture of a kind that is read, or shows a single grey level.
    """
    pixels, white = _pixels(path)
    grey = _grey(pixels)
    if min(grey.shape) < LEAST:
        raise InputError(f"{path.name} has {grey.shape[1]} x {grey.shape[0]} pixels: that is no photograph of a part.")
    if np.ptp(grey) == 0:
        raise InputError(f"{path.name} is blank: all its pixels have the grey level {grey[0, 0]:g}. Take it again.")
    full = np.count_nonzero(grey >= white) / grey.size
    if full > 0.5:
        raise InputError(
            f"{path.name} is overexposed: {100 * full:.0f} % of its pixels are saturated. Take it again, darker."
        )
    focal, turned = _exif(path, max(grey.shape))
    return Photograph(path.name, grey, white, focal, turned)


def of_turned(photographs: Sequence[Photograph]) -> tuple[str, ...]:
    """Return what to say of photographs that ask viewers to turn them, a sentence each."""
    return tuple(
        f"{photograph.name} asks viewers to turn it; its pixels are counted as it is stored, unturned."
        for photograph in photographs
        if photograph.turned
    )


def read_mask(path: Path, size: tuple[int, int]) -> Booleans:
    """Return where a picture may be used: (rows, columns), True where the mask is not black.

    Raises
    ------
    InputError
        The mask is no picture, of another size than width and height `size`, or black all over.
    """
    pixels, _ = _pixels(path)
    mask = _grey(pixels) > 0
    if mask.shape[::-1] != size:
        raise InputError(
            f"The mask {path.name} has {mask.shape[1]} x {mask.shape[0]} pixels, its picture {size[0]} x {size[1]}."
        )
    if not mask.any():
        raise InputError(f"The mask {path.name} is black all over: paint white what may be used.")
    return mask


def _pixels(path: Path) -> tuple[Any, float]:
    """Return the pixels (rows, columns) or (rows, columns, channels) as stored, and the largest value of their type."""
    import cv2

    data = np.fromfile(path, dtype=np.uint8)
    try:
        pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    except cv2.error:  # its header names more pixels than OpenCV takes
        pixels = None
    if pixels is None:
        raise InputError(f"{path.name} cannot be read as a picture: it must be {KINDS}, and whole.")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path.name} holds {pixels.dtype} pixels: save it with 8 or 16 bits a channel.")
    return pixels, 255.0 if pixels.dtype == np.uint8 else 65535.0


def _grey(pixels: Any) -> Floats:
    if pixels.ndim == 2:
        return pixels.astype(np.float64)
    channels = pixels.astype(np.float64)
    if channels.shape[2] < 3:
        return channels[..., 0]
    return channels[..., :3] @ np.array([0.114, 0.587, 0.299])  # OpenCV stores blue, green, red


def _exif(path: Path, longer: int) -> tuple[float | None, bool]:
    """Return the focal length in px by the EXIF data, None where they say nothing, and whether they ask for a turn."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            tags = picture.getexif()
            details = tags.get_ifd(EXIF)
    except (OSError, UnidentifiedImageError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None, False
    turned = tags.get(ORIENTATION, 1) not in (0, 1)
    focal, film, per_unit, unit = (
        _number(details.get(tag)) for tag in (FOCAL, FOCAL_FILM, RESOLUTION, RESOLUTION_UNIT)
    )
    if focal > 0 and per_unit > 0 and unit in PER_MILLIMETRE:
        return focal * per_unit / PER_MILLIMETRE[int(unit)], turned
    if film > 0:
        return film / FILM * longer, turned
    return None, turned


def _number(value: Any) -> float:
    """Return a value of the EXIF data, which may be of any kind, as a number; zero where it is none."""
    try:
        number = float(value)
    except (TypeError, ValueError, ArithmeticError):
        return 0.0
    return number if np.isfinite(number) else 0.0
