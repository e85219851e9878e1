"""A NURBS surface: control points, weights and knots, and what each control point does at a place."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats, floats, unit
from inspect3d.pose import Pose

STEPS, ARRIVED = 30, 1e-10  # mm
AROUND = 8  # places near a point to start from where it ends at the rim
PLACES = 6  # along each direction of a span between knots, to start the search for a point from
SINGULAR = 1e-12


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
    L. Piegl, W. Tiller, The NURBS Book, 2nd edition, Springer, 1997. The B-splines N are SciPy's.
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
        product = self._products(uv)[0]
        product.data /= np.repeat(np.asarray(product.sum(axis=1)).ravel(), np.diff(product.indptr))
        return product

    def points(self, uv: Floats) -> Floats:
        """Return S (n, 3) mm."""
        return self.functions(uv) @ self.poles.reshape(-1, 3)

    def tangents(self, uv: Floats) -> tuple[Floats, Floats, Floats]:
        """Return S, dS/du and dS/dv, (n, 3) mm each."""
        homogeneous = np.column_stack([self.poles.reshape(-1, 3), np.ones(self.size)])
        value, along_u, along_v = (product @ homogeneous for product in self._products(uv, slopes=True))
        weight = value[:, 3:]
        points = value[:, :3] / weight
        return points, *((slope[:, :3] - points * slope[:, 3:]) / weight for slope in (along_u, along_v))

    def normals(self, uv: Floats) -> Floats:
        """Return the outward normals (n, 3), unit; at a pole, where a derivative vanishes, those a little inside."""
        _, along_u, along_v = self.tangents(uv)
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
        What ends there may belong beyond a seam, and is sought from other places near by as well.
        """
        tree, places = self._places
        _, nearest = tree.query(points, k=min(AROUND, len(places)))
        uv = self._descended(points, places[nearest[:, 0]])
        low, high = self.bounds
        at_rim = np.flatnonzero(((uv <= low) | (uv >= high)).any(axis=1))
        distance = np.linalg.norm(self.points(uv[at_rim]) - points[at_rim], axis=1)
        for other in nearest[at_rim, 1:].T:
            tried = self._descended(points[at_rim], places[other])
            away = np.linalg.norm(self.points(tried) - points[at_rim], axis=1)
            closer = away < distance
            uv[at_rim[closer]], distance[closer] = tried[closer], away[closer]
        return uv

    def _descended(self, points: Floats, guess: Floats) -> Floats:
        """Return the parameters (n, 2) that Gauss-Newton leads to from a guess."""
        uv, (low, high) = guess.copy(), self.bounds
        active = np.arange(len(points))
        for _ in range(STEPS):
            at, along_u, along_v = self.tangents(uv[active])
            step = _tangential(points[active] - at, along_u, along_v)
            moved = np.clip(uv[active] + step, low, high)
            change = np.abs(moved - uv[active])
            uv[active] = moved
            lengths = np.linalg.norm(along_u, axis=1) * change[:, 0] + np.linalg.norm(along_v, axis=1) * change[:, 1]
            active = active[lengths > ARRIVED]
            if not len(active):
                break
        return uv

    @cached_property
    def _places(self) -> tuple[Any, Floats]:
        """Return a tree of places all over the surface, and their parameters."""
        from scipy.spatial import cKDTree

        shares = (np.arange(PLACES) + 0.5) / PLACES
        rows = []
        for knots in (self.knots_u, self.knots_v):
            distinct = np.unique(knots)
            rows.append((distinct[:-1, None] + np.diff(distinct)[:, None] * shares).ravel())
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
    def directions(self) -> Floats:
        """Return the normals (a b, 3) of the surface where its control points belong."""
        return self.normals(self.greville)

    def moved(self, motions: Floats) -> Nurbs:
        """Return the surface after motions (a b, 3) mm of its control points."""
        return replace(self, poles=self.poles + motions.reshape(self.poles.shape))

    def posed(self, pose: Pose, scale: float = 1.0) -> Nurbs:
        """Return the surface grown about the origin by a scale, and then moved by a pose."""
        return replace(self, poles=pose(scale * self.poles.reshape(-1, 3)).reshape(self.poles.shape))

    def _products(self, uv: Floats, slopes: bool = False) -> list[sparse.csr_matrix]:
        """Return w N_i N_j (n, a b) and, for `slopes`, its derivatives by u and v."""
        low, high = self.bounds
        within = np.clip(uv, low, high)
        both = [
            _functions(knots, degree, within[:, axis], slopes)
            for axis, (knots, degree) in enumerate(zip((self.knots_u, self.knots_v), self.degrees, strict=True))
        ]
        found = [_rowwise(both[0][0], both[1][0])]
        if slopes:
            found += [_rowwise(both[0][1], both[1][0]), _rowwise(both[0][0], both[1][1])]
        for product in found:
            product.data *= self.weights.ravel()[product.indices]
        return found


def _tangential(r: Floats, along_u: Floats, along_v: Floats) -> Floats:
    """Return the step (n, 2) that leads along the tangents by r (n, 3); at a pole along each by itself."""
    e, f, g = ((a * b).sum(axis=1) for a, b in ((along_u, along_u), (along_u, along_v), (along_v, along_v)))
    right_u, right_v = (r * along_u).sum(axis=1), (r * along_v).sum(axis=1)
    regular = e * g - f * f > SINGULAR * e * g
    f = np.where(regular, f, 0.0)
    over = np.divide(1.0, e * g - f * f, out=np.zeros(len(r)), where=e * g - f * f > 0)
    return np.stack([over * (g * right_u - f * right_v), over * (e * right_v - f * right_u)], axis=1)


def _functions(knots: Floats, degree: int, at: Floats, slopes: bool) -> list[sparse.csr_matrix]:
    """Return the B-splines of one direction at parameters (n,), and their slopes."""
    count = len(knots) - degree - 1
    found = [_splines(knots, degree, at)]
    if slopes:
        lower = _splines(knots[1:-1], degree - 1, at)
        width = knots[degree + 1 : degree + count] - knots[1:count]
        steps = np.divide(degree, width, out=np.zeros(count - 1), where=width > 0)
        difference = sparse.diags([-steps, steps], [0, 1], shape=(count - 1, count))
        found.append(lower @ difference)
    return found


def _splines(knots: Floats, degree: int, at: Floats) -> sparse.csr_matrix:
    from scipy.interpolate import BSpline

    if not len(at):
        return sparse.csr_matrix((0, len(knots) - degree - 1))
    return sparse.csr_matrix(BSpline.design_matrix(at, knots, degree))


def _rowwise(one: sparse.csr_matrix, other: sparse.csr_matrix) -> sparse.csr_matrix:
    """Return the products (n, a b) of all entries of a row (n, a) with all entries of the same row (n, b)."""
    one, other = one.tocsr(), other.tocsr()
    counts, others = np.diff(one.indptr), np.diff(other.indptr)
    rows = np.repeat(np.arange(one.shape[0]), counts)  # of every entry of `one`
    each = others[rows]
    first = np.repeat(np.arange(len(rows)), each)
    second = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each) + np.repeat(other.indptr[rows], each)
    data = one.data[first] * other.data[second]
    columns = one.indices[first].astype(np.int64) * other.shape[1] + other.indices[second]
    starts = np.concatenate([[0], np.cumsum(counts * others)])
    return sparse.csr_matrix((data, columns, starts), shape=(one.shape[0], one.shape[1] * other.shape[1]))
