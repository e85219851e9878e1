"""How sure the shape is: noise, correlated residuals, unknown cameras and a smooth systematic shift of the pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats, Integers
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.linear import noise_of, slides_of, system_of
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.system import System

SHIFT_X, SHIFT_Y = 8, 9
LANDMARKS, RANK = 600, 1e-4


@dataclass(frozen=True)
class Systematic:
    """A smooth shift of each picture that nothing explains, stated rather than estimated.

    Parameters
    ----------
    size : px, standard deviation of each coordinate in each picture
    length : mm over the part, of its Gaussian correlation exp(-d² / 2 L²)
    """

    size: float
    length: float


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """The covariance T (C + F F') T' of the smoothed deviation of the scene's nodes, in mm².

    Parameters
    ----------
    system : the information of the pictures and priors; its inverse is C
    shifts : F (n, r), the response of the shape to the systematic field
    smoother : T (n, n)
    noise : variance of the residuals, grey levels²
    correlated : κ >= 1, by which the residuals of neighbouring points add up to more than if they were independent
    """

    system: System
    shifts: Floats
    smoother: sparse.csr_matrix
    noise: float
    correlated: float

    @cached_property
    def variances(self) -> Floats:
        """Return the diagonal, (n,) mm²."""
        return self.system.variances(self.smoother) + ((self.smoother @ self.shifts) ** 2).sum(axis=1)

    def covariance(self, columns: Floats) -> Floats:
        """Return the covariance times columns (n, k)."""
        back = self.smoother.T @ columns
        return self.smoother @ (self.system.covariance(back) + self.shifts @ (self.shifts.T @ back))

    def variances_without(self, modes: Floats, solver: Floats) -> Floats:
        """Return the diagonal for the field less its modes, (I - J M) v: J = `modes` (n, k) and M = `solver` (k, n)."""
        crossed = self.covariance(np.ascontiguousarray(solver.T))
        between = np.einsum("ij,jk,ik->i", modes, solver @ crossed, modes)
        return self.variances - 2 * np.einsum("ij,ij->i", modes, crossed) + between


def needed_columns(freedom: Freedom, systematic: Systematic | None) -> Integers:
    """Return the camera parameters of each view that `uncertainty` needs the facets' derivatives by."""
    return freedom.columns if systematic is None else np.union1d(freedom.columns, [SHIFT_X, SHIFT_Y])


def uncertainty(
    scene: Scene,
    found: Facets,
    views: Sequence[View],
    weights: Floats,
    freedom: Freedom,
    systematic: Systematic | None,
) -> Uncertainty:
    """Return how sure a solution is.

    The curvature H₀ = c A, with c the clean share of each facet's curvature A, is that of noiseless gradients; the
    estimate H₀⁻¹ J'W e has the covariance H₀⁻¹ A H₀⁻¹ = (c² A)⁻¹ for independent noise of the variance
    v = sum w r² / (degrees of freedom), and κ times that for residuals that are not.

    Parameters
    ----------
    found : what the pictures say about the facets without blur, by `needed_columns` and in the power 2, with each
        facet's camera block where there is a systematic field
    weights : (f,) of the facets
    systematic : the field to propagate; its response is that of the estimate to a shift of picture k, H₀⁻¹ J'W h_k
    """
    columns = needed_columns(freedom, systematic)
    noise = noise_of(found, weights, len(scene.nodes) + freedom.unknowns)
    factors = weights * found.clean**2
    scale, slides = freedom.scale(views, scene.sample), slides_of(scene, freedom, views)
    first = system_of(scene, found, factors, noise, freedom, columns, scale, slides)
    correlated = _correlated(scene, found, weights / noise, first, freedom.spread(columns)[0])
    system = first
    if correlated > 1:
        system = system_of(scene, found, factors, noise * correlated, freedom, columns, scale, slides)
    shifts = np.zeros((len(scene.nodes), 0))
    if systematic is not None:
        shares = weights * found.clean / (noise * correlated)
        shifts = _shifts(scene, found, shares, system, freedom.spread(columns)[0], columns, systematic)
    return Uncertainty(system, shifts, scene.smoother(weights), noise, correlated)


def _correlated(scene: Scene, found: Facets, weights: Floats, system: System, mixing: Floats) -> float:
    """Return κ: the facets' scores J'W r squared, over what they would be for independent residuals.

    That is the trace of K - K* C K*' with K (3, 3) the facet's normal matrix, K* its rows over all unknowns and C the
    covariance of all unknowns: a fit follows its data.
    """
    trusted = (found.freedom > 0) & (weights >= 0.999 * weights.max())
    corners = scene.triangles[trusted]
    scale = weights[trusted, None, None]
    scores = found.right[trusted] * scale[:, :, 0]
    node, cross = found.node[trusted] * scale, found.cross[trusted] * scale @ mixing
    solved, inverse = system.held
    following, cameras = system.following[corners], system.camera_covariance
    within = system.nodal.blocks(corners) - solved[corners] @ inverse @ solved[corners].transpose(0, 2, 1)
    within += following @ cameras @ following.transpose(0, 2, 1)
    between = -following @ cameras
    explained = np.einsum("fij,fjk,fik->", node, within, node)
    explained += 2 * np.einsum("fij,fjk,fik->", node, between, cross)
    explained += np.einsum("fij,jk,fik->", cross, cameras, cross)
    expected = np.einsum("fii->", node) - explained
    return max(1.0, float((scores**2).sum() / expected))


def _shifts(
    scene: Scene,
    found: Facets,
    shares: Floats,
    system: System,
    mixing: Floats,
    columns: Integers,
    systematic: Systematic,
) -> Floats:
    """Return the response F (n, r) of the shape to the modes of the systematic field, by picture and coordinate."""
    fields = systematic.size * _modes(scene.nodes[scene.triangles].mean(axis=1), systematic.length)
    c = len(columns)
    responses = []
    for view in range(scene.taking.shape[1]):
        for column in (SHIFT_X, SHIFT_Y):
            at = view * c + int(np.searchsorted(columns, column))
            weighted = shares[:, None] * fields
            nodal = scene.gathered(found.cross[:, :, at, None] * weighted[:, None, :])
            cameras = mixing.T @ (found.whole[:, :, at].T @ weighted)
            responses.append(system.solve(nodal, cameras)[0])
    return np.concatenate(responses, axis=1)


def _modes(centres: Floats, length: float) -> Floats:
    """Return Φ (f, r) with Φ Φ' = exp(-d² / 2 L²) between the centres (f, 3), from landmarks among them (Nyström)."""
    chosen = centres[np.linspace(0, len(centres) - 1, min(LANDMARKS, len(centres))).astype(np.int64)]
    values, vectors = np.linalg.eigh(_gaussian(chosen, chosen, length))
    kept = values > RANK * values[-1]
    return _gaussian(centres, chosen, length) @ (vectors[:, kept] / np.sqrt(values[kept]))


def _gaussian(a: Floats, b: Floats, length: float) -> Floats:
    squared = ((a[:, None, :] - b[None, :, :]) ** 2).sum(axis=2)
    return np.exp(-squared / (2 * length**2))
