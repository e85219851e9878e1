"""Residuals that add up to more than independent ones: a little everywhere, a lot where the elements do not fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.system import System

TOO_MUCH = 3.0  # times the usual squared score of the facets around a node; noise hardly ever makes as much
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
    """

    correlated: float
    fitted: Booleans


def misfit(scene: Scene, found: Facets, weights: Floats, system: System, mixing: Floats) -> Misfit:
    """Return how the residuals add up.

    The ratio of scores to what is expected is taken over the facets around each node. Where that is more than three
    times κ the elements do not fit: a step or a crease runs through them. Facets that touch such a node do not count
    for κ, which is what the others have.

    Parameters
    ----------
    weights : (f,) of the facets over the variance of the residuals
    mixing : see `Freedom.spread`
    """
    squares, expected = _scores(scene, found, weights, system, mixing)
    counted = expected > 0
    if not counted.any():
        return Misfit(1.0, np.ones(len(weights), dtype=bool))
    corners = scene.triangles.ravel()
    sums = [np.bincount(corners, np.repeat(values, 3), minlength=len(scene.nodes)) for values in (squares, expected)]
    ratio = np.divide(sums[0], sums[1], out=np.zeros(len(scene.nodes)), where=sums[1] > 0)
    worst = ratio[scene.triangles].max(axis=1)
    usual = max(1.0, float(np.percentile(worst[counted], FITTING)))
    for _ in range(ROUNDS):
        fitted = counted & (worst <= TOO_MUCH * usual)
        before, usual = usual, max(1.0, float(squares[fitted].sum() / expected[fitted].sum()))
        if usual == before:
            break
    return Misfit(usual, worst <= TOO_MUCH * usual)


def unresolved(scene: Scene, found: Facets, noise: float, fitted: Booleans) -> Floats:
    """Return the standard uncertainty (n,) mm of nodes whose facets the elements do not fit; 0 elsewhere.

    Alone, a facet with the normal matrix K and the score s would move its nodes by K⁻¹ s. For noise of the variance v
    that has the variance v K⁻¹; by what it is more, the facets around a node do not agree about where it is.

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
    touched = np.bincount(corners, np.repeat(~fitted, 3), minlength=n) > 0
    return np.where(touched, np.sqrt(np.maximum(excess / known, 0.0)), 0.0)


def _scores(scene: Scene, found: Facets, weights: Floats, system: System, mixing: Floats) -> tuple[Floats, Floats]:
    """Return of each facet the squared score |J'W r|², and what it would be for independent residuals, (f,).

    That is the trace of K - K* C K*' with K (3, 3) the facet's normal matrix, K* its rows over all unknowns and C the
    covariance of all unknowns: a fit follows its data. Facets that do not count, or less than others, have zeros.
    """
    squares, expected = np.zeros(len(weights)), np.zeros(len(weights))
    trusted = (found.freedom > 0) & (weights >= 0.999 * weights.max())
    space, scale = scene.space, weights[trusted, None, None]
    node, cross = found.node[trusted] * scale, found.cross[trusted] * scale @ mixing
    solved, inverse = system.held
    following, cameras = space.at_corners(scene, system.following)[trusted], system.camera_covariance
    held = space.at_corners(scene, solved)[trusted]
    within = space.blocks(scene, system.motion)[trusted] - held @ inverse @ held.transpose(0, 2, 1)
    within += following @ cameras @ following.transpose(0, 2, 1)
    between = -following @ cameras
    explained = np.einsum("fij,fjk,fik->f", node, within, node)
    explained += 2 * np.einsum("fij,fjk,fik->f", node, between, cross)
    explained += np.einsum("fij,jk,fik->f", cross, cameras, cross)
    squares[trusted] = ((found.right[trusted] * scale[:, :, 0]) ** 2).sum(axis=1)
    expected[trusted] = np.einsum("fii->f", node) - explained
    return squares, expected
