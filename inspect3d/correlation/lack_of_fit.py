"""What a shape that moves by few unknowns cannot follow: what every node by itself would add to it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.stats import chi2, norm

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.linear import noise_of, slides_of, system_of
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.space import EVERY_NODE
from inspect3d.correlation.spline_space import SplineSpace
from inspect3d.correlation.system import System

CHANCE = 0.01  # of noise making any node of a map stand out in any test
BESIDE = 3.0, 3.0, 3.2  # standard uncertainties that do so beside such a node: of means, facets and bumps
ALONE = 3.5  # the same of a node by itself
WIDTHS = (1, 2, 4)  # steps of averaging over neighbours that make bumps from a node
AROUND = (1, 2)  # steps of averaging over neighbours, of the squares of facets
INDEPENDENT = 0.2  # share of a bump's stiffness, or of a node's variance, that the motions do not have, at the least


@dataclass(frozen=True, eq=False)
class Test:
    """What one test says about every node: is there more than noise, and how much.

    Parameters
    ----------
    beyond : (n,), in standard uncertainties
    beside : how much of that counts near nodes that stand out beyond doubt
    squared : (n,) mm², of what is missed
    over : (n, n), the nodes that a test belongs to, a row each
    """

    beyond: Floats
    beside: float
    squared: Floats
    over: sparse.csr_matrix

    def found(self, near: Booleans) -> Floats:
        """Return the mean squared size (n,) mm² over the tests that stand out and that a node belongs to; 0: none."""
        out = (near & (self.beyond > self.beside)).astype(np.float64)
        number = self.over @ out
        return np.divide(self.over @ (self.squared * out), number, out=np.zeros(len(out)), where=number > 0)


@dataclass(frozen=True, eq=False)
class LackOfFit:
    """The increment that nodes would make from a solution if each moved by itself, to first order.

    Where the solution is as the part is, the increment is noise. The solution Q⁻¹B'r has taken of the scores what its
    motions push the nodes, G = J'W B, so that the variance of what is left is K - G Q⁻¹G', and that of the increment
    K⁻¹ - R Q⁻¹R' with R = K⁻¹G, the motions as nodes by themselves would follow them. At a rim that is far from what
    they move the nodes by. What goes beyond is an error of the model.

    Parameters
    ----------
    scene : whose nodes move by themselves
    increment : (n,) mm
    system : of the nodes by themselves
    left : the facets with the scores and the energy that are left after the increment
    noise : variance of the residuals that are left, grey levels², in `system`
    scores : (n,) 1/mm, J'W r of the nodes at the solution
    blocks : (f, 3, 3) 1/mm², what the facets give K, the variance of the scores where the solution moves by nothing
    alone, precision : (f,) mm and 1/mm², how each facet by itself would move, and how sure that is
    """

    scene: Scene
    increment: Floats
    system: System
    left: Facets
    noise: float
    scores: Floats
    blocks: Floats
    alone: Floats
    precision: Floats

    def squared(self, within: System, space: SplineSpace, times: float) -> tuple[Floats, Booleans]:
        """Return the squared size (n,) mm² of the error of the model, and the nodes (n,) that prove it.

        Of as many nodes as a map has some stand out by chance. So much as noise hardly ever reaches in any of them
        proves an error; as far as the same control points reach, and those of nodes there that stand out by themselves,
        less than that counts as well.

        Parameters
        ----------
        within : the system of the solution
        space : its motions
        times : by how much the variance of the residuals is larger there
        """
        tests, reach = tuple(self._tests(within, space.pushes(self.scene, self.blocks), times)), space.sharing
        proof = float(norm.isf(CHANCE / 2 / len(tests) / len(self.increment)))
        most = np.max([test.beyond for test in tests], axis=0)
        proven = most > proof
        near, before = reach(proven), np.zeros(len(most), dtype=bool)
        while (near & ~before).any():
            near, before = near | reach(near & (most > ALONE)), near
        return np.max([test.found(near) for test in tests], axis=0), proven

    @property
    def sign(self) -> Floats:
        """Return whether the solution is likely too low, 1, or too high, -1, at each node, (n,)."""
        return np.where(self._around @ self.increment < 0, -1.0, 1.0)

    @property
    def alike(self) -> sparse.csr_matrix:
        """Return rows A (n, n) of length one; A A' is how far errors of the model at two nodes go together.

        What splines cannot follow reaches over a span between knots: its errors do not average out over a few nodes.
        """
        wide = self._averages[WIDTHS[-1]]
        return (sparse.diags(1 / np.sqrt(np.asarray(wide.power(2).sum(axis=1)).ravel())) @ wide).tocsr()

    @cached_property
    def near(self) -> sparse.csr_matrix:
        """Return a one for each node and its neighbours, (n, n)."""
        return self.scene.adjacency + sparse.identity(len(self.increment), format="csr")

    @cached_property
    def _stiffness(self) -> sparse.csr_matrix:
        return self.scene.matrix(self.scene.assembled(self.blocks))

    @cached_property
    def _around(self) -> sparse.csr_matrix:
        """Return averages over each node and its neighbours, (n, n)."""
        return sparse.diags(1 / np.asarray(self.near.sum(axis=1)).ravel()) @ self.near

    @cached_property
    def _averages(self) -> dict[int, sparse.csr_matrix]:
        """Return the averages after one, two and four steps of averaging."""
        once = self._around
        twice = once @ once
        return {1: once, 2: twice, 4: twice @ twice}

    def _tests(self, within: System, pushes: Floats, times: float) -> Iterator[Test]:
        """Yield tests of the nodes by themselves, of means over neighbours, of bumps and of facets."""
        around, followed = self._around, self.system.motion.solve(pushes)
        means, facets, bumps = BESIDE
        yield self._moved(sparse.identity(len(self.increment), format="csr"), within, followed, times, ALONE)
        yield self._moved(around, within, followed, times, means)
        for width in WIDTHS:
            yield self._missed(self._averages[width], within, pushes, times, bumps)
        for width in AROUND:
            yield self._restless(self._averages[width], times, facets)

    def _moved(self, mean: sparse.csr_matrix, within: System, followed: Floats, times: float, beside: float) -> Test:
        """Return the test of means of the increment, (n, n), a row each."""
        size, whole = mean @ self.increment, times * self.system.variances(mean)
        taken = mean @ followed
        variance = np.maximum(whole - (taken * within.covariance(taken.T).T).sum(axis=1), INDEPENDENT * whole)
        return Test(np.abs(size) / np.sqrt(variance), beside, np.maximum(size**2 - variance, 0.0), self._around)

    def _missed(self, bumps: sparse.csr_matrix, within: System, pushes: Floats, times: float, beside: float) -> Test:
        """Return the test of what the solution misses on average over bumps (n, n), a row each.

        The increment's average over many nodes would need more of an inverse than its pattern. The scores s tell the
        same: a bump p has the score p's of the variance p'Kp, less what the motions of the solution take of it, and
        misses p's / p'K1 on average.
        """
        stiff = np.asarray(bumps.multiply(bumps @ self._stiffness).sum(axis=1)).ravel()
        taken = bumps @ pushes
        own = stiff - (taken * within.covariance(taken.T).T).sum(axis=1) / times
        scores, whole = bumps @ self.scores, bumps @ np.asarray(self._stiffness.sum(axis=1)).ravel()
        apart = (own > INDEPENDENT * stiff) & (whole > 0)
        beyond = np.divide(np.abs(scores), np.sqrt(times * np.where(apart, own, 1.0)), out=np.zeros(len(whole)))
        size = np.divide(scores, whole, out=np.zeros(len(whole)), where=apart)
        return Test(np.where(apart, beyond, 0.0), beside, size**2, bumps)

    def _restless(self, mean: sparse.csr_matrix, times: float, beside: float) -> Test:
        """Return the test of what facets move by more than noise where they do not agree, as at a step.

        Up on one side and down on the other, such motions cancel in averages. Their squares, in standard uncertainties,
        have the mean one and the variance two.
        """
        corners, every = self.scene.triangles, np.repeat(np.arange(len(self.alone)), 3)
        of = sparse.csr_matrix((np.ones(corners.size), (corners.ravel(), every)), (mean.shape[0], len(self.alone)))
        counts = mean @ of @ sparse.diags((self.precision > 0).astype(np.float64))
        number, known = np.asarray(counts.sum(axis=1)).ravel(), counts @ (self.precision / times)
        shown = number > 0
        squares = counts @ (self.precision * self.alone**2 / times)
        share = np.divide(
            number, np.asarray(counts.power(2).sum(axis=1)).ravel(), out=np.ones(len(number)), where=shown
        )
        beyond = norm.isf(chi2.sf(squares * share, np.maximum(number * share, 1.0)))
        squared = np.divide(np.maximum(squares - number, 0.0), known, out=np.zeros(len(number)), where=shown)
        return Test(np.where(shown, beyond, 0.0), beside, squared, self._around)


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
    left = found.after(increment[scene.triangles], freedom.spread(columns)[0] @ cameras)
    before, noise = noise, noise_of(left, weights, unknowns)
    motion = system.motion.times(before / noise)
    system = system_of(free, found, factors, noise, freedom, columns, scale, slides, motion=motion)
    blocks = found.node * (factors / noise)[:, None, None]
    whole = found.clean * found.node.sum(axis=(1, 2))
    alone = np.divide(found.right.sum(axis=1), whole, out=np.zeros(len(whole)), where=whole > 0)
    precision = weights * found.clean * whole / noise
    return LackOfFit(free, increment, system, left, noise, scores * before / noise, blocks, alone, precision)
