"""Pictures made ready to be read between their pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from inspect3d.arrays import Floats, Integers, floats

Interpolation = Literal["cubic", "linear"]


@dataclass(frozen=True, eq=False)
class Stack:
    """The pictures of all views at one blur, in one block of memory.

    Parameters
    ----------
    levels : (v, rows, columns), B-spline coefficients (cubic) or grey levels (linear); smaller pictures lie top left
    sizes : (v, 2) width and height of each, px
    cubic : which of the two
    """

    levels: Floats
    sizes: Integers
    cubic: bool

    def sampled(self, view: int, places: Floats) -> Floats:
        """Return value, d/dx and d/dy (n, 3) of a view's picture at places (n, 2) px."""
        from inspect3d.correlation.sampling_kernel import sample_all

        width, height = self.sizes[view]
        found = np.empty((len(places), 3))
        sample_all(self.levels[view, :height, :width], self.cubic, floats(places, "places", None, 2), found)
        return found


@dataclass(frozen=True, eq=False)
class Pictures:
    """One picture of each view.

    Parameters
    ----------
    grey : of each view (rows, columns), grey levels
    interpolation : cubic B-spline, or linear as in the paper
    """

    grey: Sequence[Floats]
    interpolation: Interpolation = "cubic"

    def __post_init__(self) -> None:
        if len(self.grey) < 2:
            raise ValueError(f"stereocorrelation compares two pictures or more, not {len(self.grey)}")
        object.__setattr__(self, "grey", tuple(floats(g, "a picture", None, None) for g in self.grey))
        if min(min(g.shape) for g in self.grey) < 8:
            raise ValueError("a picture has fewer than 8 rows or columns")

    def blurred(self, blur: float) -> Stack:
        """Return the pictures blurred by a Gaussian of standard deviation `blur` px, ready to be read."""
        from scipy.ndimage import gaussian_filter, spline_filter

        sizes = np.array([[g.shape[1], g.shape[0]] for g in self.grey], dtype=np.int64)
        levels = np.zeros((len(self.grey), sizes[:, 1].max(), sizes[:, 0].max()))
        for place, grey in zip(levels, self.grey, strict=True):
            smooth = gaussian_filter(grey, blur, mode="nearest") if blur > 0 else grey
            if self.interpolation == "cubic":
                smooth = spline_filter(smooth, order=3, mode="mirror")
            place[: grey.shape[0], : grey.shape[1]] = smooth
        return Stack(levels, sizes, self.interpolation == "cubic")
