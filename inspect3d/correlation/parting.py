"""Whether faces that are kept together have come apart: how their control points would move by themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.stats import chi2

from inspect3d.arrays import Floats, Integers
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.linear import slides_of, system_of
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.spline_space import SplineSpace
from inspect3d.correlation.system import System

CHANCE = 1e-4  # of noise making faces look as if they had come apart


@dataclass(frozen=True, eq=False)
class Parting:
    """The increment that control points would make from a solution if no faces kept together, to first order.

    Parameters
    ----------
    motion : (n,) mm, of the nodes
    system : of the faces by themselves
    space : its motions
    rows : (n, k), from these to those of the nodes
    left : the facets with the scores and the energy that are left after the increment
    """

    motion: Floats
    system: System
    space: SplineSpace
    rows: sparse.csr_matrix
    left: Facets

    def squared(self, variances: Floats) -> Floats:
        """Return the squared motion (n,) mm² beyond noise, where the solution has `variances` (n,) mm²."""
        noise = np.maximum(self.system.variances(self.rows) - variances, 0.0)
        return np.maximum(self.motion**2 - noise, 0.0)


def parting(
    scene: Scene,
    found: Facets,
    views: Sequence[View],
    weights: Floats,
    freedom: Freedom,
    columns: Integers,
    noise: float,
) -> Parting | None:
    """Return how faces have come apart at a solution in which they keep together; None where nothing proves it.

    By what the increment lowers the energy is, in variances of the noise, chi-square with as many degrees of freedom as
    motions that keep faces together take.

    Parameters
    ----------
    found : what the pictures say about the facets at the solution, by `columns` and in the power 2
    weights : (f,) of the facets
    noise : variance of the residuals, correlated as they are, grey levels²
    """
    space = scene.space
    if not isinstance(space, SplineSpace) or space.apart is None:
        return None
    loose = replace(scene, space=space.apart)
    scale, slides = freedom.scale(views, scene.sample), slides_of(scene, freedom, views)
    system = system_of(loose, found, weights * found.clean**2, noise, freedom, columns, scale, slides)
    right = loose.space.gathered(loose, found.right * (weights * found.clean / noise)[:, None])
    motion, cameras = system.solve(right, np.zeros(freedom.unknowns))
    rows = loose.space.rows(loose)
    if chi2.sf(right @ motion, rows.shape[1] - space.rows(scene).shape[1]) > CHANCE:
        return None
    left = found.after(loose.space.at_corners(loose, motion), freedom.spread(columns)[0] @ cameras)
    return Parting(rows @ motion, system, space.apart, rows, left)
