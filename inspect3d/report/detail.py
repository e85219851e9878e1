"""A part with fewer nodes, for a view on a screen: what is left out is between the nodes that stay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Integers
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.report.digits import grouped, number

MOST = 65_535
"""Nodes that a view holds: two bytes number them."""


@dataclass(frozen=True, eq=False)
class Detail:
    """Some of the nodes of a mesh and the triangles between them.

    Parameters
    ----------
    nodes : (k,) numbers of the nodes that stay
    place : (n,) for each node of the mesh, the place in `nodes` of the one that stands for it
    triangles : (m, 3) places in `nodes`
    words : how many nodes stay, such as "1 000 of 9 000 nodes, about 2 mm apart"; empty where all do
    """

    nodes: Integers
    place: Integers
    triangles: Integers
    words: str = ""

    @classmethod
    def of(cls, mesh: InspectionMesh, kept: Sequence[int] = (), most: int = MOST) -> Detail:
        """Return a mesh with no more than so many nodes; `kept` nodes stay.

        Nodes are gathered in the cells of a cubic grid, those that face different ways or lie on an edge apart, and
        the node nearest to the middle of each gathering stays, so that every value shown is one of the map.

        Notes
        -----
        J. Rossignac, P. Borrel, "Multi-resolution 3D approximations for rendering complex scenes" (1993).
        """
        if len(mesh) <= most:
            return cls(np.arange(len(mesh)), np.arange(len(mesh)), mesh.triangles)
        size = np.sqrt(mesh.areas.sum() / most)
        while True:
            place = _gathered(mesh, size)
            if place.max() < most:
                break
            size *= 1.08
        nodes = _middles(mesh, place, np.asarray(kept, dtype=np.int64))
        words = f"{grouped(len(nodes))} of {grouped(len(mesh))} nodes, about {number(size, 2)} mm apart"
        return cls(nodes, place, distinct(place[mesh.triangles]), words)


def distinct(corners: Integers) -> Integers:
    """Return the lines or triangles (m, c) whose corners differ, each once, in their order around."""
    ordered = np.sort(corners, axis=1)
    corners, ordered = (each[(np.diff(ordered, axis=1) > 0).all(axis=1)] for each in (corners, ordered))
    count = int(corners.max()) + 1 if len(corners) else 1
    key = np.zeros(len(ordered), dtype=np.int64)
    for column in ordered.T:
        key = key * count + column
    return corners[np.unique(key, return_index=True)[1]]


def _gathered(mesh: InspectionMesh, size: float) -> Integers:
    """Return for each node, (n,), the number of its gathering."""
    cell = ((mesh.nodes - mesh.nodes.min(axis=0)) / size).astype(np.int64)
    axis = np.abs(mesh.normals).argmax(axis=1)
    side = 2 * axis + (mesh.normals[np.arange(len(mesh)), axis] > 0) + 6 * mesh.crease
    spans = cell.max(axis=0) + 1
    key = ((cell[:, 0] * spans[1] + cell[:, 1]) * spans[2] + cell[:, 2]) * 12 + side
    return np.unique(key, return_inverse=True)[1].reshape(-1)


def _middles(mesh: InspectionMesh, place: Integers, kept: Integers) -> Integers:
    """Return for each gathering the node nearest to its middle, or one that is to be kept."""
    count = np.bincount(place)
    middle = np.column_stack([np.bincount(place, mesh.nodes[:, k]) for k in range(3)]) / count[:, None]
    distance = np.linalg.norm(mesh.nodes - middle[place], axis=1)
    distance[kept] = -1.0
    order = np.lexsort((distance, place))
    return order[np.r_[0, np.cumsum(count)[:-1]]]
