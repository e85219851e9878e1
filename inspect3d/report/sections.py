"""Sections through the part: nominal and measured profile, the deviation magnified, with its uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inspect3d.arrays import Floats, unit
from inspect3d.deviate.section import Profile, section
from inspect3d.recipe import Section
from inspect3d.record import MeasuredPart, Record
from inspect3d.report.blocks import Bullets, Chapter, Heading, Paragraph, Picture
from inspect3d.report.canvas import INK, PALE, Canvas
from inspect3d.report.colours import rounded_up
from inspect3d.report.compass import round_length
from inspect3d.report.digits import COVERAGE, measured, number
from inspect3d.report.layout import Layout
from inspect3d.report.picture import Caption
from inspect3d.report.plot import Plot
from inspect3d.report.viewpoint import Viewpoint

METHODS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#7a5c00", "#56b4e9")
"""Of the measurements, after M. Okabe and K. Ito, "Color universal design" (2008): safe for the colour-blind."""
SHOWN = 0.07
"""Share of the profile's size that the largest deviation takes when it is magnified."""
WORDS = (
    "The profile of the CAD model is black; the measured profile is drawn at the deviation from it, magnified, and the "
    "band around it is ± U (k = 2), magnified alike. Below, the same over the length along the profile. Gaps were not "
    "measured. Each map is in its own alignment."
)


@dataclass(frozen=True, eq=False)
class _Cut:
    """A section with all that its drawings share."""

    record: Record
    plane: Section
    profiles: tuple[Profile, ...]

    @property
    def axes(self) -> tuple[Floats, Floats]:
        """Return the directions right and up in the plane, seen from the side on which right is a positive axis."""
        right, up, _ = Viewpoint("section", np.array(self.plane.normal)).axes
        return (-right if right[np.abs(right).argmax()] < 0 else right), up


def draw_sections(record: Record, folder: Path, layout: Layout) -> Chapter | None:
    """Draw every section of the recipe for all measurements together and for each, and return the chapter on them.

    Parameters
    ----------
    record : the inspection
    folder : where the pictures go
    layout : of a sheet
    """
    parts = [part for part in record.parts if part.status.has_map and part.deviation is not None]
    if not record.recipe.report.sections or not parts:
        return None
    blocks: list[Heading | Paragraph | Picture | Bullets] = [Paragraph(WORDS)]
    for k, plane in enumerate(record.recipe.report.sections, start=1):
        blocks.append(Heading(f"Section {k}: {_words(plane)}"))
        profiles = section(record.nominal.mesh, np.array(plane.point), np.array(plane.normal))
        if not profiles:
            blocks.append(Paragraph("This plane does not meet the part."))
            continue
        cut = _Cut(record, plane, profiles)
        blocks.append(Bullets(tuple(_sentence(cut, part) for part in parts)))
        groups = (
            [("all", parts), *((part.name, [part]) for part in parts)] if len(parts) > 1 else [(parts[0].name, parts)]
        )
        for name, group in groups:
            file = f"section_{k}_{name}.png" if len(group) == 1 else f"section_{k}.png"
            of_whom = "all measurements" if len(group) > 1 else name
            words = f"Section {k}, {of_whom}"
            colours = [METHODS[parts.index(part) % len(METHODS)] for part in group]
            _draw(cut, group, colours, folder / file, layout, words)
            blocks.append(Picture(file, f"{words}: {_words(plane)}"))
    return Chapter("sections", "Sections", tuple(blocks))


def magnification(largest: float, size: float) -> float:
    """Return the round factor at which a deviation takes its share of a profile of that size, at least 1."""
    return max(round_length(SHOWN * size / max(largest, 1e-9)), 1.0)


def _draw(
    cut: _Cut, parts: Sequence[MeasuredPart], colours: Sequence[str], file: Path, layout: Layout, words: str
) -> None:
    canvas = Canvas(layout.width, layout.height)
    curves = [
        _Curve(colour, [profile.along(part.deviation) for profile in cut.profiles])
        for part, colour in zip(parts, colours, strict=True)
        if part.deviation is not None
    ]
    largest = max(curve.largest for curve in curves)
    right, up = cut.axes
    points = np.vstack([profile.points for profile in cut.profiles])
    factor = magnification(largest, float(np.hypot(np.ptp(points @ right), np.ptp(points @ up))))
    figures = f"deviations magnified {factor:g} times"
    Caption(cut.record.recipe.part.name, f"{words}: {_words(cut.plane)}", figures).write(canvas)
    _draw_key(canvas, [part.name for part in parts], colours)
    u = canvas.unit
    box = (170 * u, 210 * u, layout.width - 60 * u, 730 * u)
    plot = _equal(canvas, box, points @ right, points @ up, 1.25 * factor * largest)
    _draw_profiles(plot, cut, curves, factor)
    box = (170 * u, 850 * u, layout.width - 60 * u, layout.height - 100 * u)
    reach = rounded_up(largest)
    whole = sum(float(profile.length[-1]) for profile in cut.profiles)
    _draw_unrolled(Plot(canvas, box, (0.0, whole), (-reach, reach)), cut, curves)
    canvas.save(file)


@dataclass(frozen=True, eq=False)
class _Curve:
    """Deviation and standard uncertainty of one measurement along each piece of a section, in its colour."""

    colour: str
    pieces: list[tuple[Floats, Floats]]

    @property
    def largest(self) -> float:
        """Return how far the curve with its band reaches from zero, mm."""
        reach = np.hstack([np.abs(value) + COVERAGE * sigma for value, sigma in self.pieces])
        return float(np.nanmax(reach)) if np.isfinite(reach).any() else 0.0


def _draw_profiles(plot: Plot, cut: _Cut, curves: Sequence[_Curve], factor: float) -> None:
    right, up = cut.axes
    plot.draw_axes(_axis(right), _axis(up))
    plane = np.column_stack([right, up])
    normal = unit(np.array(cut.plane.normal))
    for position, profile in enumerate(cut.profiles):
        nominal = profile.points @ plane
        outward = factor * profile.normals(cut.record.nominal.mesh, normal) @ plane
        plot.line(nominal[:, 0], nominal[:, 1], INK, 1.6)
        for curve in curves:
            value, sigma = (each[:, None] for each in curve.pieces[position])
            low, high = nominal + (value - COVERAGE * sigma) * outward, nominal + (value + COVERAGE * sigma) * outward
            _fill(plot, low, high, curve.colour)
            curved = nominal + value * outward
            plot.line(curved[:, 0], curved[:, 1], curve.colour, 2.4)


def _draw_unrolled(plot: Plot, cut: _Cut, curves: Sequence[_Curve]) -> None:
    plot.draw_axes("Length along the profile, mm", "Deviation, mm")
    plot.line(np.array(plot.across), np.zeros(2), INK, 1.5)
    start = 0.0
    for position, profile in enumerate(cut.profiles):
        if position:
            plot.line(np.array([start, start]), np.array(plot.up), PALE, 1.2, ":")
        length = start + profile.length
        for curve in curves:
            value, sigma = curve.pieces[position]
            plot.band(length, value - COVERAGE * sigma, value + COVERAGE * sigma, curve.colour)
            plot.line(length, value, curve.colour, 2.2)
        start = float(length[-1])


def _equal(canvas: Canvas, box: tuple[float, float, float, float], x: Floats, y: Floats, margin: float) -> Plot:
    """Return a plot whose two scales are equal, so that a circle is one."""
    left, top, right, bottom = box
    low, high = np.array([x.min(), y.min()]) - margin, np.array([x.max(), y.max()]) + margin
    centre, span = (low + high) / 2, np.maximum(high - low, 1e-6)
    pixel = max(span[0] / (right - left), span[1] / (bottom - top))
    half = pixel * np.array([right - left, bottom - top]) / 2
    across, up = ((float(centre[k] - half[k]), float(centre[k] + half[k])) for k in range(2))
    return Plot(canvas, box, across, up)


def _fill(plot: Plot, inner: Floats, outer: Floats, colour: str) -> None:
    """Fill the band between two curves (k, 2) in the plane, run by run of what was measured."""
    shown = np.r_[False, np.isfinite(inner).all(axis=1), False].astype(np.int8)
    changes = np.diff(shown)
    for start, end in zip(np.flatnonzero(changes == 1), np.flatnonzero(changes == -1), strict=True):
        ring = np.vstack([inner[start:end], outer[start:end][::-1]])
        plot.canvas.axes.fill(plot.x(ring[:, 0]), plot.y(ring[:, 1]), color=colour, alpha=0.22, linewidth=0, zorder=1)


def _draw_key(canvas: Canvas, names: Sequence[str], colours: Sequence[str]) -> None:
    u = canvas.unit
    x, width = 170 * u, (canvas.width - 230 * u) / (len(names) + 1)
    for name, colour in [("CAD model", INK), *zip(names, colours, strict=True)]:
        canvas.line([x, x + 44 * u], [176 * u] * 2, width=4, color=colour)
        canvas.fitted(x + 56 * u, 176 * u, name, 25, width - 80 * u)
        x += width


def _axis(direction: Floats) -> str:
    k = int(np.abs(direction).argmax())
    if abs(direction[k]) > 0.9999:
        return f"{'−' if direction[k] < 0 else ''}{'xyz'[k]}, mm"
    return f"along ({', '.join(number(float(x), 2) for x in direction)}), mm"


def _words(plane: Section) -> str:
    point = ", ".join(number(x, 2) for x in plane.point)
    normal = ", ".join(number(float(x), 2) for x in unit(np.array(plane.normal, dtype=np.float64)))
    return f"plane through ({point}) mm, normal ({normal})"


def _sentence(cut: _Cut, part: MeasuredPart) -> str:
    if part.deviation is None:
        return ""
    value, sigma = np.hstack([profile.along(part.deviation) for profile in cut.profiles])
    seen = np.isfinite(value)
    if not seen.any():
        return f"{part.name}: nothing was measured along this section."
    low, high = int(np.nanargmin(value)), int(np.nanargmax(value))
    share = number(100 * float(seen.mean()), 0)
    ends = " to ".join(measured(float(value[k]), float(sigma[k])) for k in (low, high))
    return f"{part.name}: {ends} (± U, k = 2), {share} % of the profile measured."
