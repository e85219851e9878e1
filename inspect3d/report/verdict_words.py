"""The verdict on a measured part, in a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.record import MeasuredPart
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


def verdict_words(mesh: InspectionMesh, part: MeasuredPart) -> VerdictWords:
    """Return the verdict on the whole of what was measured, after the decision rule of ISO 14253-1.

    One node beyond doubt outside the tolerance decides against the part. Conformity is shown only where every node
    apart from the creases, which have no deviation, was measured and conforms.
    """
    if not part.status.has_map or part.deviation is None:
        return VerdictWords("none", "no result", "There is no map, so nothing has been shown.")
    if part.verdict is None:
        return VerdictWords("none", "no tolerance", "The recipe states no tolerance, so there is no verdict.")
    verdict, areas = np.asarray(part.verdict), mesh.areas
    whole = areas.sum() or 1.0

    def share(nodes: np.ndarray) -> str:
        percent = 100 * areas[nodes].sum() / whole
        return "less than 0.1 %" if percent < 0.1 else f"{number(percent, 1)} %"

    if (verdict == 3).any():
        words = f"{share(verdict == 3)} of the area lies outside the tolerance, its uncertainty considered."
        return VerdictWords("nonconform", "nonconform", words)
    unseen = ~part.deviation.observed & ~mesh.crease
    if (verdict == 2).any() or unseen.any():
        doubts = (
            [f"{share(verdict == 2)} of the area lies too near to a limit to decide"] if (verdict == 2).any() else []
        )
        doubts += [f"{share(unseen)} was not measured"] if unseen.any() else []
        words = f"Nothing lies outside the tolerance, but {' and '.join(doubts)}."
        return VerdictWords("undecided", "not shown to conform", words)
    return VerdictWords("conform", "conform", "All of the area lies within the tolerance, its uncertainty considered.")
