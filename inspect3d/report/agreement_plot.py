"""The plot of Bland and Altman: what two methods differ by, over what they agree on."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from inspect3d.compare.comparison import Comparison
from inspect3d.report.canvas import INK, PALE, Canvas
from inspect3d.report.colours import rounded_up
from inspect3d.report.digits import number
from inspect3d.report.layout import Layout
from inspect3d.report.picture import Caption
from inspect3d.report.plot import Plot

MOST = 20_000
"""Nodes that are drawn; of more every so many."""
CALM, LOUD = "#0072b2", "#d55e00"


def draw_agreement(file: Path, comparison: Comparison, title: str, layout: Layout) -> None:
    """Write the plot as PNG: difference over average, the mean difference and the limits of agreement.

    Parameters
    ----------
    comparison : of two maps with nodes in common
    title : the part's name
    layout : of the sheet

    Notes
    -----
    J. M. Bland, D. G. Altman, "Statistical methods for assessing agreement between two methods of clinical
    measurement", Lancet 327 (1986).
    """
    if comparison.mean is None or comparison.limits_of_agreement is None:
        raise ValueError(f"{comparison.a} and {comparison.b} have nothing in common")
    canvas = Canvas(layout.width, layout.height)
    u = canvas.unit
    common = np.flatnonzero(comparison.common)
    every = -(-len(common) // MOST)
    drawn = common[::every]
    each = f"every {every}th node" if every > 1 else "every node"
    subtitle = f"{comparison.a} and {comparison.b}: differences over averages"
    Caption(title, subtitle, f"{each} that both measured · lines: mean, and limits of agreement (95 %)").write(canvas)
    across, up = comparison.average[drawn], comparison.difference[drawn]
    low, high = comparison.limits_of_agreement
    reach = rounded_up(float(max(np.percentile(np.abs(up), 99.8) * 1.1, abs(low) * 1.3, abs(high) * 1.3)))
    ends = np.percentile(across, (0.1, 99.9))
    margin = 0.06 * max(float(np.ptp(ends)), 1e-6)
    box = (190 * u, 230 * u, layout.width - 60 * u, layout.height - 110 * u)
    plot = Plot(canvas, box, (float(ends[0] - margin), float(ends[1] + margin)), (-reach, reach))
    plot.draw_axes(f"Average of {comparison.a} and {comparison.b}, mm", f"{comparison.a} − {comparison.b}, mm")
    en = None if comparison.en is None else comparison.en[drawn]
    loud = np.zeros(len(drawn), bool) if en is None else en > 1
    size = (5.0 if len(drawn) > 4000 else 9.0) * u
    for nodes, colour in ((~loud, CALM), (loud, LOUD)):
        x, y = np.clip(across[nodes], *plot.across), np.clip(up[nodes], *plot.up)
        canvas.axes.scatter(plot.x(x), plot.y(y), s=size**2, color=colour, alpha=0.35, linewidths=0, zorder=1)
    plot.line(np.array(plot.across), np.zeros(2), PALE, 1.2)
    plot.mark(comparison.mean, f"mean {_micro(comparison.mean)} µm", INK, "-")
    plot.mark(high, f"{_micro(high)} µm")
    plot.mark(low, f"{_micro(low)} µm", below=True)
    if en is not None:
        _draw_key(canvas, [("E_n up to 1", CALM), ("E_n above 1", LOUD)])
    canvas.save(file)


def _draw_key(canvas: Canvas, entries: list[tuple[str, str]]) -> None:
    u = canvas.unit
    for k, (words, colour) in enumerate(entries):
        x = (190 + 260 * k) * u
        canvas.axes.scatter([x + 10 * u], [188 * u], s=(14 * u) ** 2, color=colour, linewidths=0)
        canvas.text(x + 30 * u, 188 * u, words, 25)


def _micro(length: float) -> str:
    return number(1000 * length, 1, sign=True)
