"""How the area is spread over the deviations."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.deviate.statistics import Statistics
from inspect3d.recipe_types import Interval
from inspect3d.report.canvas import INK, PALE, Canvas
from inspect3d.report.colour_bar import tick_words, ticks
from inspect3d.report.colours import ColourScale
from inspect3d.report.digits import decimals, number
from inspect3d.report.layout import Layout
from inspect3d.report.picture import Caption

BINS = 60


def draw_histogram(
    file: Path,
    values: Floats,
    areas: Floats,
    scale: ColourScale,
    caption: Caption,
    tolerance: Interval | None,
    layout: Layout,
) -> None:
    """Write a histogram of the deviations, in the colours of the map, as PNG.

    Parameters
    ----------
    file : to write
    values : (n,) mm, of the observed nodes
    areas : (n,) mm², what each stands for
    scale : of the map's colours
    caption : the words above
    tolerance : mm, drawn as two lines
    layout : of the sheet
    """
    canvas = Canvas(layout.width, layout.height)
    u = canvas.unit
    caption.write(canvas)
    box = (170 * u, 240 * u, layout.width - 90 * u, layout.height - 150 * u)
    left, top, right, bottom = box
    figures = Statistics.of(values, areas)
    low, high = _span(scale.limits, tolerance, figures)
    share, edges = np.histogram(values.clip(low, high), BINS, (low, high), weights=100 * areas / areas.sum())
    tallest = float(share.max()) * 1.12

    def x(value: float | Floats) -> Floats:
        return left + (np.asarray(value) - low) / (high - low) * (right - left)

    def y(percent: float | Floats) -> Floats:
        return bottom - np.asarray(percent) / tallest * (bottom - top)

    for value, words in _marks((0.0, tallest)):
        canvas.line([left, right], [float(y(value))] * 2, width=1, color="#d9dde2", zorder=0.5)
        canvas.text(left - 14 * u, float(y(value)), words, 26, ha="right")
    middle = (edges[:-1] + edges[1:]) / 2
    position = np.interp(middle, scale.limits, (0, len(scale.colours) - 1)).round().astype(int)
    canvas.axes.bar(
        x(middle), y(0) - y(share), width=np.diff(x(edges)), bottom=y(share), color=scale.colours[position] / 255,
        edgecolor=INK, linewidth=0.6 * u, zorder=1,
    )  # fmt: skip
    for value, words in _marks((low, high)):
        canvas.line([float(x(value))] * 2, [bottom, bottom + 9 * u], width=1.5)
        canvas.text(float(x(value)), bottom + 30 * u, words, 26, ha="center")
    canvas.line([left, right], [bottom, bottom], width=1.5)
    _mark_value(
        canvas, box, float(x(figures.mean)), f"mean {number(figures.mean, _places(figures), sign=True)}", "--", 0
    )
    for limit in tolerance or ():
        if low <= limit <= high:
            _mark_value(canvas, box, float(x(limit)), f"tolerance {limit:+g}".replace("-", "−"), "-", 1)
    ends = "; the outermost bars hold what lies beyond" if values.min() < low or values.max() > high else ""
    canvas.text((left + right) / 2, layout.height - 72 * u, f"Deviation, mm{ends}", 28, ha="center")
    canvas.text(42 * u, (top + bottom) / 2, "Share of the measured area, %", 28, ha="center", rotation=90)
    canvas.save(file)


def _span(limits: Interval, tolerance: Interval | None, figures: Statistics) -> Interval:
    low, high = (min(limits[0], *(tolerance or limits)), max(limits[1], *(tolerance or limits)))
    spread = max(8 * figures.std, 0.02 * (high - low))
    inner = (max(figures.min, figures.mean - spread), min(figures.max, figures.mean + spread))
    if (inner[1] - inner[0]) * 6 > high - low:
        return (low, high)
    margin = max(0.15 * (inner[1] - inner[0]), 0.01 * (high - low))
    return (inner[0] - margin, inner[1] + margin)


def _places(figures: Statistics) -> int:
    return min(decimals(figures.std), 4)


def _marks(limits: Interval) -> list[tuple[float, str]]:
    values = ticks(limits)
    return [(float(value), words) for value, words in zip(values, tick_words(values), strict=True)]


def _mark_value(
    canvas: Canvas, box: tuple[float, float, float, float], x: float, words: str, style: str, row: int
) -> None:
    left, top, right, bottom = box
    u = canvas.unit
    height = top - (14 + 38 * row) * u
    canvas.line([x, x], [height + 14 * u, bottom], width=2.5, linestyle=style, zorder=2)
    margin = 130 * u
    canvas.text(min(max(x, left + margin), right - margin), height, words, 26, ha="center", color=INK if row else PALE)
