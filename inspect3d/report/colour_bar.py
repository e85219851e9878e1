"""The key to the colours of a picture."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.recipe_types import Interval
from inspect3d.report.canvas import INK, PALE, Canvas
from inspect3d.report.colours import UNMEASURED, ColourScale
from inspect3d.report.digits import number
from inspect3d.report.layout import Layout


def draw_colour_bar(canvas: Canvas, layout: Layout, scale: ColourScale, tolerance: Interval | None = None) -> None:
    """Draw the bar with its figures, the limits of the tolerance beside it, and the grey of what was not measured."""
    u = layout.unit
    left, width = layout.right + 66 * u, 46 * u
    top, bottom = layout.top + 70 * u, layout.bottom - 70 * u
    heading = f"{scale.title}, {scale.unit}" if scale.unit else scale.title
    canvas.text(left - 32 * u, layout.top + 14 * u, heading, 26, weight="bold")
    if scale.classes:
        left = layout.right + 32 * u
        _draw_classes(canvas, scale, (left, 34 * u, top, bottom))
    else:
        _draw_values(canvas, scale, (left, width, top, bottom), tolerance)
    _patch(canvas, layout.right + 32 * u, layout.bottom - 22 * u, 34 * u, 26 * u, UNMEASURED)
    canvas.text(layout.right + 78 * u, layout.bottom - 9 * u, scale.rest, 24, color=PALE)


def ticks(limits: Interval) -> Floats:
    """Return round values between the limits, about nine, zero among them where it lies inside."""
    span = limits[1] - limits[0]
    rough = span / 8
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * next(each for each in (1.0, 2.0, 2.5, 5.0, 10.0) if each * power >= rough * (1 - 1e-9))
    first, last = np.ceil(limits[0] / step - 1e-9), np.floor(limits[1] / step + 1e-9)
    return np.arange(first, last + 1) * step


def tick_words(values: Floats) -> list[str]:
    """Return the values with as many decimals as tell them apart, and with a sign where one of them is negative."""
    step = float(np.diff(values).min()) if len(values) > 1 else max(abs(float(values[0])), 1.0)
    places = next(k for k in range(13) if k == 12 or abs(round(step, k) - step) < 1e-6 * step)
    return [number(float(value), places, sign=bool(values.min() < 0)) for value in values]


def _draw_values(
    canvas: Canvas, scale: ColourScale, box: tuple[float, float, float, float], tolerance: Interval | None
) -> None:
    left, width, top, bottom = box
    u, (low, high) = canvas.unit, scale.limits
    canvas.axes.imshow(
        scale.colours[::-1, None], extent=(left, left + width, bottom, top), aspect="auto", interpolation="nearest"
    )
    canvas.line([left, left + width, left + width, left, left], [top, top, bottom, bottom, top], width=1.5)
    tip = 26 * u
    signed = low < 0
    ends = [(top, -tip, scale.colours[-1])] + ([(bottom, tip, scale.colours[0])] if signed else [])
    for y, rise, colour in ends:
        xs, ys = [left, left + width / 2, left + width], [y, y + rise, y]
        canvas.axes.fill(xs, ys, color=colour / 255, linewidth=0)
        canvas.line(xs, ys, width=1.5)
    values = ticks(scale.limits)
    for value, words in zip(values, tick_words(values), strict=True):
        y = bottom - (value - low) / (high - low) * (bottom - top)
        canvas.line([left + width, left + width + 9 * u], [y, y], width=1.5)
        canvas.text(left + width + 16 * u, y, words, 29)
    for limit in tolerance or ():
        if low <= limit <= high:
            y = bottom - (limit - low) / (high - low) * (bottom - top)
            canvas.line([left - 14 * u, left + width], [y, y], width=3)
            canvas.text(left - 18 * u, y, "tol.", 22, ha="right", color=INK)


def _draw_classes(canvas: Canvas, scale: ColourScale, box: tuple[float, float, float, float]) -> None:
    left, width, top, _ = box
    u = canvas.unit
    step = 64 * u
    for k, (colour, words) in enumerate(zip(scale.colours[::-1], scale.classes[::-1], strict=True)):
        y = top + k * step
        _patch(canvas, left, y, width, 46 * u, colour)
        canvas.text(left + width + 12 * u, y + 23 * u, words, 24)


def _patch(canvas: Canvas, left: float, top: float, width: float, height: float, colour: object) -> None:
    xs, ys = [left, left + width, left + width, left], [top, top, top + height, top + height]
    canvas.axes.fill(xs, ys, color=np.asarray(colour) / 255, linewidth=0)
    canvas.line([*xs, xs[0]], [*ys, ys[0]], width=1.2)
