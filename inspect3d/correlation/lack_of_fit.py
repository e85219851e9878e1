"""What a shape that moves by few unknowns cannot follow: what every node by itself would add to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats, Integers
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.linear import noise_of, slides_of, system_of
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.space import EVERY_NODE
from inspect3d.correlation.system import System

MISSED = 3.2  # standard uncertainties of the size of a bump that the motions of a solution cannot make
WIDTHS = (1, 2, 4)  # steps of averaging over neighbours that make such bumps from a node
RESTLESS, AROUND = 4.0, (1, 2)  # standard deviations of the mean square of facets; steps of averaging over neighbours
INDEPENDENT = 0.2  # share of a bump's stiffness that the motions do not have, at the least
DOUBTED = 2.5  # standard uncertainties of the mean over a node and its neighbours
ALONE = 3.5  # standard uncertainties of a node by itself


@dataclass(frozen=True, eq=False)
class LackOfFit:
    """The increment that nodes would make from a solution if each moved by itself, to first order.

    Where the solution is as the part is, the increment is noise: its variance is that of the nodes by themselves less
    that of the solution, since the solution's space is part of theirs. What goes beyond is an error of the model.

    Parameters
    ----------
    scene : whose nodes move by themselves
    increment : (n,) mm
    system : of the nodes by themselves
    left : the facets with the scores and the energy that are left after the increment
    noise : variance of the residuals that are left, grey levels², in `system`
    scores : (n,) 1/mm, J'W r of the nodes at the solution
    stiffness : (n, n) 1/mm², their variance where the solution is as the part is and moves by nothing
    alone, precision : (f,) mm and 1/mm², how each facet by itself would move, and how sure that is
    """

    scene: Scene
    increment: Floats
    system: System
    left: Facets
    noise: float
    scores: Floats
    stiffness: sparse.csr_matrix
    alone: Floats
    precision: Floats

    def size(self, within: System, rows: sparse.csr_matrix, times: float) -> Floats:
        """Return the size (n,) mm of the error of the model where there is one beyond doubt, and around; 0 elsewhere.

        Parameters
        ----------
        within : the system of the solution
        rows : (n, k), from its motions to those of the nodes
        times : by how much the variance of the residuals is larger there
        """
        near, around = self._near, self._around
        own = sparse.identity(len(self.increment), format="csr")
        mean = around @ self.increment
        variance = times * self.system.variances(own) - within.variances(rows)
        variance_of_mean = times * self.system.variances(around) - within.variances(around @ rows)
        alone = self.increment**2 > ALONE**2 * variance
        sizes = np.where(alone, np.maximum(self.increment**2 - variance, 0.0), 0.0)
        doubted = near @ (alone | (mean**2 > DOUBTED**2 * variance_of_mean)).astype(np.float64) > 0
        sizes = np.maximum(sizes, mean**2)
        found = np.where(doubted, np.maximum(sizes, around @ sizes), 0.0)
        for width in WIDTHS:
            found = np.maximum(found, self._missed(within, rows, times, around**width))
        for width in AROUND:
            found = np.maximum(found, self._restless(times, around**width))
        return np.sqrt(found)

    @property
    def sign(self) -> Floats:
        """Return whether the solution is likely too low, 1, or too high, -1, at each node, (n,)."""
        return np.where(self._around @ self.increment < 0, -1.0, 1.0)

    @property
    def alike(self) -> sparse.csr_matrix:
        """Return rows A (n, n) of length one; A A' is how far errors of the model at two nodes go together.

        What splines cannot follow reaches over a span between knots: its errors do not average out over a few nodes.
        """
        wide = self._around ** WIDTHS[-1]
        return (sparse.diags(1 / np.sqrt(np.asarray(wide.power(2).sum(axis=1)).ravel())) @ wide).tocsr()

    @cached_property
    def _near(self) -> sparse.csr_matrix:
        return self.scene.adjacency + sparse.identity(len(self.increment), format="csr")

    @cached_property
    def _around(self) -> sparse.csr_matrix:
        """Return averages over each node and its neighbours, (n, n)."""
        return sparse.diags(1 / np.asarray(self._near.sum(axis=1)).ravel()) @ self._near

    def _missed(self, within: System, rows: sparse.csr_matrix, times: float, bumps: sparse.csr_matrix) -> Floats:
        """Return squared sizes (n,) mm² of what the solution misses on average over bumps (n, n), a row each.

        The increment's average over many nodes would need more of an inverse than its pattern. The scores s tell the
        same: a bump p has the score p's of the variance p'Kp, less what the motions of the solution take of it, and
        misses p's / p'K1 on average.
        """
        pushed = self.stiffness @ bumps.T
        stiff = np.asarray(bumps.T.multiply(pushed).sum(axis=0)).ravel()
        taken = (rows.T @ pushed).toarray()
        own = stiff - (taken * within.covariance(taken)).sum(axis=0)
        scores = bumps @ self.scores
        missed = (own > INDEPENDENT * stiff) & (scores**2 > MISSED**2 * times * own)
        whole = bumps @ np.asarray(self.stiffness.sum(axis=1)).ravel()
        sizes = np.where(missed, np.divide(scores, whole, out=np.zeros(len(whole)), where=whole > 0) ** 2, 0.0)
        near = bumps @ missed.astype(np.float64)
        return np.divide(bumps @ sizes, near, out=np.zeros(len(near)), where=near > 0)

    def _restless(self, times: float, near: sparse.csr_matrix) -> Floats:
        """Return squared sizes (n,) mm² of what facets move by more than noise where they do not agree, as at a step.

        Up on one side and down on the other, such motions cancel in averages. Their squares, in standard uncertainties,
        have the mean one and the variance two.
        """
        corners, every = self.scene.triangles, np.repeat(np.arange(len(self.alone)), 3)
        of = sparse.csr_matrix((np.ones(corners.size), (corners.ravel(), every)), (near.shape[0], len(self.alone)))
        counts = near @ of @ sparse.diags((self.precision > 0).astype(np.float64))
        number = np.asarray(counts.sum(axis=1)).ravel()
        noise = np.sqrt(2 * np.asarray(counts.power(2).sum(axis=1)).ravel())
        excess = counts @ (self.precision * self.alone**2 / times) - number
        sizes = np.divide(excess, counts @ (self.precision / times), out=np.zeros(len(excess)), where=number > 0)
        return np.where(excess > RESTLESS * noise, sizes, 0.0)


def lack_of_fit(
    scene: Scene, found: Facets, views: Sequence[View], weights: Floats, freedom: Freedom, columns: Integers
) -> LackOfFit:
    """Return what every node by itself would add to a solution.

    Parameters
    ----------
    found : what the pictures say about the facets at the solution, by `columns` and in the power 2
    weights : (f,) of the facets
    """
    free, unknowns = replace(scene, space=EVERY_NODE), len(scene.nodes) + freedom.unknowns
    noise, factors = noise_of(found, weights, unknowns), weights * found.clean**2
    scale, slides = freedom.scale(views, scene.sample), slides_of(scene, freedom, views)
    system = system_of(free, found, factors, noise, freedom, columns, scale, slides)
    scores = scene.gathered(found.right * (weights * found.clean / noise)[:, None])
    increment, cameras = system.solve(scores, np.zeros(freedom.unknowns))
    corners = increment[scene.triangles]
    moved = np.einsum("fij,fj->fi", found.node, corners) + found.cross @ (freedom.spread(columns)[0] @ cameras)
    statistics = found.statistics.copy()
    statistics[:, 0] += ((moved - 2 * found.right) * corners).sum(axis=1)
    left = replace(found, right=found.right - found.clean[:, None] * moved, statistics=statistics)
    before, noise = noise, noise_of(left, weights, unknowns)
    system = system_of(free, found, factors, noise, freedom, columns, scale, slides)
    stiffness = scene.matrix(scene.assembled(found.node * (factors / noise)[:, None, None]))
    whole = found.clean * found.node.sum(axis=(1, 2))
    alone = np.divide(found.right.sum(axis=1), whole, out=np.zeros(len(whole)), where=whole > 0)
    precision = weights * found.clean * whole / noise
    return LackOfFit(free, increment, system, left, noise, scores * before / noise, stiffness, alone, precision)
