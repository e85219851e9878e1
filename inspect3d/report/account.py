"""What the report says of one measurement: rounded figures and words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.record import MeasuredPart, Record
from inspect3d.report.blocks import (
    Badge,
    Beside,
    Block,
    Bullets,
    Chapter,
    Code,
    Folded,
    Heading,
    Note,
    Paragraph,
    Picture,
    Share,
    Shares,
    Table,
    Tiles,
    table_of,
)
from inspect3d.report.colours import BAND_COLOURS, UNMEASURED
from inspect3d.report.digits import COVERAGE, decimals, grouped, measured, number, significant
from inspect3d.report.pose_words import advice, alignment_rows, motions, poses
from inspect3d.report.reading import Reading, readings
from inspect3d.report.standing_out import standing_out
from inspect3d.report.uncertainty import contributions
from inspect3d.report.verdict_words import verdict_words

Rows = list[tuple[str, str]]
VERDICTS = ("–", "conform", "undecided", "nonconform")
SHARE_WORDS = {"unmeasured": "not measured, edges counted"}
SHARE_COLOURS = (BAND_COLOURS[2], BAND_COLOURS[3], BAND_COLOURS[4], UNMEASURED)


@dataclass(frozen=True)
class Account:
    """One measurement as the report shows it.

    Parameters
    ----------
    part : the measurement
    badge : its result in a word
    row : its figures in the table at the head of the report; empty where there is no map
    verdict : on the tolerance, in a sentence
    chapter : all there is to say
    """

    part: MeasuredPart
    badge: Badge
    row: tuple[str, ...]
    verdict: str
    chapter: Chapter


def account(
    record: Record, part: MeasuredPart, values: Mapping[str, Any], anchor: str, pictures: Sequence[Picture]
) -> Account:
    """Return what the report says of a measurement.

    Parameters
    ----------
    record : the inspection
    part : the measurement
    values : what results.json holds of it
    anchor : its place in the report
    pictures : of it
    """
    remarks = part.remarks + tuple(remark for each in part.alignments for remark in each.remarks)
    shown: list[Block] = [Bullets(remarks)] if remarks else []
    shown += pictures
    if not part.status.has_map or part.deviation is None:
        badge = Badge(part.status.value, part.status.value)
        lines = tuple(words for words in (part.reason, advice(part)) if words)
        blocks = (Note(part.status.words, lines, "bad"), *shown, *_poses(part), *_provenance(part))
        return Account(part, badge, (), "", Chapter(anchor, part.name, blocks, badge))
    verdict, figures = verdict_words(record, part), _Figures(values["deviation"])
    judged = part.verdict is not None
    badge = Badge(verdict.short, verdict.kind) if judged else Badge("measured", "none")
    blocks = (
        Paragraph(f"{part.status.words} {part.reason}".strip()),
        *([Paragraph(verdict.words, "Verdict.")] if judged else []),
        *_shares(values["verdict"]),
        Tiles(tuple(figures.tiles(part))),
        *shown,
        *standing_out(part),
        *_labels(readings(record.nominal.mesh, part, record.recipe.report.labels)),
        *_statistics(record, part, figures),
        *_poses(part),
        *_pose_uncertainty(part),
        *_choice(part),
        *_hidden(part),
        *_budget(record, part),
        *_provenance(part),
    )
    words = verdict.words if judged else ""
    return Account(part, badge, tuple(figures.row()), words, Chapter(anchor, part.name, blocks, badge))


@dataclass(frozen=True)
class _Figures:
    """The figures of a deviation, at the digits its uncertainty warrants."""

    values: Mapping[str, Any]

    @property
    def places(self) -> int:
        sigma = self.values["sigma_p50"]
        return min(decimals(COVERAGE * sigma), 4) if sigma else 3

    def of(self, name: str, unit: str = "") -> str:
        signed = name in ("mean", "min", "max", "p05", "p50", "p95")
        return number(self.values[name], self.places, sign=signed) + unit

    def expanded(self) -> str:
        sigma = self.values["sigma_p50"]
        return number(COVERAGE * sigma if sigma else None, self.places)

    def area(self) -> str:
        return f"{number(100 * self.values['observed_area'], 1)} %"

    def row(self) -> list[str]:
        return [*(self.of(name) for name in ("mean", "std", "min", "max")), self.expanded(), self.area()]

    def tiles(self, part: MeasuredPart) -> Rows:
        return [
            ("mean deviation", self.of("mean", " mm")),
            ("standard deviation over the area", self.of("std", " mm")),
            ("most material ± U", _extreme(part, np.nanargmax)),
            ("least material ± U", _extreme(part, np.nanargmin)),
            ("U of a node (k = 2), median", f"{self.expanded()} mm"),
            ("of the area measured", self.area()),
        ]

    def statistics(self, record: Record, part: MeasuredPart) -> Rows:
        names = {"mean": "mean", "std": "standard deviation", "rms": "root mean square", "min": "minimum",
                 "p05": "5 % of the area lie below", "p50": "median", "p95": "95 % of the area lie below",
                 "max": "maximum"}  # fmt: skip
        creases = int(np.count_nonzero(record.nominal.mesh.crease))
        observed, nodes = self.values["observed"], self.values["nodes"]
        return [
            *((words, self.of(name, " mm")) for name, words in names.items()),
            ("nodes measured", f"{grouped(observed)} of {grouped(nodes)}"),
            ("nodes on edges, which have no deviation", grouped(creases)),
        ]


def _extreme(part: MeasuredPart, position: Any) -> str:
    if part.deviation is None or not part.deviation.observed.any():
        return "–"
    node = int(position(part.deviation.value))
    return measured(float(part.deviation.value[node]), float(part.deviation.sigma[node]))


def _shares(verdict: Mapping[str, float] | None) -> list[Block]:
    if verdict is None:
        return []
    shares = [
        Share(100 * share, colour, f"{SHARE_WORDS.get(name, name)} {number(100 * share, 1)} %")
        for (name, share), colour in zip(verdict.items(), SHARE_COLOURS, strict=True)
    ]
    return [Shares(tuple(shares))]


def _labels(found: Sequence[Reading]) -> list[Block]:
    if not found:
        return []
    head = ("Name", "Point, mm", "Deviation ± U (k = 2)", "Verdict", "Distance to the node read")
    rows = tuple(_label(each) for each in found)
    return [Heading("Named points"), Table(head, rows, ("name", "text", "number", "text", "number"))]


def _label(reading: Reading) -> tuple[str, ...]:
    point = ", ".join(number(float(x), 2) for x in reading.asked)
    if reading.node is None:
        return (reading.name, point, "not measured", "–", "–")
    value = measured(reading.value, reading.sigma)
    return (reading.name, point, value, VERDICTS[reading.verdict], f"{number(reading.distance, 2)} mm")


def _statistics(record: Record, part: MeasuredPart, figures: _Figures) -> list[Block]:
    statistics = (Heading("Statistics of the deviation"), table_of(figures.statistics(record, part)))
    rows = alignment_rows(part)
    blocks: list[Block] = [Beside(statistics, (Heading("Alignment"), table_of(rows)))] if rows else list(statistics)
    words = "The points do not determine it; it was held where the alignment started, and its covariance is zero."
    free = dict.fromkeys(free.words for each in part.alignments for free in each.free)
    return blocks + [Note("Free motion:", (f"{motion}. {words}",)) for motion in free]


def _poses(part: MeasuredPart) -> list[Block]:
    failed = not part.status.has_map
    return [Folded(pose.title, (Code(pose.matrix),), failed) for pose in poses(part)]


def _pose_uncertainty(part: MeasuredPart) -> list[Block]:
    if not part.alignments:
        return []
    first = part.alignments[0]
    origin = ", ".join(number(float(x), 2) for x in first.origin)
    words = f"Standard uncertainties of a small motion applied after the alignment, about ({origin}) mm."
    return [Folded("Uncertainty of the pose", (Paragraph(words), table_of(motions(first))))]


def _choice(part: MeasuredPart) -> list[Block]:
    """Say what another choice of the alignment would change."""
    found = part.sensitivity
    if found is None:
        return []
    blocks: list[Block] = [
        Heading("Choice of the alignment"),
        Paragraph(
            f"The map is aligned by {found.chosen}. The uncertainty of that pose alone moves a node by up to "
            f"{_micro(COVERAGE * float(found.within.max()))} (U, k = 2)."
        ),
    ]
    if found.others:
        rows = tuple(
            (other.words, _micro(float(np.abs(other.shift).max())), *_moved(other.motion)) for other in found.others
        )
        head = ("Instead by", "Largest change of a deviation", "Turn", "Shift")
        blocks.append(Table(head, rows, ("text", "number", "number", "number")))
    return blocks + ([Bullets(found.remarks)] if found.remarks else [])


def _moved(motion: Floats) -> tuple[str, str]:
    turn, shift = float(np.linalg.norm(motion[:3])), float(np.linalg.norm(motion[3:]))
    return f"{significant(float(np.degrees(turn)), 2)}°", _micro(shift)


def _micro(length: float) -> str:
    return f"{significant(1000 * length, 3)} µm"


def _hidden(part: MeasuredPart) -> list[Block]:
    if not part.hidden:
        return []
    words = (
        "A change of the cameras makes up for these motions of the surface. Those without a size are taken out of the "
        "map; the others are in its uncertainty."
    )
    return [Heading("What the pictures cannot tell"), Paragraph(words), Bullets(part.hidden)]


def _budget(record: Record, part: MeasuredPart) -> list[Block]:
    found = contributions(record, part)
    if not found:
        return []
    rows = tuple((each.source, each.figure, each.words) for each in found)
    table = Table(("Source", "Size", "How it enters"), rows, ("text", "figure", "text"))
    return [Heading("Uncertainty"), table]


def _provenance(part: MeasuredPart) -> list[Block]:
    seconds = " · ".join(f"{stage} {number(each, 1 if each > 1 else 2)} s" for stage, each in part.seconds.items())
    blocks: list[Block] = [Heading("How it was measured"), Code(part.provenance)]
    return blocks + ([Paragraph(seconds)] if seconds else [])
