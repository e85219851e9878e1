"""The report of an inspection, chapter by chapter, whatever file it becomes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np

from inspect3d.record import Record
from inspect3d.report.account import account
from inspect3d.report.blocks import Chapter, Document, Picture
from inspect3d.report.comparisons import agreement
from inspect3d.report.digits import grouped, number
from inspect3d.report.front import front
from inspect3d.report.pictures import Shown
from inspect3d.report.provenance import part_chapter, provenance_chapter, rule_chapter


def document(
    record: Record,
    values: Mapping[str, Any],
    shown: Mapping[str, tuple[Shown, ...]],
    moment: datetime,
    further: Sequence[Chapter] = (),
) -> Document:
    """Return the report.

    Parameters
    ----------
    record : the inspection
    values : what results.json holds
    shown : the pictures of each measurement, and under "" the one of the part
    moment : the date on the report
    further : chapters that follow those of the measurements
    """
    pictures = {name: [Picture(each.file, each.words) for each in found] for name, found in shown.items()}
    accounts = [
        account(record, part, values["measurements"][part.name], f"measurement-{k}", pictures.get(part.name, []))
        for k, part in enumerate(record.parts, start=1)
    ]
    chapters = (
        *(each.chapter for each in accounts),
        *further,
        part_chapter(record, _part_rows(record, values["part"]), pictures[""][0], "part"),
        rule_chapter(record, "rule"),
        provenance_chapter(record, "provenance"),
    )
    return Document(
        record.recipe.part.name, _under(record, moment), front(record, accounts, agreement(record)), chapters
    )


def _under(record: Record, moment: datetime) -> str:
    part = record.recipe.part
    words = [moment.strftime("%Y-%m-%d %H:%M %Z").strip(), f"CAD model {part.cad}", f"{_size(record)} mm"]
    if part.tolerance is not None:
        limits = " to ".join(f"{limit:+g}".replace("-", "−") for limit in part.tolerance)
        words.append(f"tolerance {limits} mm")
    return " · ".join(words)


def _size(record: Record) -> str:
    return " × ".join(number(float(length), 1) for length in np.ptp(record.nominal.mesh.nodes, axis=0))


def _part_rows(record: Record, values: Mapping[str, Any]) -> list[tuple[str, str]]:
    mesh = record.nominal.mesh
    return [
        ("size", f"{_size(record)} mm"),
        ("surface", f"{grouped(round(values['area']))} mm²"),
        ("nodes of the inspection mesh", grouped(len(mesh))),
        ("median edge of the inspection mesh", f"{number(values['edge_length'], 2)} mm"),
        ("nodes on edges sharper than 30°", grouped(int(np.count_nonzero(mesh.crease)))),
    ]
