"""From what the pictures say about the facets to the linear system of shape and cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.shift import ShiftBlocks
from inspect3d.correlation.space import Factored
from inspect3d.correlation.system import System
from inspect3d.register.gauge import FREE
from inspect3d.register.mobility import jacobian, spread

POOR = 3.0


def robust(found: Facets) -> Floats:
    """Return the weight of each facet, (f,): one, or less where it is over three times as noisy as the median."""
    median = np.median(found.noise[np.isfinite(found.noise)])
    return np.minimum(1.0, POOR * median / np.maximum(found.noise, 1e-300))


def noise_of(found: Facets, weights: Floats, unknowns: int) -> float:
    """Return the variance of the residuals, grey levels², for facets of weights (f,) and so many unknowns."""
    freedom = float(weights @ found.freedom) - unknowns
    return float(weights @ found.energy) / max(freedom, 1.0)


def gauge_of(scene: Scene, freedom: Freedom, share: float = FREE) -> Floats:
    """Return orthonormal columns (n, g) of the fields that the unknown poses can imitate.

    They are the motions of the part as a whole and, where each camera has a pose of its own, its growth. What leaves
    the surface in itself is not among them; see `slides_of`.

    Parameters
    ----------
    share : of the stiffest motion's stiffness, up to which a motion is taken to leave the surface in itself
    """
    if freedom.poses == "known":
        return np.zeros((len(scene.nodes), 0))
    left, values, _ = motions_of(scene, freedom)
    return left[:, values**2 > share * values[0] ** 2]


def slides_of(scene: Scene, freedom: Freedom, views: Sequence[View], share: float = FREE) -> Floats:
    """Return the changes of the cameras (m, s) that only let the surface slide in itself.

    The pictures say nothing about them, whatever stiffness the facets of the mesh seem to give them: they are held.

    Parameters
    ----------
    share : of the stiffest motion's stiffness, below which a motion is taken for a slide
    """
    if freedom.poses == "known":
        return np.zeros((freedom.unknowns, 0))
    _, values, right = motions_of(scene, freedom)
    return moving_cameras(scene, freedom, views, right[values**2 <= share * values[0] ** 2])


def moving_cameras(scene: Scene, freedom: Freedom, views: Sequence[View], motions: Floats) -> Floats:
    """Return the changes of the cameras (m, k) that make motions (k, 6) or (k, 7) of the part about its centre."""
    turned = motions.copy()
    turned[:, 3:6] += np.cross(motions[:, :3], freedom.origin - scene.centre)
    bodies = 1 if freedom.poses == "common" else len(views)
    changes = np.zeros((freedom.unknowns, len(motions)))
    for k in range(bodies):
        changes[6 * k : 6 * k + 6] = turned[:, :6].T
        if freedom.poses == "free":  # growth by g about the centre looks like a shift by -g (centre - camera)
            changes[6 * k + 3 : 6 * k + 6] -= np.outer(scene.centre - views[k].centre, turned[:, 6])
    return changes


def motions_of(scene: Scene, freedom: Freedom) -> tuple[Floats, Floats, Floats]:
    """Return the singular values of the normal motions (n, 6) or, with growth, (n, 7); the fields; the motions."""
    length = spread(scene.nodes, np.ones(len(scene.nodes)), scene.centre)
    units = np.array([length] * 3 + [1.0] * 3 + [length] * (freedom.poses == "free"))
    rows = jacobian(scene.nodes, scene.normals, scene.centre)
    if freedom.poses == "free":
        rows = np.column_stack([rows, ((scene.nodes - scene.centre) * scene.normals).sum(axis=1)])
    left, values, right = np.linalg.svd(rows / units, full_matrices=False)
    return left, values, right / units


@dataclass(frozen=True, eq=False)
class Still:
    """How motions in which the surface slides in itself are held where its pictures are.

    Parameters
    ----------
    gauge : (n, g) fields of the other motions, which the shape leaves to the cameras
    slides : (m, s) changes of the cameras that make these
    across : N (m, s), N'p = 0 where the surface keeps still in the mean of the pictures
    """

    gauge: Floats
    slides: Floats
    across: Floats


def system_of(
    scene: Scene,
    found: Facets,
    factors: Floats,
    noise: float,
    freedom: Freedom,
    columns: Integers,
    scale: Floats,
    slides: Floats,
    stiffness: float = 0.0,
    shift: ShiftBlocks | None = None,
    motion: Factored | None = None,
    still: Still | None = None,
) -> System:
    """Return the normal equations.

    Parameters
    ----------
    factors : (f,) weight of each facet times the power of its clean share with which `found` sums over the cameras
    noise : variance of the residuals, grey levels²
    columns : camera parameters of each view in `found`
    scale : (m,) of each camera unknown, what moves the pictures by one pixel; see `Freedom.scale`
    slides : (m, s), see `slides_of`; the step of the cameras, in units of their scale, is at right angles to them
    stiffness : see `inspect3d.correlation.space.plates`
    shift : what the pictures show of a smooth shift of them, as unknowns beside the cameras
    motion : the matrix of the shape factored, where it is known
    still : other slides in place of these, and how they are held
    """
    space, weights = scene.space, (factors / noise)[:, None, None]
    if motion is None:
        motion = space.factored(scene, space.matrix(scene, found.node * weights, stiffness))
    still = still or Still(gauge_of(scene, freedom), slides, slides / scale[:, None] ** 2)
    gauge = space.rows(scene).T @ still.gauge
    mixing, sigmas = freedom.spread(columns)
    cross = space.gathered(scene, found.cross * weights) @ mixing
    camera = mixing.T @ found.camera @ mixing / noise
    if shift is None:
        return System(motion, cross, camera, gauge, 1 / sigmas**2, scale, still.slides, still.across, freedom.redundant)
    count = len(shift.scale)
    return System(
        motion,
        np.hstack([cross, shift.shape]),
        np.block([[camera, shift.cameras], [shift.cameras.T, shift.own]]),
        gauge,
        np.concatenate([1 / sigmas**2, np.ones(count)]),
        np.concatenate([scale, shift.scale]),
        np.pad(still.slides, ((0, count), (0, 0))),
        np.pad(still.across, ((0, count), (0, 0))),
        np.pad(freedom.redundant, ((0, count), (0, 0))),
        count,
    )
