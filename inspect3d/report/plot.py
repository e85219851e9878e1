"""Axes with ticks on a sheet, for curves and points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.recipe_types import Interval
from inspect3d.report.canvas import INK, Canvas
from inspect3d.report.colour_bar import tick_words, ticks

RULE = "#d9dde2"


@dataclass(frozen=True, eq=False)
class Plot:
    """A box on a sheet with a linear scale along either side.

    Parameters
    ----------
    canvas : the sheet
    box : left, top, right, bottom; px
    across, up : values at the ends of the two scales
    """

    canvas: Canvas
    box: tuple[float, float, float, float]
    across: Interval
    up: Interval

    def x(self, values: Floats | float) -> Floats:
        """Return where values lie from the left, px."""
        left, _, right, _ = self.box
        return left + (np.asarray(values) - self.across[0]) / (self.across[1] - self.across[0]) * (right - left)

    def y(self, values: Floats | float) -> Floats:
        """Return where values lie from the top, px."""
        _, top, _, bottom = self.box
        return bottom - (np.asarray(values) - self.up[0]) / (self.up[1] - self.up[0]) * (bottom - top)

    def draw_axes(self, across: str, up: str) -> None:
        """Draw the box with round values along both sides and the words for them."""
        canvas, u = self.canvas, self.canvas.unit
        left, top, right, bottom = self.box
        for value, words in _marks(self.across):
            canvas.line([float(self.x(value))] * 2, [top, bottom], width=1, color=RULE, zorder=0.4)
            canvas.text(float(self.x(value)), bottom + 26 * u, words, 25, ha="center")
        for value, words in _marks(self.up):
            canvas.line([left, right], [float(self.y(value))] * 2, width=1, color=RULE, zorder=0.4)
            canvas.text(left - 14 * u, float(self.y(value)), words, 25, ha="right")
        canvas.line([left, right, right, left, left], [top, top, bottom, bottom, top], width=1.5, color=INK, zorder=3)
        canvas.text((left + right) / 2, bottom + 66 * u, across, 26, ha="center")
        canvas.text(left - 118 * u, (top + bottom) / 2, up, 26, ha="center", rotation=90)

    def line(self, x: Floats, y: Floats, color: str, width: float = 2.0, style: str = "-", zorder: float = 2) -> None:
        """Draw a curve; NaN interrupts it."""
        thick = width * self.canvas.unit * 0.72
        self.canvas.axes.plot(self.x(x), self.y(y), color=color, linewidth=thick, linestyle=style, zorder=zorder)

    def band(self, x: Floats, low: Floats, high: Floats, color: str) -> None:
        """Fill what lies between two curves; NaN interrupts it."""
        self.canvas.axes.fill_between(
            self.x(x), self.y(low), self.y(high), color=color, alpha=0.22, linewidth=0, zorder=1
        )

    def mark(self, value: float, words: str, color: str = INK, style: str = "--", below: bool = False) -> None:
        """Draw a line across at a value, its words at the right end."""
        u, (left, _, right, _) = self.canvas.unit, self.box
        y = float(self.y(value))
        self.canvas.line([left, right], [y, y], width=2, color=color, linestyle=style, zorder=2.5)
        self.canvas.text(right - 10 * u, y + (18 if below else -18) * u, words, 24, ha="right", color=color)


def _marks(limits: Interval) -> list[tuple[float, str]]:
    values = ticks(limits)
    return [(float(value), words) for value, words in zip(values, tick_words(values), strict=True)]
