"""Named points in a picture, each with its deviation and uncertainty."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.report.canvas import INK, Canvas
from inspect3d.report.digits import measured
from inspect3d.report.layout import Layout
from inspect3d.report.reading import Reading

FRAMES = ("#5d6570", "#3b7a57", "#b9770e", "#b03a2e")
"""Of a flag without verdict, conform, undecided, nonconform."""


def draw_flags(canvas: Canvas, layout: Layout, seen: Sequence[Reading], pixels: Floats) -> None:
    """Draw the flags in two columns beside the part, in the order of their points, so that no leaders cross.

    What does not fit beside the part is left to the table of named points.

    Parameters
    ----------
    seen : the readings whose nodes are seen
    pixels : (k, 2) px, where their nodes lie on the sheet
    """
    if not seen:
        return
    for left in (True, False):
        members = _side(pixels, left)
        members = members[np.argsort(pixels[members, 1])]
        height, room = 72 * layout.unit, layout.bottom - layout.top
        members = members[: int(room // (height * 1.1))]
        heights = spread(pixels[members, 1], height * 1.1, layout.top + height / 2, layout.bottom - height / 2)
        for k, y in zip(members, heights, strict=True):
            _draw_flag(canvas, layout, seen[k], pixels[k], y, left)


def spread(wanted: Floats, gap: float, low: float, high: float) -> Floats:
    """Return places near the wanted ones, in the same order, at least a gap apart, between two limits if they fit."""
    places = np.array(wanted, dtype=np.float64).clip(low, high)
    for k in range(1, len(places)):
        places[k] = max(places[k], places[k - 1] + gap)
    if len(places) and places[-1] > high:
        places[-1] = high
        for k in range(len(places) - 2, -1, -1):
            places[k] = min(places[k], places[k + 1] - gap)
    return places


def _side(pixels: Floats, left: bool) -> np.ndarray:
    order = np.argsort(pixels[:, 0], kind="stable")
    half = len(order) // 2
    return order[:half] if left else order[half:]


def _draw_flag(canvas: Canvas, layout: Layout, reading: Reading, pixel: Floats, y: float, left: bool) -> None:
    u = layout.unit
    width, height = layout.column - 24 * u, 66 * u
    x = 12 * u if left else layout.right - 12 * u - width
    colour = FRAMES[reading.verdict]
    edge = x + width if left else x
    canvas.line([edge, pixel[0]], [y, pixel[1]], width=1.4, color=INK)
    canvas.axes.plot(*pixel, marker="o", markersize=6 * u, color="white", markeredgecolor=INK, markeredgewidth=1.4 * u)
    xs, ys = [x, x + width, x + width, x, x], [y - height / 2] * 2 + [y + height / 2] * 2 + [y - height / 2]
    canvas.axes.fill(xs, ys, color="white", zorder=2.5)
    canvas.line(xs, ys, width=2.5, color=colour, zorder=2.6)
    canvas.fitted(x + 9 * u, y - 16 * u, reading.name, 23, width - 18 * u, weight="bold")
    canvas.fitted(x + 9 * u, y + 15 * u, measured(reading.value, reading.sigma, unit=""), 23, width - 12 * u)
