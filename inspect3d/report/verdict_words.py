"""The verdict on a part, in a sentence: by one measurement, and by all together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.compare.tolerances import tolerances
from inspect3d.compare.verdict import CONFORM, NONCONFORM, NONE, UNDECIDED
from inspect3d.record import MeasuredPart, Record
from inspect3d.report.digits import number


@dataclass(frozen=True)
class VerdictWords:
    """What the tolerance says about a part.

    Parameters
    ----------
    kind : the colour of the badge
    short : a word or two
    words : a sentence
    """

    kind: Literal["conform", "undecided", "nonconform", "none"]
    short: str
    words: str


def verdict_words(record: Record, part: MeasuredPart) -> VerdictWords:
    """Return the verdict of one measurement on the whole of what has a tolerance."""
    return _verdict(record, [part])


def whole_verdict(record: Record) -> VerdictWords:
    """Return the verdict of all measurements together.

    A node that one of them finds nonconform is; one that none does conforms where one of them shows it.
    """
    found = _verdict(record, record.parts)
    judged = [part for part in record.parts if part.status.has_map and part.verdict is not None]
    failing = [part.name for part in judged if (np.asarray(part.verdict) == NONCONFORM).any()]
    if not failing or len(judged) < 2:
        return found
    verdicts = np.stack([np.asarray(part.verdict) for part in judged])
    torn = (verdicts == NONCONFORM).any(axis=0) & (verdicts == CONFORM).any(axis=0)
    words = f"{found.words} Found nonconform by {_listed(failing)}."
    if torn.any():
        share = _share(record.nominal.mesh.areas, torn, record.nominal.mesh.areas.sum())
        words += f" {share} of the area is nonconform by one measurement and conform by another: one of them is wrong."
    return VerdictWords(found.kind, found.short, words)


def _verdict(record: Record, parts: Sequence[MeasuredPart]) -> VerdictWords:
    """Return the verdict after the decision rule of ISO 14253-1.

    One node beyond doubt outside the tolerance decides against the part. Conformity is shown only where every node
    apart from the creases, which have no deviation, was measured and conforms.
    """
    mesh, limits = record.nominal.mesh, tolerances(record.recipe.part, record.nominal.mesh)
    with_map = [part for part in parts if part.status.has_map and part.deviation is not None]
    if not with_map:
        return VerdictWords("none", "no result", "There is no map, so nothing has been shown.")
    verdicts = [np.asarray(part.verdict) for part in with_map if part.verdict is not None]
    if not verdicts or limits is None:
        return VerdictWords("none", "no tolerance", "The recipe states no tolerance, so there is no verdict.")
    verdict, judged = _together(np.stack(verdicts)), np.isfinite(limits).all(axis=1)
    whole = mesh.areas[judged].sum() or 1.0
    undecided, unseen = verdict == UNDECIDED, judged & (verdict == NONE) & ~mesh.crease
    doubts = []
    if undecided.any():
        doubts.append(f"{_share(mesh.areas, undecided, whole)} of the area lies too near to a limit to decide.")
    if unseen.any():
        doubts.append(f"{_share(mesh.areas, unseen, whole)} of the area, edges not counted, was not measured.")
    if (verdict == NONCONFORM).any():
        share = _share(mesh.areas, verdict == NONCONFORM, whole)
        words = f"{share} of the area lies outside the tolerance, its uncertainty considered."
        return VerdictWords("nonconform", "nonconform", " ".join([words, *doubts]))
    if doubts:
        words = "Nothing lies outside the tolerance, but conformity has not been shown."
        return VerdictWords("undecided", "not shown to conform", " ".join([words, *doubts]))
    return VerdictWords("conform", "conform", "All of the area lies within the tolerance, its uncertainty considered.")


def _together(verdicts: Integers) -> Integers:
    """Return the verdict (n,) of several (k, n): nonconform before conform before undecided before none."""
    order = np.array([0, 2, 1, 3])
    return np.argsort(order)[order[verdicts].max(axis=0)]


def _share(areas: Floats, nodes: Booleans, whole: float) -> str:
    percent = 100 * float(areas[nodes].sum()) / whole
    return "Less than 0.1 %" if percent < 0.1 else f"{number(percent, 1)} %"


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
