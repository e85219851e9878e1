"""A cut through the part: the nominal profile in a plane, and what a map says along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats, Integers, unit
from inspect3d.deviate.deviation import Deviation
from inspect3d.nominal.nominal import InspectionMesh

TINY = 1e-9
"""Share of the part's size by which nodes on the plane are taken to lie on its positive side."""


@dataclass(frozen=True, eq=False)
class Profile:
    """A connected piece of a section, in the order along it.

    Parameters
    ----------
    points : (k, 3) mm, on the edges of the inspection mesh; the last equals the first where the piece is closed
    ends : (k, 2) the nodes of each edge
    weight : (k,) share of the second node
    length : (k,) mm, along the piece from its beginning
    """

    points: Floats
    ends: Integers
    weight: Floats
    length: Floats

    def along(self, deviation: Deviation) -> tuple[Floats, Floats]:
        """Return deviation and standard uncertainty along the piece, (k,) mm each, NaN where nothing was measured.

        Between two observed nodes both are interpolated: neighbours share their errors, so interpolation is taken to
        lower no uncertainty. Beside a node that was not observed the nearer node speaks.
        """
        nearer = self.ends[np.arange(len(self.ends)), (self.weight > 0.5).astype(np.int64)]
        both = deviation.observed[self.ends].all(axis=1)

        def read(values: Floats) -> Floats:
            first, second = values[self.ends].T
            return np.where(both, (1 - self.weight) * first + self.weight * second, values[nearer])

        return read(deviation.value), read(deviation.sigma)

    def normals(self, mesh: InspectionMesh, plane: Floats) -> Floats:
        """Return the outward normals along the piece, (k, 3), unit and in the plane with the normal `plane` (3,)."""
        weight = self.weight[:, None]
        mixed = (1 - weight) * mesh.normals[self.ends[:, 0]] + weight * mesh.normals[self.ends[:, 1]]
        mixed = mixed - np.outer(mixed @ plane, plane)
        return mixed / np.maximum(np.linalg.norm(mixed, axis=1, keepdims=True), TINY)


def section(mesh: InspectionMesh, point: Floats, normal: Floats) -> tuple[Profile, ...]:
    """Return the pieces in which a plane cuts the inspection mesh, longest first; none where it misses the part.

    Parameters
    ----------
    mesh : of the part
    point : (3,) mm, in the plane
    normal : (3,) of the plane
    """
    height = (mesh.nodes - np.asarray(point)) @ unit(np.asarray(normal, dtype=np.float64))
    height = np.where(np.abs(height) < TINY * np.ptp(mesh.nodes), TINY * np.ptp(mesh.nodes), height)
    above = height > 0
    sides = above[mesh.triangles]
    cut = mesh.triangles[sides.any(axis=1) & ~sides.all(axis=1)]
    if not len(cut):
        return ()
    edges = np.sort(np.stack([cut, np.roll(cut, -1, axis=1)], axis=-1), axis=-1)
    crossed = edges[above[edges[..., 0]] != above[edges[..., 1]]].reshape(-1, 2, 2)
    unique, number = np.unique(crossed.reshape(-1, 2), axis=0, return_inverse=True)
    weight = height[unique[:, 0]] / (height[unique[:, 0]] - height[unique[:, 1]])
    points = mesh.nodes[unique[:, 0]] + weight[:, None] * (mesh.nodes[unique[:, 1]] - mesh.nodes[unique[:, 0]])
    pieces = []
    for chain in _chains(number.reshape(-1, 2), len(unique)):
        steps = np.linalg.norm(np.diff(points[chain], axis=0), axis=1)
        pieces.append(Profile(points[chain], unique[chain], weight[chain], np.r_[0.0, np.cumsum(steps)]))
    return tuple(sorted(pieces, key=lambda piece: -piece.length[-1]))


def _chains(segments: Integers, count: int) -> list[Integers]:
    """Return the chains of points that segments (m, 2) make; open ones first begin at an end."""
    neighbours: list[list[int]] = [[] for _ in range(count)]
    for a, b in segments.tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    chains = []
    for start in sorted(range(count), key=lambda each: len(neighbours[each])):
        chain, here = [start], start
        while neighbours[here]:
            following = neighbours[here].pop()
            neighbours[following].remove(here)
            chain.append(following)
            here = following
        if len(chain) > 1:
            chains.append(np.array(chain))
    return chains
