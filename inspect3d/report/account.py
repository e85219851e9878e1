"""What the report says of one measurement: rounded figures and words, ready for the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from inspect3d.outcome import Status
from inspect3d.record import MeasuredPart, Record
from inspect3d.report.colours import BAND_COLOURS, UNMEASURED
from inspect3d.report.digits import COVERAGE, decimals, grouped, measured, number
from inspect3d.report.pose_words import PoseWords, advice, alignment_rows, motions, poses
from inspect3d.report.reading import Reading, readings
from inspect3d.report.uncertainty import Contribution, contributions
from inspect3d.report.verdict_words import verdict_words

Rows = list[tuple[str, str]]
VERDICTS = ("–", "conform", "undecided", "nonconform")
SHARE_COLOURS = (BAND_COLOURS[2], BAND_COLOURS[3], BAND_COLOURS[4], UNMEASURED)


@dataclass(frozen=True)
class Share:
    """A piece of the bar that shows how the area is judged."""

    percent: str
    colour: str
    words: str


@dataclass(frozen=True)
class LabelWords:
    """A row of the table of named points."""

    name: str
    point: str
    value: str
    verdict: str
    distance: str


@dataclass(frozen=True)
class Account:
    """One measurement, as the page shows it; empty where there is nothing to say.

    Parameters
    ----------
    name, method, provenance, status, reason, remarks : of the measurement; status in words
    anchor : the place on the page
    failed : there is no map
    noteworthy : the status belongs into the summary
    badge, badge_kind : the result in a word, and its colour
    advice : what to do about a failure
    verdict : on the tolerance, in a sentence
    row : figures of the summary
    tiles, statistics, alignment, motions : labels and figures
    origin : about which the motions are meant
    free : motions the points leave free
    hidden : motions that the pictures of a stereo method cannot tell
    """

    name: str
    method: str
    provenance: str
    status: str
    reason: str
    remarks: tuple[str, ...]
    anchor: str
    failed: bool
    noteworthy: bool
    badge: str
    badge_kind: str
    advice: str = ""
    verdict: str = ""
    row: list[str] = field(default_factory=list)
    shares: list[Share] = field(default_factory=list)
    tiles: Rows = field(default_factory=list)
    statistics: Rows = field(default_factory=list)
    alignment: Rows = field(default_factory=list)
    motions: Rows = field(default_factory=list)
    origin: str = ""
    free: tuple[str, ...] = ()
    hidden: tuple[str, ...] = ()
    poses: tuple[PoseWords, ...] = ()
    labels: list[LabelWords] = field(default_factory=list)
    uncertainty: tuple[Contribution, ...] = ()
    seconds: Rows = field(default_factory=list)
    pictures: list[Any] = field(default_factory=list)


def account(record: Record, part: MeasuredPart, values: Mapping[str, Any], anchor: str, pictures: list[Any]) -> Account:
    """Return what the report says of a measurement.

    Parameters
    ----------
    record : the inspection
    part : the measurement
    values : what results.json holds of it
    anchor : its place on the page
    pictures : as the template takes them
    """
    shared: dict[str, Any] = {
        "name": part.name,
        "method": part.method,
        "provenance": part.provenance,
        "status": part.status.words,
        "reason": part.reason,
        "remarks": part.remarks + tuple(remark for each in part.alignments for remark in each.remarks),
        "anchor": anchor,
        "noteworthy": part.status is not Status.OK,
        "poses": poses(part),
        "seconds": [(stage, number(seconds, 2)) for stage, seconds in part.seconds.items()],
        "pictures": pictures,
    }
    if not part.status.has_map or part.deviation is None:
        badge = part.status.value
        return Account(**shared, failed=True, badge=badge, badge_kind=badge, advice=advice(part))
    verdict = verdict_words(record, part)
    figures = _Figures(values["deviation"])
    first = part.alignments[0] if part.alignments else None
    judged = part.verdict is not None
    return Account(
        **shared,
        failed=False,
        badge=verdict.short if judged else "measured",
        badge_kind=verdict.kind,
        verdict=verdict.words if judged else "",
        row=figures.row(),
        shares=_shares(values["verdict"]),
        tiles=figures.tiles(part),
        statistics=figures.statistics(record, part),
        alignment=alignment_rows(part),
        motions=motions(first) if first else [],
        origin=", ".join(number(float(x), 2) for x in first.origin) if first else "",
        free=tuple(dict.fromkeys(free.words for each in part.alignments for free in each.free)),
        hidden=part.hidden,
        labels=[_label(each) for each in readings(record.nominal.mesh, part, record.recipe.report.labels)],
        uncertainty=contributions(record, part),
    )


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


def _shares(verdict: Mapping[str, float] | None) -> list[Share]:
    if verdict is None:
        return []
    return [
        Share(f"{100 * share:.3f}", f"rgb{colour}", f"{name} {number(100 * share, 1)} %")
        for (name, share), colour in zip(verdict.items(), SHARE_COLOURS, strict=True)
    ]


def _label(reading: Reading) -> LabelWords:
    point = ", ".join(number(float(x), 2) for x in reading.asked)
    if reading.node is None:
        return LabelWords(reading.name, point, "not measured", "–", "–")
    value = measured(reading.value, reading.sigma)
    return LabelWords(reading.name, point, value, VERDICTS[reading.verdict], f"{number(reading.distance, 2)} mm")
