"""The verdict on a measured part, in a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from inspect3d.compare.tolerances import tolerances
from inspect3d.compare.verdict import NONCONFORM, UNDECIDED
from inspect3d.record import MeasuredPart, Record
from inspect3d.report.digits import number


@dataclass(frozen=True)
class VerdictWords:
    """What the tolerance says about a measurement.

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
    """Return the verdict on the whole of what has a tolerance, after the decision rule of ISO 14253-1.

    One node beyond doubt outside the tolerance decides against the part. Conformity is shown only where every node
    apart from the creases, which have no deviation, was measured and conforms.
    """
    if not part.status.has_map or part.deviation is None:
        return VerdictWords("none", "no result", "There is no map, so nothing has been shown.")
    mesh, limits = record.nominal.mesh, tolerances(record.recipe.part, record.nominal.mesh)
    if part.verdict is None or limits is None:
        return VerdictWords("none", "no tolerance", "The recipe states no tolerance, so there is no verdict.")
    verdict, judged = np.asarray(part.verdict), np.isfinite(limits).all(axis=1)
    whole = mesh.areas[judged].sum() or 1.0

    def share(nodes: np.ndarray) -> str:
        percent = 100 * mesh.areas[nodes].sum() / whole
        return "Less than 0.1 %" if percent < 0.1 else f"{number(percent, 1)} %"

    if (verdict == NONCONFORM).any():
        words = f"{share(verdict == NONCONFORM)} of the area lies outside the tolerance, its uncertainty considered."
        return VerdictWords("nonconform", "nonconform", words)
    undecided, unseen = verdict == UNDECIDED, judged & ~part.deviation.observed & ~mesh.crease
    if undecided.any() or unseen.any():
        doubts = ["Nothing lies outside the tolerance, but conformity has not been shown."]
        if undecided.any():
            doubts.append(f"{share(undecided)} of the area lies too near to a limit to decide.")
        if unseen.any():
            doubts.append(f"{share(unseen)} of the area, apart from edges, was not measured.")
        return VerdictWords("undecided", "not shown to conform", " ".join(doubts))
    return VerdictWords("conform", "conform", "All of the area lies within the tolerance, its uncertainty considered.")
