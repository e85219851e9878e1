"""The deviation at a named point of the recipe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.recipe import Label
from inspect3d.record import MeasuredPart

NEAR = 2.0
"""Edge lengths of the mesh within which a node speaks for a named point."""
ALIKE = 0.5
"""Cosine between normals that belong to the same side of a wall."""


@dataclass(frozen=True, eq=False)
class Reading:
    """What the map says at a named point.

    Parameters
    ----------
    name : of the label
    asked : (3,) mm, where the recipe puts it
    node : the nearest observed node, or None where there is none within two edge lengths
    position : (3,) mm, of that node; of the asked point where there is none
    value, sigma : deviation and standard uncertainty there, mm; NaN where there is no node
    verdict : 0 none, 1 conform, 2 undecided, 3 nonconform
    """

    name: str
    asked: Floats
    node: int | None
    position: Floats
    value: float
    sigma: float
    verdict: int

    @property
    def distance(self) -> float:
        """Return how far the node lies from the asked point, mm."""
        return float(np.linalg.norm(self.position - self.asked))


def readings(mesh: InspectionMesh, part: MeasuredPart, labels: Sequence[Label]) -> tuple[Reading, ...]:
    """Return what the map of a measurement says at each label; nothing where it has no map.

    The other side of a thin wall may be nearer than the next observed node, but does not speak for the label: a node
    that does has a normal within 60 degrees of that of the node nearest to the label, observed or not.
    """
    if part.deviation is None:
        return ()
    verdict = np.zeros(len(mesh), dtype=np.int64) if part.verdict is None else part.verdict
    found = []
    for label in labels:
        asked = np.array(label.point, dtype=np.float64)
        distance = np.linalg.norm(mesh.nodes - asked, axis=1)
        alike = mesh.normals @ mesh.normals[distance.argmin()] > ALIKE
        distance[~(alike & part.deviation.observed)] = np.inf
        if distance.min() > NEAR * mesh.edge_length:
            found.append(Reading(label.name, asked, None, asked, np.nan, np.nan, 0))
            continue
        node = int(distance.argmin())
        value, sigma = float(part.deviation.value[node]), float(part.deviation.sigma[node])
        found.append(Reading(label.name, asked, node, mesh.nodes[node], value, sigma, int(verdict[node])))
    return tuple(found)
