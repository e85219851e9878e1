"""The places of a part that are worst, whichever measurement found them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.compare.tolerances import tolerances
from inspect3d.record import Record
from inspect3d.report.digits import COVERAGE

MOST = 5
APART = 0.08
"""Share of the part's diagonal within which two nodes are the same place."""


@dataclass(frozen=True, eq=False)
class Place:
    """A place of the part.

    Parameters
    ----------
    node : of the inspection mesh
    finder : position, among the record's parts, of the measurement that found it worst
    """

    node: int
    finder: int


def worst_places(record: Record, most: int = MOST) -> tuple[Place, ...]:
    """Return the places farthest from where they should be, worst first, each found beyond its uncertainty.

    With a tolerance a place is as bad as it lies outside, or as near to a limit as it lies inside; without one, as far
    as it lies from the CAD model. In either case U (k = 2) counts in the part's favour, so that a noisy node does not
    pass for a defect; a place whose deviation does not exceed its U is none.
    """
    mesh, limits = record.nominal.mesh, tolerances(record.recipe.part, record.nominal.mesh)
    badness = np.full((len(record.parts), len(mesh)), -np.inf)
    for row, part in zip(badness, record.parts, strict=True):
        if part.status.has_map and part.deviation is not None:
            seen = part.deviation.observed
            row[seen] = _badness(part.deviation.value[seen], part.deviation.sigma[seen], _of(limits, seen))
    apart = APART * float(np.linalg.norm(np.ptp(mesh.nodes, axis=0)))
    found: list[Place] = []
    while len(found) < most and np.isfinite(badness).any():
        finder, node = np.unravel_index(int(badness.argmax()), badness.shape)
        found.append(Place(int(node), int(finder)))
        badness[:, np.linalg.norm(mesh.nodes - mesh.nodes[node], axis=1) < apart] = -np.inf
    return tuple(found)


def _badness(value: Floats, sigma: Floats, limits: Floats | None) -> Floats:
    favour = COVERAGE * sigma
    sure = np.abs(value) > favour
    if limits is None:
        return np.where(sure, np.abs(value) - favour, -np.inf)
    beyond = np.maximum(limits[:, 0] - value, value - limits[:, 1])
    return np.where(sure & np.isfinite(beyond), beyond - favour, -np.inf)


def _of(limits: Floats | None, nodes: np.ndarray) -> Floats | None:
    return None if limits is None else limits[nodes]
