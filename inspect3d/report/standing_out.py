"""What stands out in a map: regions of deviation, and the features the recipe asks for."""

from __future__ import annotations

from collections.abc import Sequence

from inspect3d.compare.deviation_region import DeviationRegion
from inspect3d.compare.feature_estimate import FeatureEstimate
from inspect3d.record import MeasuredPart
from inspect3d.report.blocks import Block, Cell, Column, Heading, Paragraph, Table, numbers
from inspect3d.report.digits import COVERAGE, grouped, measured, number, significant

MOST = 12
"""Regions that are listed."""
LEAST = 0.001
"""Probability below which the draws of the test do not tell how small it is."""


def region_table(regions: Sequence[DeviationRegion]) -> list[Block]:
    """Return the regions as a table, the first of them where there are many; nothing where there are none."""
    if not regions:
        return []
    tested = any(region.p_value is not None for region in regions)
    last = "Probability by chance" if tested else "Mean over its uncertainty"
    head = ("Region at (x, y, z), mm", "Area, mm²", "Largest, µm", "Mean ± U (k = 2), µm", last)
    rows = tuple(_region(region, tested) for region in regions[:MOST])
    blocks: list[Block] = [Table(head, rows, ("text", "number", "number", "number", "number"))]
    if len(regions) > MOST:
        blocks.append(Paragraph(f"{grouped(len(regions) - MOST)} more are in results.json."))
    return blocks


def standing_out(part: MeasuredPart) -> list[Block]:
    """Return the regions and features of a measurement."""
    blocks: list[Block] = []
    if part.regions:
        blocks += [Heading("Regions that stand out"), *region_table(part.regions)]
    if part.features:
        rows = tuple(_feature(feature) for feature in part.features)
        head = ("Feature", "Kind", "Size ± U (k = 2)", "Spacing of the readings", "Remark")
        blocks += [Heading("Features"), Table(head, rows, ("name", "text", "number", "number", "text"))]
    return blocks


def resolved(parts: Sequence[MeasuredPart]) -> list[Block]:
    """Return which method resolved which feature, and how large it found it; nothing where no feature was asked for."""
    measuring = [part for part in parts if part.features]
    if len(measuring) < 2:
        return []
    names = list(dict.fromkeys((each.name, each.kind) for part in measuring for each in part.features))
    found = [{(each.name, each.kind): each for each in part.features} for part in measuring]
    rows = tuple((name, kind, *(_size(each.get((name, kind))) for each in found)) for name, kind in names)
    head = ("Feature ± U (k = 2)", "Kind", *(part.name for part in measuring))
    columns: list[Column] = ["name", "text", *numbers(len(measuring))]
    return [Heading("Which method resolved what"), Table(head, rows, tuple(columns))]


def _region(region: DeviationRegion, tested: bool) -> tuple[Cell, ...]:
    place = ", ".join(number(float(x), 1) for x in region.place)
    mean = _micro(region.mean) if region.sigma is None else measured(1000 * region.mean, 1000 * region.sigma, "")
    last = significant(region.p_value if tested else region.significance, 2)
    if region.p_value is not None and region.p_value < LEAST:
        last = f"< {LEAST:g}"
    return (place, number(region.area, 1), _micro(region.height), mean, last)


def _feature(feature: FeatureEstimate) -> tuple[Cell, ...]:
    spacing = f"{significant(feature.spacing, 2)} mm"
    remark = feature.reason or f"from {grouped(feature.count)} {feature.source}"
    return (feature.name or "–", feature.kind, _size(feature), spacing, remark)


def _size(feature: FeatureEstimate | None) -> str:
    if feature is None:
        return "–"
    if feature.value is None or feature.sigma is None:
        return "not resolved"
    size = f"{_micro(feature.value)} ± {number(1000 * COVERAGE * feature.sigma, 1)} µm"
    return size if feature.resolved else f"not resolved ({size})"


def _micro(length: float) -> str:
    return number(1000 * length, 1, sign=True)
