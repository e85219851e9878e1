"""Axes and scale at the foot of a picture."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.report.canvas import INK, PALE, Canvas
from inspect3d.report.digits import significant
from inspect3d.report.layout import Layout

COLOURS = ("#c0392b", "#2e8b3d", "#2463b4")


def draw_compass(canvas: Canvas, layout: Layout, axes: Floats, pixel: float, words: str) -> None:
    """Draw the CAD's axes, a bar of round length and where the picture was taken from.

    Parameters
    ----------
    axes : (3, 3) rows right, up and towards the eye
    pixel : mm per pixel of the drawing
    words : of the viewpoint
    """
    u = layout.unit
    x, y = 95 * u, layout.bottom + 76 * u
    arm = 42 * u
    for k in np.argsort(axes[2]).tolist():
        right, up, _ = axes[:, k]
        length = float(np.hypot(right, up))
        if length < 0.05:
            canvas.axes.plot(x, y, marker="o", markersize=7 * u, color=COLOURS[k])
            canvas.text(x - 16 * u, y + 18 * u, "xyz"[k], 26, ha="center", color=COLOURS[k])
            continue
        arrow = {"arrowstyle": "-|>", "color": COLOURS[k], "lw": 2.2 * u, "mutation_scale": 13 * u}
        canvas.axes.annotate("", (x + arm * right, y - arm * up), (x, y), arrowprops=arrow)
        nearer = [j for j in range(3) if axes[2, j] > axes[2, k] and np.hypot(*(axes[:2, j] - axes[:2, k])) < 0.4]
        lower = 26 * u if nearer else 0.0
        beyond = arm + 15 * u / max(length, 0.3)
        canvas.text(x + beyond * right, y - beyond * up + lower, "xyz"[k], 26, ha="center", color=COLOURS[k])
    left = 220 * u
    length = round_length(pixel * 300 * u)
    right = left + length / pixel
    canvas.line([left, right], [y, y], width=4)
    for x in (left, right):
        canvas.line([x, x], [y - 8 * u, y + 8 * u], width=3)
    canvas.text((left + right) / 2, y - 24 * u, f"{significant(length, 6)} mm", 27, ha="center")
    canvas.text(layout.right - 20 * u, y, words, 25, ha="right", color=PALE)
    canvas.line([30 * u, layout.width - 30 * u], [layout.bottom + 4 * u] * 2, width=1, color=INK, alpha=0.15)


def round_length(length: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not longer."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(step for step in (1.0, 2.0, 5.0) if step * power <= length * (1 + 1e-9)) * power)
