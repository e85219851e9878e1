"""What a measuring method hands to the report to be drawn: data with units, no pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inspect3d.arrays import Floats, floats


@dataclass(frozen=True, eq=False)
class Photograph:
    """A photograph with what was found in it.

    Parameters
    ----------
    name : part of a file name
    words : what it shows
    grey : (rows, columns) 8 bit, perhaps smaller than the photograph
    scale : px of the photograph per pixel of `grey`
    lines : (k, 2, 2) px of the photograph, the part's edges and outline
    marks : (m, 2) px, points that somebody picked
    """

    name: str
    words: str
    grey: NDArray[np.uint8]
    scale: float
    lines: Floats
    marks: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "lines", floats(self.lines, "lines", None, 2, 2))
        object.__setattr__(self, "marks", floats(self.marks, "marks", None, 2))


@dataclass(frozen=True, eq=False)
class PixelMap:
    """A positive quantity over a photograph, drawn in the colours of its logarithm.

    Parameters
    ----------
    name, words : as above
    label : the quantity with its unit
    grey, scale : the photograph below, as above
    values : (rows, columns) in the pixels of `grey`; NaN where there is none
    limits : ends of the colours
    """

    name: str
    words: str
    label: str
    grey: NDArray[np.uint8]
    scale: float
    values: Floats
    limits: tuple[float, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", floats(self.values, "values", *self.grey.shape, finite=False))


@dataclass(frozen=True, eq=False)
class Descent:
    """Positive quantities that fall step by step, drawn over the steps on logarithmic scales, one above the other.

    Parameters
    ----------
    name, words : as above
    stages : of each step the words of its stage; equal neighbours belong together
    curves : label with unit, and the values (steps,)
    """

    name: str
    words: str
    stages: tuple[str, ...]
    curves: tuple[tuple[str, Floats], ...]


Figure = Photograph | PixelMap | Descent
