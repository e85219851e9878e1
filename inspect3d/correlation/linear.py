"""From what the pictures say about the facets to the linear system of shape and cameras."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.system import System
from inspect3d.register.mobility import jacobian, spread

SUPPORT = 1e-6
RIDGE = 1e-9
POOR = 3.0


def robust(found: Facets) -> Floats:
    """Return the weight of each facet, (f,): one, or less where it is over three times as noisy as the median."""
    median = np.median(found.noise[np.isfinite(found.noise)])
    return np.minimum(1.0, POOR * median / np.maximum(found.noise, 1e-300))


def noise_of(found: Facets, weights: Floats, unknowns: int) -> float:
    """Return the variance of the residuals, grey levels², for facets of weights (f,) and so many unknowns."""
    freedom = float(weights @ found.freedom) - unknowns
    return float(weights @ found.energy) / max(freedom, 1.0)


def gauge_of(scene: Scene, freedom: Freedom) -> Floats:
    """Return orthonormal columns (n, g) of the fields that the unknown poses can imitate.

    They are the motions of the part as a whole and, where each camera has a pose of its own, its growth. What leaves
    the surface in itself is not among them.
    """
    n = len(scene.nodes)
    if freedom.poses == "known":
        return np.zeros((n, 0))
    length = spread(scene.nodes, np.ones(n), scene.centre)
    rows = jacobian(scene.nodes, scene.normals, scene.centre) / np.array([length] * 3 + [1.0] * 3)
    if freedom.poses == "free":
        rows = np.column_stack([rows, ((scene.nodes - scene.centre) * scene.normals).sum(axis=1) / length])
    left, values, _ = np.linalg.svd(rows, full_matrices=False)
    return left[:, values > 1e-6 * values[0]]


def stiffened(scene: Scene, values: Floats, stiffness: float) -> tuple[Floats, Floats]:
    """Return a nodal matrix with a plate under it, and the plate, both in the scene's pattern.

    Parameters
    ----------
    stiffness : of the plate, in medians of the diagonal. A millionth of that stays always, to carry nodes that show no
        texture, and a billionth of a ridge
    """
    every = np.arange(len(scene.nodes))
    diagonal = scene.position(every, every)
    stiff_ones = values[diagonal][values[diagonal] > 0]
    median = float(np.median(stiff_ones)) if len(stiff_ones) else 1.0
    plate = stiffness * median * scene.plate
    stiff = values + plate + SUPPORT * median * scene.plate
    stiff[diagonal] += RIDGE * median
    return stiff, plate


def system_of(
    scene: Scene,
    found: Facets,
    factors: Floats,
    noise: float,
    freedom: Freedom,
    columns: Integers,
    scale: Floats,
    stiffness: float = 0.0,
) -> System:
    """Return the normal equations.

    Parameters
    ----------
    factors : (f,) weight of each facet times the power of its clean share with which `found` sums over the cameras
    noise : variance of the residuals, grey levels²
    columns : camera parameters of each view in `found`
    scale : (m,) of each camera unknown, what moves the pictures by one pixel; see `Freedom.scale`
    stiffness : see `stiffened`
    """
    values, _ = stiffened(scene, scene.assembled(found.node * (factors / noise)[:, None, None]), stiffness)
    nodal, gauge = scene.ordering.factor(values), gauge_of(scene, freedom)
    mixing, sigmas = freedom.spread(columns)
    cross = scene.gathered(found.cross * (factors / noise)[:, None, None]) @ mixing
    camera = mixing.T @ found.camera @ mixing / noise + np.diag(1 / sigmas**2)
    return System(nodal, cross, camera, gauge, scale)
