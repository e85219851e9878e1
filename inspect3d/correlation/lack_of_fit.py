"""What a shape that moves by few unknowns cannot follow: what every node by itself would add to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
    """

    scene: Scene
    increment: Floats
    system: System
    left: Facets
    noise: float

    def size(self, within: System, rows: sparse.csr_matrix, times: float) -> Floats:
        """Return the size (n,) mm of the error of the model where there is one beyond doubt, and around; 0 elsewhere.

        Parameters
        ----------
        within : the system of the solution
        rows : (n, k), from its motions to those of the nodes
        times : by how much the variance of the residuals is larger there
        """
        near = self.scene.adjacency + sparse.identity(len(self.increment), format="csr")
        around = sparse.diags(1 / np.asarray(near.sum(axis=1)).ravel()) @ near
        own = sparse.identity(len(self.increment), format="csr")
        mean = around @ self.increment
        variance = times * self.system.variances(own) - within.variances(rows)
        variance_of_mean = times * self.system.variances(around) - within.variances(around @ rows)
        alone = self.increment**2 > ALONE**2 * variance
        sizes = np.where(alone, np.maximum(self.increment**2 - variance, 0.0), 0.0)
        doubted = near @ (alone | (mean**2 > DOUBTED**2 * variance_of_mean)).astype(np.float64) > 0
        sizes = np.maximum(sizes, mean**2)
        return np.where(doubted, np.sqrt(np.maximum(sizes, around @ sizes)), 0.0)


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
    noise = noise_of(left, weights, unknowns)
    system = system_of(free, found, factors, noise, freedom, columns, scale, slides)
    return LackOfFit(free, increment, system, left, noise)
