"""The verdict of a node and the side on which it fails, as one of five classes."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Integers
from inspect3d.compare.tolerances import tolerances
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.recipe import Part
from inspect3d.record import MeasuredPart


def bands(table: Part, mesh: InspectionMesh, part: MeasuredPart) -> Integers:
    """Return for each node, (n,), 1 too little, 2 undecided low, 3 conform, 4 undecided high, 5 too much; 0 for none.

    Low and high are told apart by the middle of the tolerance of the node.
    """
    limits = tolerances(table, mesh)
    if part.deviation is None or part.verdict is None or limits is None:
        return np.zeros(len(mesh), dtype=np.int64)
    verdict = np.where(part.deviation.observed, part.verdict, 0)
    side = np.where(part.deviation.value < limits.mean(axis=1), -1, 1)
    return np.where(verdict == 0, 0, 3 + side * (verdict - 1))
