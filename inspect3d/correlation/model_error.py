"""What the splines of a model miss of a part: how large it is at every node, and which nodes it concerns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.lack_of_fit import LackOfFit, lack_of_fit
from inspect3d.correlation.linear import slides_of, system_of
from inspect3d.correlation.misfit import Misfit, unresolved
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.parting import parting
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.space import Factored
from inspect3d.correlation.spline_space import SplineSpace

MOST = 0.5  # share of the nodes of a face that are missed, from which on all of them are
FEWEST, MOSTLY = 3, 0.5  # nodes that prove a step, and their share of those that prove any error, at the least


@dataclass(frozen=True, eq=False)
class ModelError:
    """An error m m' ∘ A A' + g g' of the model, mm², and where it is.

    Parameters
    ----------
    rough : m (n,) mm, with the sign of what is missed
    gap : g (n,) mm, by which faces that were kept together have come apart
    alike : A (n, n), rows of length one; see `LackOfFit.alike`
    missed : (n,), nodes around which splines do not follow the part
    """

    rough: Floats
    gap: Floats
    alike: sparse.csr_matrix
    missed: Booleans

    @property
    def parted(self) -> bool:
        """Tell whether faces that were kept together have come apart."""
        return bool(self.gap.any())

    @property
    def variances(self) -> Floats:
        """Return the diagonal, (n,) mm²."""
        return self.rough**2 + self.gap**2

    def covariance(self, columns: Floats) -> Floats:
        """Return it times columns (n, k)."""
        rough = self.rough[:, None] * columns
        return self.rough[:, None] * (self.alike @ (self.alike.T @ rough)) + np.outer(self.gap, self.gap @ columns)


def model_error(
    scene: Scene,
    found: Facets,
    views: Sequence[View],
    weights: Floats,
    freedom: Freedom,
    columns: Integers,
    lack: LackOfFit,
    summed: Misfit,
    noise: float,
    motion: Floats,
    factored: Factored,
) -> ModelError:
    """Return what splines miss of a part.

    Where faces have come apart beyond doubt, that is one error of known size, and what else is missed is looked for
    beyond it. On a step facets do not fit whatever their nodes do, and the map cannot tell which side of it a node is
    on: what is missed is as large as the map is uneven over the node and its neighbours. A step goes on from there as
    far as the map stays half as uneven.

    Parameters
    ----------
    found : what the pictures say about the facets at the solution, by `columns` and in the power 2
    weights : (f,) of the facets
    freedom : of cameras that are held
    lack, summed : of the nodes by themselves
    noise : variance of the residuals, correlated as they are, grey levels²
    motion : (k,) mm, the solution
    factored : the matrix of its motions
    """
    space = scene.space
    assert isinstance(space, SplineSpace)
    scale, slides = freedom.scale(views, scene.sample), slides_of(scene, freedom, views)
    factors = weights * found.clean**2
    within = system_of(scene, found, factors, noise, freedom, columns, scale, slides, motion=factored)
    times, gaps = noise / lack.noise, np.zeros(len(scene.nodes))
    plain, sign = within.variances(space.rows(scene)), np.ones(len(scene.nodes))
    parted = parting(scene, found, views, weights, freedom, columns, noise)
    if parted is not None:
        gaps, sign = parted.squared(plain), np.sign(parted.motion)
        lack = lack_of_fit(scene, parted.left, views, weights, freedom, columns)
        within, space = parted.system, parted.space
    strained = unresolved(scene, lack.left, noise, summed.fitted) ** 2
    squared, proven = lack.squared(within, space, times)
    squared = np.maximum(squared, strained)
    missed = _around(lack, (squared > 0) | (gaps > plain))
    uneven = _spread(lack, scene.space.rows(scene) @ motion)
    on_step = _around(lack, (missed & summed.doubted) | _steps(lack, uneven, proven, summed.doubted))
    squared = np.maximum(squared, np.where(on_step, uneven, 0.0))
    missed |= on_step
    patch = space.patch
    share = np.bincount(patch, missed) / np.maximum(np.bincount(patch), 1)
    rough = lack.sign * np.sqrt(np.maximum(squared - gaps, 0.0))
    return ModelError(rough, sign * np.sqrt(gaps), lack.alike, missed | (share > MOST)[patch])


def _around(lack: LackOfFit, some: Booleans) -> Booleans:
    """Tell which nodes are some, or neighbours of them."""
    return np.asarray(lack.near @ some.astype(np.float64) > 0)


def _steps(lack: LackOfFit, uneven: Floats, proven: Booleans, doubted: Booleans) -> Booleans:
    """Tell which nodes (n,) lie on steps: connected, about as uneven as where facets prove one.

    Parameters
    ----------
    uneven : (n,) mm², the variance of the map around each node
    proven, doubted : (n,), see `LackOfFit.squared` and `Misfit`
    """
    seeds = proven & doubted
    if not seeds.any():
        return seeds
    steep = np.flatnonzero(uneven > np.median(uneven[seeds]) / 4)
    number, part = connected_components(lack.near[steep][:, steep], directed=False)
    counts = [np.bincount(part, some[steep], minlength=number) for some in (proven, seeds)]
    on_step = np.zeros(len(uneven), dtype=bool)
    on_step[steep] = ((counts[1] >= FEWEST) & (counts[1] >= MOSTLY * counts[0]))[part]
    return on_step


def _spread(lack: LackOfFit, deviation: Floats) -> Floats:
    """Return the variance (n,) of a deviation over each node and its neighbours."""
    number = np.asarray(lack.near.sum(axis=1)).ravel()
    return np.maximum(lack.near @ deviation**2 / number - (lack.near @ deviation / number) ** 2, 0.0)
