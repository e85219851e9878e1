"""Where a picture is taken from."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats, floats, unit
from inspect3d.outcome import InputError

SIDES = {"front": "-y", "back": "+y", "left": "-x", "right": "+x", "top": "+z", "bottom": "-z"}


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A direction from the part to the eye, and what is up; the projection is parallel.

    Parameters
    ----------
    name : such as "+x-y" or "az 30°, el 20°"
    direction : (3,), unit, CAD frame
    """

    name: str
    direction: Floats

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "direction", floats(unit(np.asarray(self.direction, dtype=np.float64)), "direction", 3)
        )

    @classmethod
    def of(cls, view: str | tuple[float, float]) -> Viewpoint:
        """Return the viewpoint called "iso", "front", "+x", "-y+z", ..., or at (azimuth, elevation) in degrees.

        The azimuth turns from +x towards +y, the elevation rises towards +z; "30,20" means the same as (30, 20).

        Raises
        ------
        InputError
            The view is none of these.
        """
        if not isinstance(view, str):
            return cls._at(*view)
        text = view.strip().lower()
        if text == "iso":
            return cls("iso", np.ones(3))
        text = SIDES.get(text, text)
        if re.fullmatch(r"([+-][xyz]){1,3}", text) and len(set(text[1::2])) == len(text) // 2:
            signs = {axis: 1.0 if sign == "+" else -1.0 for sign, axis in zip(text[::2], text[1::2], strict=True)}
            return cls(text, np.array([signs.get(axis, 0.0) for axis in "xyz"]))
        try:
            azimuth, elevation = (float(part) for part in text.split(","))
        except ValueError:
            raise InputError(
                f"There is no view {view!r}: use iso, front, back, left, right, top, bottom, axes such as +x or -y+z, "
                "or azimuth,elevation in degrees."
            ) from None
        return cls._at(azimuth, elevation)

    @classmethod
    def _at(cls, azimuth: float, elevation: float) -> Viewpoint:
        if not (np.isfinite([azimuth, elevation]).all() and abs(elevation) <= 90):
            raise InputError(f"A view has a finite azimuth and an elevation within ±90°, not {azimuth}, {elevation}.")
        a, e = np.radians([azimuth, elevation])
        direction = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        return cls(f"azimuth {azimuth:g}°, elevation {elevation:g}°", direction)

    @property
    def words(self) -> str:
        """Return the name as it is printed."""
        return self.name.replace("-", "−")

    @property
    def axes(self) -> Floats:
        """Return the rows right, up and towards the eye, (3, 3); +z is up unless one looks along it, then +y."""
        straight = abs(self.direction[2]) > 0.999
        up = np.array([0.0, 1.0, 0.0]) if straight else np.array([0.0, 0.0, 1.0])
        right = unit(np.cross(up, self.direction))
        return np.stack([right, np.cross(self.direction, right), self.direction])


def around() -> tuple[Viewpoint, ...]:
    """Return the 26 viewpoints along the axes, the edges and the corners of a cube."""
    grid = [np.array(signs) for signs in itertools.product((1, 0, -1), repeat=3) if any(signs)]
    return tuple(Viewpoint(_name(signs), signs) for signs in grid)


def _name(signs: np.ndarray) -> str:
    return "".join(("-" if sign < 0 else "+") + axis for sign, axis in zip(signs, "xyz", strict=True) if sign)
