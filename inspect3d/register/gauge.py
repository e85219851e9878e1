"""The common alignment: the rigid motion that every method's map is measured against."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import linalg, sparse

from inspect3d.arrays import Floats, floats
from inspect3d.register.mobility import cross_matrix, jacobian, spread
from inspect3d.register.ordered import Level, ordered_solver

MAD = 1.4826
TUKEY = 4.685
FREE = 1e-3  # share of the stiffest motion's stiffness below which a motion is free
SHAPELESS = 1e-5  # the same for the growth, which a slight curvature determines well enough
SOFT = 1e-2  # share of the stiffest motion's stiffness below which a motion is soft
ROUNDED = 1e-9  # share of a variance below which a difference of variances is rounding
OFFSET = 3.0  # robust scales that a uniform deviation must have to count as one


@dataclass(frozen=True, eq=False)
class Gauge:
    """The map that takes the best-fit rigid motion out of a deviation field: G = I - J (J' W J)⁺ J' W.

    Free motions are left alone: the inverse is a pseudo-inverse. Where a method cannot see the scale, the growth of the
    part is taken out like a motion, as a seventh column of J.

    Parameters
    ----------
    nodes, normals : (n, 3) of the observed nodes, mm
    weights : (n,) W, area times robust weight
    offset : mm, uniform deviation that no rigid motion explains; 0 unless it is far larger than the other deviations
    growth : take out the growth of the part as well
    levels : features that determine the motion one after the other, as datums do; empty: all nodes by their weights
    locked : of the six motions about the CAD's origin (rx, ry, rz, tx, ty, tz), those not to be made, by number
    """

    nodes: Floats
    normals: Floats
    weights: Floats
    offset: float = 0.0
    growth: bool = False
    levels: tuple[Level, ...] = ()
    locked: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", floats(self.weights, "weights", len(self.nodes)))

    @cached_property
    def origin(self) -> Floats:
        """Return the weighted centre of the nodes, (3,) mm: small motions are about it."""
        return np.average(self.nodes, axis=0, weights=self.weights)

    @cached_property
    def length(self) -> float:
        """Return the spread of the nodes, mm: it weighs turns against shifts."""
        return spread(self.nodes, self.weights, self.origin)

    @cached_property
    def jacobian(self) -> Floats:
        """Return J, (n, 6): the change of each node's deviation under a small motion of the measured points.

        With growth, (n, 7): the last column is the change by a unit of relative growth about `origin`.
        """
        rows = jacobian(self.nodes, self.normals, self.origin)
        if not self.growth:
            return rows
        return np.column_stack([rows, ((self.nodes - self.origin) * self.normals).sum(axis=1)])

    @property
    def _units(self) -> Floats:
        """What brings turns and growth to the size of shifts, (6,) or (7,)."""
        return np.array([self.length] * 3 + [1.0] * 3 + [self.length] * self.growth)

    @cached_property
    def _spectrum(self) -> tuple[Floats, Floats]:
        """Stiffness of the motions, ascending, and the motions as columns (6, 6); turns in units of `length`."""
        rows = self.jacobian / self._units
        values, vectors = np.linalg.eigh((rows * self.weights[:, None]).T @ rows)
        return values, vectors / self._units[:, None]

    @cached_property
    def _ordered(self) -> tuple[Floats, Floats, list[int]]:
        """The solver, the free motions as columns, and how many motions each level determines."""
        whole = Level(sparse.identity(len(self.nodes), format="csr"), self.weights)
        solver, free, taken = ordered_solver(self.jacobian / self._units, self.levels or (whole,), self._allowed)
        return solver / self._units[:, None], free / self._units[:, None], taken

    @cached_property
    def _allowed(self) -> Floats:
        """A basis of the motions that are not locked, orthonormal columns in units of `length`."""
        about_origin = np.eye(len(self._units))
        if not self.locked:
            return about_origin
        about_origin[3:6, :3] = cross_matrix(self.origin)  # of the translation at the CAD's origin, t - r x o
        about_origin[3:6, 6:] = -self.origin[:, None]
        return linalg.null_space(about_origin[list(self.locked)] / self._units)

    @property
    def determined(self) -> list[int]:
        """Return how many motions each of the levels determines."""
        return self._ordered[2]

    @cached_property
    def free(self) -> Floats:
        """Return the motions that change no deviation, (k, 6), rad and mm about `origin`; k may be 0.

        They span the null space of J' W J (N. Gelfand & L. J. Guibas, "Shape segmentation using local slippage
        analysis", SGP 2004): stiffness below a thousandth of the stiffest motion's.
        """
        if self.growth:
            return replace(self, growth=False).free
        if self.levels or self.locked:
            return self._ordered[1].T
        values, vectors = self._spectrum
        return vectors[:, values < FREE * values[-1]].T

    @cached_property
    def growth_is_free(self) -> bool:
        """Tell whether the growth changes no deviation that a motion does not change alike, as on planes through one
        point; always False without growth."""
        if not self.growth:
            return False
        values, _ = self._spectrum
        return bool(values[len(self.free)] < SHAPELESS * values[-1])

    @cached_property
    def inverse(self) -> Floats:
        """Return (J' W J)⁺, (6, 6) or with growth (7, 7), with the free directions left out."""
        return self._inverse(0.0)

    def _inverse(self, least: float) -> Floats:
        """Return it without the free motions and those whose share of the stiffest motion's stiffness is less."""
        values, vectors = self._spectrum
        stiff = values >= least * values[-1]
        stiff[: len(self.free) + self.growth_is_free] = False
        return (vectors[:, stiff] / values[stiff]) @ vectors[:, stiff].T

    @cached_property
    def solver(self) -> Floats:
        """Return M = (J' W J)⁺ J' W, (6, n) or with growth (7, n): the motion in a deviation field."""
        if self.levels or self.locked:
            return self._ordered[0]
        return self.inverse @ (self.jacobian * self.weights[:, None]).T

    def motion(self, values: Floats) -> Floats:
        """Return the small motion (6,), or with growth (7,), of the points that best undoes a deviation field (n,) mm.

        A part that is too large all over, as a ring of too large a diameter, would lean over to fit the better: the
        `offset` it has left when the stiff motions are made does not count for the soft ones.
        """
        if self.levels or self.locked:
            return -self.solver @ values
        soft = self.inverse - self._inverse(SOFT)
        return -self.solver @ values + self.offset * soft @ (self.jacobian.T @ self.weights)

    def __call__(self, values: Floats) -> Floats:
        """Return G v: fields (n,) or (n, k) without their rigid motion."""
        return values - self.jacobian @ (self.solver @ values)

    def variances(self, independent: Floats) -> Floats:
        """Return the diagonal of G S G' for a diagonal S (n,) mm²; of a node that the fit goes through, nearly zero."""
        common = (self.solver * independent) @ self.solver.T
        cross = np.einsum("ij,ji->i", self.jacobian, self.solver) * independent
        found = independent - 2 * cross + np.einsum("ij,jk,ik->i", self.jacobian, common, self.jacobian)
        return np.maximum(found, ROUNDED * independent)

    def covariance(self, residuals: Floats, block: float) -> Floats:
        """Return the covariance of the motion, (6, 6) or with growth (7, 7), from a sandwich over spatial blocks.

        Errors within a cube of edge `block` (mm) may correlate as they like; those of different cubes do not.

        Notes
        -----
        K.-Y. Liang & S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73 (1986),
        with the usual factor b / (b - p) for b blocks and p determined motions.
        """
        scores = self.solver.T * residuals[:, None]
        cells = np.floor((self.nodes - self.nodes.min(axis=0)) / block).astype(np.int64)
        _, cell = np.unique(cells, axis=0, return_inverse=True)
        sums = np.stack([np.bincount(cell.ravel(), scores[:, k]) for k in range(scores.shape[1])], axis=1)
        determined = np.linalg.matrix_rank(self.solver * self._units[:, None])
        blocks = len(sums)
        grow = blocks / max(blocks - determined, 1)
        return grow * sums.T @ sums


def best_fit(
    nodes: Floats, normals: Floats, areas: Floats, values: Floats, growth: bool = False, steps: int = 50
) -> Gauge:
    """Return the robust best-fit gauge of a deviation field: Tukey weights on what remains, times the areas.

    Parameters
    ----------
    nodes, normals : (n, 3)
    areas : (n,) mm²
    values : (n,) mm
    growth : take out the growth of the part as well
    """
    weights, remains = areas, values
    for _ in range(steps):
        scale = MAD * _weighted_median(np.abs(remains), areas)
        if scale <= 0:
            break
        share = np.clip(1 - (remains / (TUKEY * scale)) ** 2, 0, None) ** 2
        new = areas * share
        settled = np.abs(new - weights).max() < 1e-4 * areas.max()
        weights = new
        remains = Gauge(nodes, normals, weights, growth=growth)(values)
        if settled:
            break
    return Gauge(nodes, normals, weights, _offset(remains, areas), growth)


def _offset(values: Floats, areas: Floats) -> float:
    """Return the median of values (n,) mm, or 0 where it does not stand out of their scatter."""
    middle = _weighted_median(values, areas)
    scatter = MAD * _weighted_median(np.abs(values - middle), areas)
    return middle if abs(middle) > OFFSET * scatter else 0.0


def _weighted_median(values: Floats, weights: Floats) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])
