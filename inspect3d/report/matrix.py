"""All methods at once: a matrix of small pictures and figures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.compare.comparison import Comparison
from inspect3d.record import Record
from inspect3d.report.canvas import PALE, Canvas
from inspect3d.report.colour_bar import draw_colour_bar
from inspect3d.report.colours import ColourScale
from inspect3d.report.digits import number
from inspect3d.report.layout import Layout
from inspect3d.report.map_scale import map_scale
from inspect3d.report.picture import Caption
from inspect3d.report.viewpoint import Viewpoint
from inspect3d.report.views import Views

MOST = 6
"""Methods that a sheet has room for."""


def draw_matrix(record: Record, file: Path, views: Views, viewpoint: Viewpoint, layout: Layout) -> None:
    """Write the matrix as PNG: deviations on the diagonal, differences (row minus column) above, figures below.

    All maps have the same colours, so that they can be compared at a glance.
    """
    parts = [part for part in record.parts if part.status.has_map and part.deviation is not None][:MOST]
    pairs = {(each.a, each.b): each for each in record.comparisons}
    canvas = Canvas(layout.width, layout.height)
    u, count = canvas.unit, len(parts)
    left, top = 30 * u, 200 * u
    width, height = (layout.right - left) / count, (layout.height - 30 * u - top) / count
    scale = map_scale(record)
    subtitle = "All methods: deviation (diagonal), difference row − column (above), figures (below)"
    Caption(record.recipe.part.name, subtitle, f"one scale for all · seen from {viewpoint.words}").write(canvas)
    size = (int(width - 12 * u), int(height - 52 * u))
    for row, first in enumerate(parts):
        for column, second in enumerate(parts):
            x, y = left + column * width, top + row * height
            comparison = pairs.get((first.name, second.name)) or pairs.get((second.name, first.name))
            if row == column and first.deviation is not None:
                canvas.fitted(x + 6 * u, y, first.name, 26, width - 12 * u, weight="bold")
                canvas.picture(x, y + 26 * u, _thumbnail(views, first.deviation.value, scale, size, viewpoint))
            elif comparison is not None and column > row:
                sign = 1 if comparison.a == first.name else -1
                canvas.fitted(x + 6 * u, y, f"{first.name} − {second.name}", 22, width - 12 * u, color=PALE)
                canvas.picture(x, y + 26 * u, _thumbnail(views, sign * comparison.difference, scale, size, viewpoint))
            elif comparison is not None:
                _draw_figures(canvas, comparison, x + 12 * u, y + height / 2 - 70 * u, width - 24 * u)
    draw_colour_bar(canvas, layout, scale)
    canvas.save(file)


def _thumbnail(
    views: Views, values: Floats, scale: ColourScale, size: tuple[int, int], viewpoint: Viewpoint
) -> np.ndarray:
    with views.window(values, scale, size) as window:
        return window.draw(viewpoint)[0]


def _draw_figures(canvas: Canvas, comparison: Comparison, x: float, y: float, width: float) -> None:
    lines = [f"both measured {number(100 * comparison.coverage, 0)} %"]
    if comparison.mean is not None and comparison.std is not None:
        mean, std = number(1000 * comparison.mean, 1, sign=True), number(1000 * comparison.std, 1)
        lines = [f"mean {mean} µm", f"std {std} µm", *lines]
    lines.append("E_n not known" if comparison.en_rms is None else f"E_n rms {number(comparison.en_rms, 2)}")
    for k, words in enumerate(lines):
        canvas.fitted(x, y + 40 * k * canvas.unit, words, 25, width)
