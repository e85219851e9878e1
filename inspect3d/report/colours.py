"""Colours of the fields: safe for the colour-blind, and never to be mistaken for the grey of what was not measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inspect3d.arrays import Floats
from inspect3d.deviate.statistics import percentiles
from inspect3d.recipe_types import Interval

UNMEASURED = (158, 161, 166)
BACK = (111, 118, 131)
"""The inside of an open surface."""
BANDS = ("too little", "undecided, low", "conform", "undecided, high", "too much")
BAND_COLOURS = ((44, 123, 182), (171, 217, 233), (255, 255, 191), (253, 174, 97), (215, 25, 28))
EN_STEPS = (0.5, 1.0, 1.5)
EN_WORDS = ("up to 0.5", "0.5 to 1", "1 to 1.5", "above 1.5")
EN_COLOURS = ((255, 255, 204), (254, 217, 118), (240, 100, 40), (128, 0, 38))
STEPS = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


@dataclass(frozen=True, eq=False)
class ColourScale:
    """How a field becomes colour.

    Parameters
    ----------
    title : of the colour bar, without the unit
    unit : "mm", or empty
    limits : values of the two ends
    colours : (k, 3) uint8, evenly spaced between the limits; one per class where there are classes
    classes : words for the values 1, 2, ... of a field that has no numbers; empty for a field that has
    rest : words for the grey of the other nodes
    """

    title: str
    unit: str
    limits: Interval
    colours: NDArray[np.uint8]
    classes: tuple[str, ...] = ()
    rest: str = "not measured"

    def renamed(self, title: str, unit: str) -> ColourScale:
        """Return the same colours for another field."""
        return replace(self, title=title, unit=unit)


def deviation_scale(limits: Interval) -> ColourScale:
    """Return blue for too little, red for too much and pale yellow for nominal, wherever zero lies in the limits.

    ColorBrewer's RdYlBu reversed: safe for the colour-blind, and its middle is not grey.
    """
    from matplotlib import colormaps

    values = np.linspace(*limits, 256)
    largest = max(abs(limits[0]), abs(limits[1]))
    return ColourScale("Deviation", "mm", limits, _bytes(colormaps["RdYlBu_r"](0.5 + 0.5 * values / largest)))


def rising_scale(title: str, unit: str, limits: Interval) -> ColourScale:
    """Return the perceptually uniform map `viridis`, for fields without a sign."""
    from matplotlib import colormaps

    return ColourScale(title, unit, limits, _bytes(colormaps["viridis"](np.linspace(0, 1, 256))))


def band_scale() -> ColourScale:
    """Return the five classes of a tolerance: too little, undecided, conform, undecided, too much."""
    return ColourScale("Tolerance", "", (0.5, 5.5), np.array(BAND_COLOURS, dtype=np.uint8), BANDS)


def verdict_scale() -> ColourScale:
    """Return the classes of a verdict: conform, undecided, nonconform."""
    colours = np.array(BAND_COLOURS[2:], dtype=np.uint8)
    return ColourScale("Verdict", "", (0.5, 3.5), colours, ("conform", "undecided", "nonconform"))


def en_scale() -> ColourScale:
    """Return four classes of E_n, pale to dark: what lies above 1 differs by more than its uncertainty."""
    return ColourScale("E_n", "", (0.5, 4.5), np.array(EN_COLOURS, dtype=np.uint8), EN_WORDS, rest="not compared")


def en_classes(values: Floats) -> Floats:
    """Return the class of each value of E_n, (n,) 1 to 4; NaN where there is none."""
    return np.where(np.isfinite(values), 1.0 + np.digitize(values, EN_STEPS), np.nan)


def mark_scale(title: str, words: str) -> ColourScale:
    """Return one colour for the nodes that are marked; the others are grey."""
    return ColourScale(title, "", (0.5, 1.5), np.array(BAND_COLOURS[:1], dtype=np.uint8), (words,), rest=f"not {words}")


def symmetric_limits(values: Floats, areas: Floats) -> Interval:
    """Return limits about zero, rounded up to a value one reads off easily.

    They hold 99.8 % of the area, so that a local defect shows its height; but not more than three times what holds
    95 %, so that a few blunders don't flatten the rest.
    """
    if not len(values) or not areas.sum() > 0:
        return (-0.1, 0.1)
    most, nearly_all = percentiles(np.abs(values), areas, (95.0, 99.8))
    top = rounded_up(float(min(nearly_all, 3.0 * most)))
    return (-top, top)


def rising_limits(values: Floats, areas: Floats) -> Interval:
    """Return limits from zero that hold nearly all of the area, chosen likewise."""
    return (0.0, symmetric_limits(values, areas)[1])


def rounded_up(value: float) -> float:
    """Return the next of 1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8 times a power of ten; 0.001 for nothing."""
    if not value > 1e-9:
        return 0.001
    power = 10.0 ** np.floor(np.log10(value))
    step = next(step for step in STEPS if step * power >= value * (1 - 1e-9))
    return float(f"{step * power:.6g}")


def _bytes(colours: Floats) -> NDArray[np.uint8]:
    return np.round(255 * colours[:, :3]).astype(np.uint8)
