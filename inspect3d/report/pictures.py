"""All the pictures of an inspection."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.deviate.statistics import Statistics
from inspect3d.progress import Progress
from inspect3d.record import MeasuredPart, Record
from inspect3d.report.bands import bands
from inspect3d.report.colours import (
    ColourScale,
    band_scale,
    rising_limits,
    rising_scale,
)
from inspect3d.report.digits import COVERAGE, decimals, number
from inspect3d.report.figures import draw_figure
from inspect3d.report.histogram import draw_histogram
from inspect3d.report.layout import Layout
from inspect3d.report.map_scale import map_scale
from inspect3d.report.picture import Caption, Picture
from inspect3d.report.reading import readings
from inspect3d.report.viewpoint import Viewpoint
from inspect3d.report.views import Views

SIZE = (1600, 1200)
JUDGED = 2
"""Pictures of the tolerance bands: the first of the viewpoints."""


@dataclass(frozen=True, eq=False)
class Shown:
    """A picture in the report: its file in the folder `pictures`, what it shows, and from where."""

    file: str
    words: str
    viewpoint: Viewpoint | None = None


def draw_pictures(record: Record, folder: Path, views: Views, progress: Progress) -> dict[str, tuple[Shown, ...]]:
    """Write all pictures as PNG.

    Parameters
    ----------
    record : the inspection
    folder : where they go; exists
    views : of the inspection mesh
    progress : told how far it is

    Returns
    -------
    for each measurement its pictures in the report's order, and under "" the one of the part
    """
    shown: dict[str, tuple[Shown, ...]] = {"": (_draw_part(record, folder, views),)}
    with_map = [part for part in record.parts if part.status.has_map and part.deviation is not None]
    for k, part in enumerate(with_map):
        progress.update((k + 0.3) / (len(with_map) + 0.3))
        shown[part.name] = tuple(_draw_measurement(record, part, folder, views))
    progress.update(1.0)
    return shown


def start(shown: Mapping[str, tuple[Shown, ...]]) -> Viewpoint:
    """Return the viewpoint of the first picture of a measurement."""
    found = (each.viewpoint for name, pictures in shown.items() if name for each in pictures if each.viewpoint)
    return next(found, Viewpoint.of("iso"))


def sigma_scale(record: Record, part: MeasuredPart) -> ColourScale:
    """Return the colours of a map of standard uncertainties."""
    if part.deviation is None:
        return rising_scale("Uncertainty", "mm", (0.0, 1.0))
    observed = part.deviation.observed
    limits = rising_limits(part.deviation.sigma[observed], record.nominal.mesh.areas[observed])
    return rising_scale("Uncertainty", "mm", limits)


def spread_scale(record: Record, part: MeasuredPart) -> ColourScale:
    """Return the colours of a map of what the choice of the alignment changes."""
    if part.sensitivity is None:
        return rising_scale("Change", "mm", (0.0, 1.0))
    limits = rising_limits(part.sensitivity.spread, record.nominal.mesh.areas)
    return replace(rising_scale("Change", "mm", limits), rest="none")


def _draw_part(record: Record, folder: Path, views: Views) -> Shown:
    mesh = record.nominal.mesh
    maps = [part.deviation for part in record.parts if part.deviation is not None]
    measured = np.any([found.observed for found in maps], axis=0) if maps else np.zeros(len(mesh), bool)
    viewpoint = views.overview(np.where(measured, mesh.areas, 0.0) if measured.any() else mesh.areas)
    size = " × ".join(number(length, 1) for length in np.ptp(mesh.nodes, axis=0))
    edge = number(mesh.edge_length, 2)
    caption = Caption(
        record.recipe.part.name, f"The part as designed, {size} mm", f"{len(mesh)} nodes, {edge} mm apart"
    )
    picture = Picture(mesh, Layout(*SIZE), caption)
    with views.window(np.full(len(mesh), np.nan), None, picture.layout.window) as window:
        picture.taken(window, viewpoint).save(folder / "part.png")
    fewer = f"; pictures show {views.drawn.words}" if views.drawn.words else ""
    return Shown("part.png", f"The part as designed{fewer}", viewpoint)


def _draw_measurement(record: Record, part: MeasuredPart, folder: Path, views: Views) -> list[Shown]:
    mesh, table = record.nominal.mesh, record.recipe.part
    if part.deviation is None:
        return []
    deviation = part.deviation
    flagged = readings(mesh, part, record.recipe.report.labels)
    nodes = [reading.node for reading in flagged if reading.node is not None]
    viewpoints = views.showing(deviation.observed, mesh.areas, nodes)
    layout = Layout(*SIZE, flags=bool(nodes))
    figures = _figures(record, part)

    def pictures(
        field: str, words: str, values: Floats, scale: ColourScale, chosen: tuple[Viewpoint, ...]
    ) -> list[Shown]:
        caption = Caption(table.name, f"{part.name}: {words[0].lower()}{words[1:]}", figures)
        picture = Picture(mesh, layout, caption, scale, flagged, table.tolerance if field == "deviation" else None)
        shown = []
        with views.window(values, scale, layout.window) as window:
            for k, viewpoint in enumerate(chosen, start=1):
                file = f"{part.name}_{field}_{k}.png"
                picture.taken(window, viewpoint).save(folder / file)
                shown.append(Shown(file, f"{words}, seen from {viewpoint.words}", viewpoint))
        return shown

    scale = map_scale(record)
    shown = pictures("deviation", "Deviation from the CAD model", deviation.value, scale, viewpoints)
    if part.verdict is not None:
        classes = np.where(bands(table, mesh, part) == 0, np.nan, bands(table, mesh, part))
        shown += pictures("tolerance", "Verdict of the tolerance", classes, band_scale(), viewpoints[:JUDGED])
    words = "Standard uncertainty of the deviation (k = 1)"
    shown += pictures("sigma", words, deviation.sigma, sigma_scale(record, part), viewpoints[:1])
    values, areas = _observed(record, part)
    if areas.sum() > 0:
        caption = Caption(table.name, f"{part.name}: how the measured area is spread over the deviations", figures)
        file = f"{part.name}_histogram.png"
        draw_histogram(folder / file, values, areas, scale, caption, table.tolerance, Layout(*SIZE))
        shown.append(Shown(file, "Histogram of the deviations"))
    if part.residual is not None:
        values = np.where(deviation.observed, part.residual, np.nan)
        scale = rising_scale("Residual", "", rising_limits(values[deviation.observed], mesh.areas[deviation.observed]))
        shown += pictures("residual", "Grey-level residual, normalised", values, scale, viewpoints[:1])
    if part.sensitivity is not None and part.sensitivity.others:
        words = "Change of the deviation between the choices of the alignment"
        shown += pictures("alignment", words, part.sensitivity.spread, spread_scale(record, part), viewpoints[:1])
    for figure in part.figures:
        file = f"{part.name}_{figure.name}.png"
        draw_figure(folder / file, figure, table.name, part.name, Layout(*SIZE))
        shown.append(Shown(file, figure.words))
    return shown


def _observed(record: Record, part: MeasuredPart) -> tuple[Floats, Floats]:
    """Return deviations and areas of the observed nodes."""
    if part.deviation is None:
        return np.empty(0), np.empty(0)
    observed = part.deviation.observed
    return part.deviation.value[observed], record.nominal.mesh.areas[observed]


def _figures(record: Record, part: MeasuredPart) -> str:
    values, areas = _observed(record, part)
    if part.deviation is None or not areas.sum() > 0:
        return "Nothing was measured."
    figures = Statistics.of(values, areas)
    expanded = COVERAGE * float(np.median(part.deviation.sigma[part.deviation.observed]))
    places = min(decimals(expanded), 4)
    share = 100 * areas.sum() / record.nominal.mesh.areas.sum()
    return (
        f"mean {number(figures.mean, places, True)} · std {number(figures.std, places)} · "
        f"min {number(figures.min, places, True)} · max {number(figures.max, places, True)} mm · "
        f"median U (k = 2) {number(expanded, places)} mm · area measured {number(share, 1)} %"
    )
