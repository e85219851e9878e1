"""Pictures made ready to be read between their pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from inspect3d.arrays import Floats, Integers, Singles, floats

Interpolation = Literal["cubic", "linear"]

LEAST = 8
COARSER, BEFORE = 3.0, 2.0


@dataclass(frozen=True, eq=False)
class Stack:
    """The pictures of all views at one blur, in one block of memory.

    Parameters
    ----------
    levels : (v, rows, columns), B-spline coefficients (cubic) or grey levels (linear); smaller pictures lie top left
    sizes : (v, 2) width and height of each, px
    cubic : which of the two
    step : px of the picture from one entry to the next
    """

    levels: Singles
    sizes: Integers
    cubic: bool
    step: int = 1

    def sampled(self, view: int, places: Floats) -> Floats:
        """Return value, d/dx and d/dy (n, 3) of a view's picture at places (n, 2) px."""
        from inspect3d.correlation.sampling_kernel import sample_all

        width, height = self.sizes[view]
        found = np.empty((len(places), 3))
        at = floats(places, "places", None, 2) / self.step
        sample_all(self.levels[view, :height, :width], self.cubic, at, found)
        return found / np.array([1, self.step, self.step])


@dataclass(frozen=True, eq=False)
class Pictures:
    """One picture of each view.

    Parameters
    ----------
    grey : of each view (rows, columns), grey levels; kept in single precision, which tells a pixel's noise by far
    interpolation : cubic B-spline, or linear as in the paper
    """

    grey: Sequence[Floats | Singles]
    interpolation: Interpolation = "cubic"

    def __post_init__(self) -> None:
        if len(self.grey) < 2:
            raise ValueError(f"stereocorrelation compares two pictures or more, not {len(self.grey)}")
        object.__setattr__(self, "grey", tuple(np.ascontiguousarray(g, dtype=np.float32) for g in self.grey))
        if not all(np.isfinite(g).all() for g in self.grey):
            raise ValueError("a picture has grey levels that are not finite")
        if min(min(g.shape) for g in self.grey) < LEAST:
            raise ValueError(f"a picture has fewer than {LEAST} rows or columns")

    @cached_property
    def sharp(self) -> Stack:
        """Return the pictures as they are, ready to be read."""
        return self.blurred(0.0)

    def blurred(self, blur: float) -> Stack:
        """Return the pictures blurred by a Gaussian of standard deviation `blur` px, ready to be read.

        From three pixels on, a blurred picture keeps every second pixel of each row and column, from six every fourth,
        and so on: the others say nothing new.
        """
        from inspect3d.correlation.spline_kernel import to_coefficients

        step, smooth = 1, [np.asarray(g, dtype=np.float32) for g in self.grey]
        while blur >= COARSER * step and min(min(g.shape) for g in smooth) >= 2 * LEAST:
            smooth = [_smoothed(g, BEFORE)[::2, ::2] for g in smooth]
            step *= 2
        rest = np.sqrt(blur**2 - BEFORE**2 * (step**2 - 1) / 3) / step
        sizes = np.array([[g.shape[1], g.shape[0]] for g in smooth], dtype=np.int64)
        levels = np.zeros((len(smooth), sizes[:, 1].max(), sizes[:, 0].max()), dtype=np.float32)
        for place, picture in zip(levels, smooth, strict=True):
            part = place[: picture.shape[0], : picture.shape[1]]
            part[:] = _smoothed(picture, rest) if rest > 0 else picture
            if self.interpolation == "cubic":
                to_coefficients(part)
        return Stack(levels, sizes, self.interpolation == "cubic", step)


def _smoothed(grey: Singles, blur: float) -> Singles:
    """Return a picture blurred by a Gaussian, cut off at four standard deviations; its border goes on outside."""
    import cv2

    width = 2 * int(4 * blur + 0.5) + 1
    smooth = cv2.GaussianBlur(grey, (width, width), blur, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(smooth, dtype=np.float32)
