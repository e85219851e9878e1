"""The verdict of a node and the side on which it fails, as one of five classes."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.recipe import Part
from inspect3d.record import MeasuredPart


def bands(table: Part, mesh: InspectionMesh, part: MeasuredPart) -> Integers:
    """Return for each node, (n,), 1 too little, 2 undecided low, 3 conform, 4 undecided high, 5 too much; 0 for none.

    Low and high are told apart by the middle of the tolerance in force at the node.
    """
    if part.deviation is None or part.verdict is None:
        return np.zeros(len(mesh), dtype=np.int64)
    verdict = np.where(part.deviation.observed, part.verdict, 0)
    side = np.where(part.deviation.value < _middle(table, mesh), -1, 1)
    return np.where(verdict == 0, 0, 3 + side * (verdict - 1))


def _middle(table: Part, mesh: InspectionMesh) -> Floats:
    """Return the middle of the tolerance at each node, (n,) mm; 0 where there is none."""
    middle = np.full(len(mesh), sum(table.tolerance) / 2 if table.tolerance else 0.0)
    for region in table.regions:
        if region.tolerance is None:
            continue
        inside = np.ones(len(mesh), dtype=bool)
        if region.box is not None:
            inside &= ((mesh.nodes >= region.box[0]) & (mesh.nodes <= region.box[1])).all(axis=1)
        if region.faces is not None:
            inside &= np.isin(mesh.face, region.faces)
        middle[inside] = sum(region.tolerance) / 2
    return middle
