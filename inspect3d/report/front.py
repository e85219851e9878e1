"""The head of a report: the verdict, how each measurement ended, the worst places, and how far the methods agree."""

from __future__ import annotations

from collections.abc import Sequence

from inspect3d.outcome import Status
from inspect3d.record import Record
from inspect3d.report.account import VERDICTS, Account
from inspect3d.report.blocks import (
    Badge,
    Block,
    Cell,
    Chapter,
    Column,
    Heading,
    Judgement,
    Link,
    Note,
    Paragraph,
    Table,
    numbers,
)
from inspect3d.report.digits import measured, number
from inspect3d.report.verdict_words import whole_verdict
from inspect3d.report.worst import Place, worst_places

FIGURES = ("Mean, mm", "Std, mm", "Min, mm", "Max, mm", "U (k = 2), mm", "Measured area")
MEANING = (
    "A deviation is the signed distance from the CAD model to the measured surface along the model's outward normal; "
    "positive is too much material. U is the expanded uncertainty of one node (k = 2, about 95 %), its median over the "
    "measured nodes; figures are weighted by area."
)


def front(record: Record, accounts: Sequence[Account], agreement: Sequence[Block]) -> Chapter:
    """Return what a reader sees first.

    Parameters
    ----------
    record : the inspection
    accounts : of its measurements
    agreement : how far the methods agree; empty where there are no two maps
    """
    verdict = whole_verdict(record)
    blocks: list[Block] = [Judgement(Badge(verdict.short, verdict.kind), verdict.words)]
    columns: list[Column] = ["name", "text", "text", *numbers(len(FIGURES))]
    head = ("Measurement", "Method", "Result", *FIGURES)
    blocks.append(Table(head, tuple(_row(each) for each in accounts), tuple(columns)))
    for each in accounts:
        words = [each.verdict] if each.verdict and each.verdict != verdict.words else []
        words += [each.part.status.words] if each.row and each.part.status is not Status.OK else []
        words += [each.part.reason] if not each.row else []
        blocks += [Paragraph(" ".join(words), f"{each.part.name}:")] if words else []
    blocks += _worst(record)
    blocks += [Heading("Agreement of the methods"), *agreement] if agreement else []
    blocks += [Note("Please note", tuple(record.warnings))] if record.warnings else []
    blocks.append(Paragraph(MEANING))
    return Chapter("summary", "Summary", tuple(blocks))


def _row(each: Account) -> tuple[Cell, ...]:
    figures = each.row or ("–",) * len(FIGURES)
    return (Link(each.part.name, each.chapter.anchor), each.part.method, each.badge, *figures)


def _worst(record: Record) -> list[Block]:
    places = worst_places(record)
    if not any(part.deviation is not None for part in record.parts):
        return []
    title = Heading("Worst places: deviation ± U (k = 2)")
    if not places:
        return [title, Paragraph("No measured node deviates by more than its expanded uncertainty U (k = 2).")]
    parts = [part for part in record.parts if part.status.has_map and part.deviation is not None]
    judged = any(part.verdict is not None for part in parts)
    names = (f"{part.name}, mm" for part in parts)
    head = ("Place (x, y, z), mm", "Found by", *(["Verdict"] if judged else []), *names)
    columns: list[Column] = ["text", "name", *numbers(len(parts))]
    if judged:
        columns.insert(2, "text")
    return [title, Table(head, tuple(_place(record, place, judged) for place in places), tuple(columns))]


def _place(record: Record, place: Place, judged: bool) -> tuple[Cell, ...]:
    finder = record.parts[place.finder]
    position = ", ".join(number(float(x), 1) for x in record.nominal.mesh.nodes[place.node])
    verdict = [] if not judged else [VERDICTS[0 if finder.verdict is None else int(finder.verdict[place.node])]]
    values = [
        measured(float(part.deviation.value[place.node]), float(part.deviation.sigma[place.node]), unit="")
        for part in record.parts
        if part.status.has_map and part.deviation is not None
    ]
    return (position, finder.name, *verdict, *values)
