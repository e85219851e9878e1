"""A NURBS surface: control points, weights and knots, and what each control point does at a place."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats, Indices, floats, unit
from inspect3d.pose import Pose

STEPS, ARRIVED = 30, 1e-10  # mm
AROUND = 8  # places near a point to start from where it ends at the rim
MARGIN = 1e-4  # share of the parameters that still counts as the rim
PLACES = 6  # along each direction of a span between knots, to start the search for a point from


@dataclass(frozen=True, eq=False)
class Nurbs:
    """S(u, v) = sum R_ij P_ij with R_ij = w_ij N_i(u) N_j(v) / sum of all w N N (paper, eq. 9).

    Parameters
    ----------
    poles : (a, b, 3) mm, control points P
    weights : (a, b), w
    knots_u, knots_v : (a + p + 1,) and (b + q + 1,), clamped, repeated by their multiplicity
    reversed : the outward normal is dS/dv x dS/du, not dS/du x dS/dv

    Notes
    -----
    L. Piegl, W. Tiller, The NURBS Book, 2nd edition, Springer, 1997.
    """

    poles: Floats
    weights: Floats
    knots_u: Floats
    knots_v: Floats
    reversed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "poles", floats(self.poles, "poles", None, None, 3))
        object.__setattr__(self, "weights", floats(self.weights, "weights", *self.poles.shape[:2]))
        object.__setattr__(self, "knots_u", floats(self.knots_u, "knots_u", None))
        object.__setattr__(self, "knots_v", floats(self.knots_v, "knots_v", None))

    @property
    def degrees(self) -> tuple[int, int]:
        """Return p and q."""
        across, along = self.weights.shape
        return len(self.knots_u) - across - 1, len(self.knots_v) - along - 1

    @property
    def size(self) -> int:
        """Return the number of control points."""
        return self.weights.size

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Return the least and the greatest (u, v), (2,) each."""
        p, q = self.degrees
        across, along = self.weights.shape
        return (
            np.array([self.knots_u[p], self.knots_v[q]]),
            np.array([self.knots_u[across], self.knots_v[along]]),
        )

    def functions(self, uv: Floats) -> sparse.csr_matrix:
        """Return R (n, a b), what each control point weighs at parameters (n, 2); rows add up to one."""
        return self._spread(*self._weighed(uv))

    def along(self, uv: Floats, towards: Floats, ways: int = 1) -> sparse.csr_matrix:
        """Return how far motions of the control points move places along directions (n, 3), (n, ways a b).

        Parameters
        ----------
        ways : in which each moves, see `frames`: 1, its normal; or 3. They are numbered one control point after another
        """
        from inspect3d.nominal.nurbs_kernel import turn_towards

        columns, values = self._weighed(uv)
        turned = np.empty((*values.shape, ways))
        turn_towards(columns, self.frames[:, :ways], np.ascontiguousarray(towards), values, turned)
        if ways == 1:
            return self._spread(columns, turned[:, :, 0])
        each = np.empty(turned.shape, dtype=np.int32)
        each[:] = ways * columns[:, :, None] + np.arange(ways)
        wide = (len(uv), ways * columns.shape[1])
        return self._spread(each.reshape(wide), turned.reshape(wide), ways)

    def points(self, uv: Floats) -> Floats:
        """Return S (n, 3) mm."""
        return self.tangents(uv)[0]

    def tangents(self, uv: Floats) -> tuple[Floats, Floats, Floats]:
        """Return S, dS/du and dS/dv, (n, 3) mm each."""
        from inspect3d.nominal.nurbs_kernel import write_places

        found = np.empty((len(uv), 9))
        write_places(self._net, *self.degrees, self._within(uv), found)
        return found[:, :3].copy(), found[:, 3:6].copy(), found[:, 6:].copy()

    def normals(self, uv: Floats, tangents: tuple[Floats, Floats] | None = None) -> Floats:
        """Return the outward normals (n, 3), unit; at a pole, where a derivative vanishes, those a little inside.

        Parameters
        ----------
        tangents : dS/du and dS/dv there, where they are known
        """
        along_u, along_v = tangents or self.tangents(uv)[1:]
        cross = np.cross(along_u, along_v)
        flat = np.linalg.norm(cross, axis=1) <= 1e-9 * (along_u**2 + along_v**2).sum(axis=1)
        if flat.any():
            low, high = self.bounds
            inward = uv[flat] + 1e-4 * ((low + high) / 2 - uv[flat])
            _, along_u, along_v = self.tangents(inward)
            cross[flat] = np.cross(along_u, along_v)
        return -unit(cross) if self.reversed else unit(cross)

    def parameters(self, points: Floats) -> Floats:
        """Return the (u, v) (n, 2) of the closest points of the surface to points (n, 3) mm near it.

        Gauss-Newton from the nearest of many places all over the surface; a step that would leave it ends at its rim.
        What ends there, or nearly so, may belong beyond a seam, and is sought from other places near by as well.
        """
        tree, places = self._places
        uv = self.descended(points, places[tree.query(points)[1]])
        low, high = self.bounds
        margin = MARGIN * (high - low)
        at_rim = np.flatnonzero(((uv <= low + margin) | (uv >= high - margin)).any(axis=1))
        distance = np.linalg.norm(self.points(uv[at_rim]) - points[at_rim], axis=1)
        _, nearest = tree.query(points[at_rim], k=min(AROUND, len(places)))
        for other in nearest.T[1:]:
            tried = self.descended(points[at_rim], places[other])
            away = np.linalg.norm(self.points(tried) - points[at_rim], axis=1)
            closer = away < distance
            uv[at_rim[closer]], distance[closer] = tried[closer], away[closer]
        return uv

    def descended(self, points: Floats, guess: Floats, arrived: float = ARRIVED) -> Floats:
        """Return the parameters (n, 2) that Gauss-Newton leads to from a guess; its last step is `arrived` mm long."""
        from inspect3d.nominal.nurbs_kernel import descend

        uv = self._within(guess).copy()
        descend(self._net, *self.degrees, np.ascontiguousarray(points), STEPS, arrived, uv)
        return uv

    @cached_property
    def _places(self) -> tuple[Any, Floats]:
        """Return a tree of places all over the surface, its rim and corners among them, and their parameters."""
        from scipy.spatial import cKDTree

        shares = (np.arange(PLACES) + 0.5) / PLACES
        rows = []
        for knots in (self.knots_u, self.knots_v):
            distinct = np.unique(knots)
            rows.append(np.append(distinct, distinct[:-1, None] + np.diff(distinct)[:, None] * shares))
        uv = np.stack(np.meshgrid(*rows, indexing="ij"), axis=-1).reshape(-1, 2)
        return cKDTree(self.points(uv)), uv

    @cached_property
    def greville(self) -> Floats:
        """Return the parameters (a b, 2) that belong to the control points, the means of p or q knots each."""
        u, v = (
            np.array([knots[k + 1 : k + 1 + degree].mean() for k in range(count)])
            for knots, degree, count in zip((self.knots_u, self.knots_v), self.degrees, self.weights.shape, strict=True)
        )
        return np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)

    @cached_property
    def frames(self) -> Floats:
        """Return the normals of the surface where its control points belong, and two tangents, (a b, 3, 3), unit."""
        normals = self.normals(self.greville)
        first = unit(np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)]))
        return np.stack([normals, first, np.cross(normals, first)], axis=1)

    def moved(self, motions: Floats) -> Nurbs:
        """Return the surface after motions (a b, 3) mm of its control points."""
        return replace(self, poles=self.poles + motions.reshape(self.poles.shape))

    def posed(self, pose: Pose, scale: float = 1.0) -> Nurbs:
        """Return the surface grown about the origin by a scale, and then moved by a pose."""
        return replace(self, poles=pose(scale * self.poles.reshape(-1, 3)).reshape(self.poles.shape))

    def _weighed(self, uv: Floats) -> tuple[Indices, Floats]:
        """Return which control points weigh at parameters (n, 2), and how much, (n, (p + 1) (q + 1))."""
        from inspect3d.nominal.nurbs_kernel import write_functions

        p, q = self.degrees
        shape = (len(uv), (p + 1) * (q + 1))
        columns, values = np.empty(shape, dtype=np.int32), np.empty(shape)
        write_functions(self._net, p, q, self._within(uv), columns, values)
        return columns, values

    def _spread(self, columns: Indices, values: Floats, ways: int = 1) -> sparse.csr_matrix:
        starts = np.arange(len(values) + 1, dtype=np.int32) * values.shape[1]
        return sparse.csr_matrix((values.ravel(), columns.ravel(), starts), shape=(len(values), ways * self.size))

    @property
    def _net(self) -> tuple[Floats, Floats, Floats, Floats]:
        return self.poles, self.weights, self.knots_u, self.knots_v

    def _within(self, uv: Floats) -> Floats:
        """Return parameters (n, 2) with those beyond the bounds brought to them."""
        low, high = self.bounds
        return np.ascontiguousarray(np.clip(uv, low, high))
