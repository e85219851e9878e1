"""The figures a measuring method hands over, drawn: photographs, maps over photographs, and curves of convergence."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inspect3d.arrays import Floats
from inspect3d.figure import Descent, Figure, Photograph, PixelMap
from inspect3d.report.canvas import INK, PALE, Canvas
from inspect3d.report.colours import ColourScale, rising_scale
from inspect3d.report.layout import Layout
from inspect3d.report.picture import Caption

Box = tuple[float, float, float, float]
LINE, MARK = "#00c8ff", "#ffd000"
CURVES = ("#2463b4", "#c0392b")
PALEST = 0.45  # share of white in a photograph under a map


def draw_figure(file: Path, figure: Figure, title: str, subject: str, layout: Layout) -> None:
    """Write a figure as PNG.

    Parameters
    ----------
    title, subject : of the sheet: the part, and the measurement
    layout : of the sheet
    """
    canvas = Canvas(layout.width, layout.height)
    below = _stages(figure) if isinstance(figure, Descent) else ""
    Caption(title, f"{subject}: {figure.words[0].lower()}{figure.words[1:]}", below).write(canvas)
    u = canvas.unit
    if isinstance(figure, Descent):
        _draw_descent(canvas, figure, (190 * u, 190 * u, layout.width - 60 * u, layout.height - 60 * u))
    elif isinstance(figure, PixelMap):
        box = _draw_grey(canvas, figure.grey, PALEST, _within(canvas, figure.grey.shape, 290 * u))
        _draw_map(canvas, figure, box)
    else:
        _draw_photograph(canvas, figure)
    canvas.save(file)


def _within(canvas: Canvas, shape: tuple[int, ...], right: float) -> Box:
    """Return the largest box for a picture of that shape below the caption, `right` px of the sheet left free."""
    u = canvas.unit
    width, height = canvas.width - 60 * u - right, canvas.height - 190 * u
    scale = min(width / shape[1], height / shape[0])
    left, top = 30 * u + (width - scale * shape[1]) / 2, 160 * u
    return left, top, left + scale * shape[1], top + scale * shape[0]


def _draw_grey(canvas: Canvas, grey: NDArray[np.uint8], pale: float, box: Box) -> Box:
    left, top, right, bottom = box
    shown = np.repeat((pale * 255 + (1 - pale) * grey)[:, :, None] / 255, 3, axis=2)
    canvas.axes.imshow(shown, extent=(left, right, bottom, top), interpolation="antialiased", aspect="auto", zorder=0)
    _whole_sheet(canvas)
    return box


def _draw_photograph(canvas: Canvas, figure: Photograph) -> None:
    from matplotlib.collections import LineCollection

    left, top, right, _ = _draw_grey(canvas, figure.grey, 0.0, _within(canvas, figure.grey.shape, 0))
    scale = (right - left) / figure.grey.shape[1] / figure.scale

    def on_sheet(pixels: Floats) -> Floats:
        return (pixels + 0.5) * scale + [left, top]

    lines = LineCollection(list(on_sheet(figure.lines)), colors=LINE, linewidths=2.0 * canvas.unit, zorder=2)
    canvas.axes.add_collection(lines)
    if len(figure.marks):
        x, y = on_sheet(figure.marks).T
        size = (22 * canvas.unit) ** 2
        canvas.axes.scatter(x, y, s=size, marker="+", color=MARK, linewidths=2 * canvas.unit, zorder=3)
        for number, (across, down) in enumerate(zip(x, y, strict=True), start=1):
            canvas.text(across + 14 * canvas.unit, down - 16 * canvas.unit, str(number), 22, color=MARK, weight="bold")
    _whole_sheet(canvas)


def _draw_map(canvas: Canvas, figure: PixelMap, box: Box) -> None:
    from matplotlib.colors import ListedColormap, LogNorm

    left, top, right, bottom = box
    scale = rising_scale(figure.label, "", figure.limits)
    low, high = figure.limits
    canvas.axes.imshow(
        np.clip(figure.values, low, high), extent=(left, right, bottom, top), norm=LogNorm(low, high),
        cmap=ListedColormap(scale.colours / 255), interpolation="nearest", aspect="auto", zorder=1,
    )  # fmt: skip
    u = canvas.unit
    _draw_bar(canvas, scale, (canvas.width - 270 * u, 240 * u, canvas.width - 226 * u, canvas.height - 90 * u))
    _whole_sheet(canvas)


def _draw_bar(canvas: Canvas, scale: ColourScale, box: Box) -> None:
    """Draw a colour bar with a logarithmic scale."""
    left, top, right, bottom = box
    u, (low, high) = canvas.unit, scale.limits
    words = scale.title.rsplit(", ", 1)
    canvas.text(left - 20 * u, top - 62 * u, words[0], 22, weight="bold")
    canvas.text(left - 20 * u, top - 30 * u, words[-1], 22, weight="bold")
    canvas.axes.imshow(
        scale.colours[::-1, None], extent=(left, right, bottom, top), aspect="auto", interpolation="nearest", zorder=1
    )
    canvas.line([left, right, right, left, left], [top, top, bottom, bottom, top], width=1.5)
    for value, mark in _marks(low, high):
        y = bottom - (np.log(value) - np.log(low)) / (np.log(high) - np.log(low)) * (bottom - top)
        canvas.line([right, right + 9 * u], [y, y], width=1.5)
        canvas.text(right + 18 * u, y, mark, 24)


def _draw_descent(canvas: Canvas, figure: Descent, box: Box) -> None:
    left, top, right, bottom = box
    u, count = canvas.unit, len(figure.stages)
    gap = 90 * u
    height = (bottom - top - gap * (len(figure.curves) - 1)) / len(figure.curves)
    for row, ((label, values), color) in enumerate(zip(figure.curves, CURVES, strict=False)):
        above = top + row * (height + gap)
        _draw_curve(canvas, label, values, color, (left, above, right, above + height))
    start = 0
    for number, (_, steps) in enumerate(groupby(figure.stages), start=1):
        end = start + len(list(steps))
        x = left + start / max(count, 1) * (right - left)
        if number > 1:
            canvas.line([x, x], [top, bottom], width=1, color=PALE, linestyle=":")
        canvas.text(x + 6 * u, top - 6 * u, str(number), 24, color=PALE, va="bottom")
        start = end
    canvas.text((left + right) / 2, bottom + 38 * u, "Step", 26, ha="center")


def _stages(figure: Descent) -> str:
    """Return the stages of a descent by their numbers; those that differ in their last word only are told once."""
    told, before = [], ""
    for number, (words, _) in enumerate(groupby(figure.stages), start=1):
        what, _, rest = words.partition(", ")
        told.append(f"{number} {rest if rest and what == before else words}")
        before = what
    return " · ".join(told)


def _draw_curve(canvas: Canvas, label: str, values: Floats, color: str, box: Box) -> None:
    left, top, right, bottom = box
    u = canvas.unit
    positive = values[values > 0]
    low, high = (positive.min() * 0.7, positive.max() * 1.4) if len(positive) else (0.1, 1.0)
    for value, mark in _marks(low, high):
        y = bottom - (np.log(value) - np.log(low)) / (np.log(high) - np.log(low)) * (bottom - top)
        canvas.line([left, right], [y, y], width=1, color="#d9dde2", zorder=0.5)
        canvas.text(left - 14 * u, y, mark, 24, ha="right")
    x = left + (np.arange(len(values)) + 0.5) / max(len(values), 1) * (right - left)
    shown = np.clip(values, low, None)
    y = bottom - (np.log(shown) - np.log(low)) / (np.log(high) - np.log(low)) * (bottom - top)
    canvas.line(list(x), list(y), width=2.5, color=color, marker="o", markersize=5 * u)
    canvas.line([left, left, right], [top, bottom, bottom], width=1.5, color=INK)
    canvas.text(left - 140 * u, (top + bottom) / 2, label, 24, ha="center", rotation=90)


def _marks(low: float, high: float) -> list[tuple[float, str]]:
    """Return round values between positive limits: powers of ten, with 2 and 5 of each where there are few."""
    decades = np.log10(high / low)
    steps = (1.0,) if decades > 4 else (1.0, 2.0, 5.0)
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    values = [step * 10.0**power for power in powers for step in steps]
    return [(value, f"{value:g}") for value in values if low * 0.999 <= value <= high * 1.001]


def _whole_sheet(canvas: Canvas) -> None:
    canvas.axes.set_xlim(0, canvas.width)
    canvas.axes.set_ylim(canvas.height, 0)
