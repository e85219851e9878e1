"""Residuals that add up to more than independent ones: a little everywhere, a lot where the elements do not fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from inspect3d.arrays import Booleans, Floats
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.system import System

CHANCE = 1e-4  # of noise making a node look as if the elements did not fit around it
SELDOM = 0.03  # the same beside places where they do not fit
FITTING = 10.0  # per cent of the facets that fit at least
ROUNDS = 10
RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Misfit:
    """How the residuals of the facets add up.

    Parameters
    ----------
    correlated : κ >= 1, squared scores J'W r of the facets over what they would be for independent residuals, where the
        elements fit
    fitted : (f,), whether the elements fit there
    doubted : (n,), nodes around which noise would seldom add up to as much
    """

    correlated: float
    fitted: Booleans
    doubted: Booleans


def misfit(scene: Scene, found: Facets, weights: Floats, system: System, mixing: Floats) -> Misfit:
    """Return how the residuals add up.

    The ratio of scores to what is expected is taken over the facets around each node. Where it is more than κ times
    what noise reaches in one node of ten thousand, the elements do not fit: a step or a crease runs through them.
    Facets that touch such a node do not count for κ, which is what the others have.

    Parameters
    ----------
    weights : (f,) of the facets over the variance of the residuals
    mixing : see `Freedom.spread`
    """
    squares, expected, spread = _scores(scene, found, weights, system, mixing)
    counted = expected > 0
    if not counted.any():
        return Misfit(1.0, np.ones(len(weights), dtype=bool), np.zeros(len(scene.nodes), dtype=bool))
    corners, n = scene.triangles.ravel(), len(scene.nodes)
    sums = [np.bincount(corners, np.repeat(values, 3), minlength=n) for values in (squares, expected, spread)]
    known = sums[2] > 0
    ratio = np.divide(sums[0], sums[1], out=np.zeros(n), where=known)
    degrees = np.maximum(1.0, np.divide(sums[1] ** 2, sums[2], out=np.ones(n), where=known))
    beyond = ratio * degrees / chi2.isf(CHANCE, degrees)
    usual = max(1.0, float(np.percentile(ratio[scene.triangles].max(axis=1)[counted], FITTING)))
    worst = beyond[scene.triangles].max(axis=1)
    for _ in range(ROUNDS):
        fitted = counted & (worst <= usual)
        before, usual = usual, max(1.0, float(squares[fitted].sum() / expected[fitted].sum()))
        if usual == before:
            break
    return Misfit(usual, worst <= usual, chi2.sf(ratio * degrees / usual, degrees) < SELDOM)


def unresolved(scene: Scene, found: Facets, noise: float, fitted: Booleans) -> Floats:
    """Return the standard uncertainty (n,) mm of nodes whose facets the elements do not fit; 0 elsewhere.

    Alone, a facet with the normal matrix K and the score s would move its nodes by K⁻¹ s. For noise of the variance v
    that has the variance v K⁻¹; by what it is more, the facets around a node do not agree about where it is. A few
    facets tell that badly: a node among facets of which none fits has the mean over its neighbours where that is more,
    and one that facets which fit touch as well has it only where noise seldom does as much.

    Parameters
    ----------
    noise : v, for facets of the weight one
    """
    n, corners = len(scene.nodes), scene.triangles.ravel()
    ridge = RIDGE * np.trace(found.node, axis1=1, axis2=2) + np.finfo(np.float64).tiny
    inverse = np.linalg.inv(found.node + ridge[:, None, None] * np.eye(3))
    alone = np.einsum("fij,fj->fi", inverse, found.right).ravel()
    precision = 1 / (noise * np.einsum("fii->fi", inverse).ravel())
    excess = np.bincount(corners, precision * alone**2 - 1, minlength=n)
    known = np.bincount(corners, precision, minlength=n)
    facets = np.bincount(corners, minlength=n)
    unfitted = np.bincount(corners, np.repeat(~fitted, 3), minlength=n)
    wide = [np.bincount(corners, np.repeat(v[scene.triangles].sum(axis=1), 3), minlength=n) for v in (excess, known)]
    within = np.maximum(excess / known, wide[0] / wide[1])
    clear = (unfitted > 0) & (excess > chi2.isf(SELDOM, facets) - facets)
    squared = np.where(unfitted == facets, within, np.where(clear, excess / known, 0.0))
    return np.sqrt(np.maximum(squared, 0.0))


def _scores(
    scene: Scene, found: Facets, weights: Floats, system: System, mixing: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return of each facet the squared score |J'W r|², what it would be for independent residuals, and its spread.

    For those the score has the covariance M = K - K* C K*' with K (3, 3) the facet's normal matrix, K* its rows over
    all unknowns and C the covariance of all unknowns: a fit follows its data. Expected is tr M, and the spread, half
    the variance, tr M². Sums over facets compare with chi-square of (sum tr M)² / (sum tr M²) degrees of freedom.
    Facets that do not count, or less than others, have zeros.

    Notes
    -----
    F. E. Satterthwaite, "An approximate distribution of estimates of variance components", Biometrics Bulletin 2, 1946.
    """
    squares, expected, spread = np.zeros((3, len(weights)))
    trusted = (found.freedom > 0) & (weights >= 0.999 * weights.max())
    space, scale = scene.space, weights[trusted, None, None]
    node, cross = found.node[trusted] * scale, found.cross[trusted] * scale @ mixing
    solved, inverse = system.held
    following, cameras = space.at_corners(scene, system.following)[trusted], system.camera_covariance
    held = space.at_corners(scene, solved)[trusted]
    within = space.blocks(scene, system.motion)[trusted] - held @ inverse @ held.transpose(0, 2, 1)
    within += following @ cameras @ following.transpose(0, 2, 1)
    between = node @ following @ cameras @ cross.transpose(0, 2, 1)
    explained = node @ within @ node - between - between.transpose(0, 2, 1)
    explained += cross @ cameras @ cross.transpose(0, 2, 1)
    left = node - explained
    squares[trusted] = ((found.right[trusted] * scale[:, :, 0]) ** 2).sum(axis=1)
    expected[trusted] = np.einsum("fii->f", left)
    spread[trusted] = (left**2).sum(axis=(1, 2))
    return squares, expected, spread
