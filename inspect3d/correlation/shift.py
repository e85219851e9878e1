"""A smooth shift of the pictures in the normal equations: what they show of it, and what looks like a deviation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inspect3d.arrays import Floats, Integers, unit
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.systematic import Systematic

SHIFT_X, SHIFT_Y = 8, 9  # the kernel's numbers of a shift of the picture
STEP = 1e-3  # mm


@dataclass(frozen=True, eq=False)
class Shift:
    """What the pictures could show of a smooth shift of each of them, and what of it looks like a deviation.

    Of the 2 v coordinates by which the v pictures of a place are shifted, one combination looks like a motion along the
    normal and two like a slide of all pictures over the surface. What is left, for two views the shift of one against
    the other across the epipolar lines, can be told from a shape. The parts are independent where the coordinates are.

    Parameters
    ----------
    modes : Φ (f, r) px of the facets, see `Systematic.modes`
    shown : Π (f, 2 v, 2 v), the projector on what can be told from a shape
    deviation : (n, r) mm, what looks like a deviation of the nodes, by modes
    """

    modes: Floats
    shown: Floats
    deviation: Floats


@dataclass(frozen=True, eq=False)
class ShiftBlocks:
    """What q numbers that a shift consists of add to the normal equations, by picture, coordinate and mode.

    Parameters
    ----------
    shape : (k, q) against the motions of the shape
    cameras : (m, q) against the unknowns of the cameras
    own : (q, q)
    right : (q,)
    scale : (q,), what moves a picture by about one pixel
    """

    shape: Floats
    cameras: Floats
    own: Floats
    right: Floats
    scale: Floats


def needed_columns(freedom: Freedom, systematic: Systematic | None) -> Integers:
    """Return the camera parameters of each view that the facets' derivatives are needed by."""
    if systematic is None or not freedom.unknowns:
        return freedom.columns
    return np.union1d(freedom.columns, [SHIFT_X, SHIFT_Y])


def shift_of(scene: Scene, views: Sequence[View], systematic: Systematic) -> Shift:
    """Return what the views show of a shift, and what not."""
    slopes = slopes_of(scene, views) * scene.taking[:, :, None, None]
    slopes = slopes.reshape(len(slopes), -1, 3)
    inverse = np.linalg.pinv(slopes)
    seen = np.repeat(scene.taking, 2, axis=1)
    shown = np.eye(seen.shape[1]) * seen[:, None, :] - slopes @ inverse
    by_facet, by_node = systematic.modes(scene)
    size = np.repeat(np.linalg.norm(inverse[:, 2], axis=1)[:, None], 3, axis=1)
    around = scene.gathered(np.stack([size, np.ones_like(size)], axis=2))
    return Shift(by_facet, shown, (around[:, 0] / around[:, 1])[:, None] * by_node)


def slopes_of(scene: Scene, views: Sequence[View]) -> Floats:
    """Return how a motion of the middle of each facet moves it in each picture, (f, v, 2, 3) px/mm.

    Along two unit tangents, across each other, and the normal.
    """
    corners = scene.nodes[scene.triangles]
    centre = corners.mean(axis=1)
    first = unit(corners[:, 1] - corners[:, 0])
    normal = unit(np.cross(first, corners[:, 2] - corners[:, 0]))
    ways = (first, np.cross(normal, first), normal)
    moved = [[(view.project(centre + STEP * way) - view.project(centre)) / STEP for way in ways] for view in views]
    return np.moveaxis(np.array(moved), (0, 1, 2, 3), (1, 3, 0, 2))


def shift_blocks(
    scene: Scene, found: Facets, columns: Integers, mixing: Floats, shift: Shift, weights: Floats, rights: Floats
) -> ShiftBlocks:
    """Return the blocks of what the pictures show.

    Parameters
    ----------
    found : with each facet's camera block, by `columns`
    mixing : see `Freedom.spread`
    weights, rights : (f,) of the facets in the matrices and in the right-hand side
    """
    cross, whole, right = _shown(scene, found, columns, shift)
    at, modes = _places(scene, columns), shift.modes
    weighted = weights[:, None] * modes
    every = range(len(at))
    own = shift.shown @ whole[:, at]
    return ShiftBlocks(
        np.concatenate([scene.space.gathered(scene, cross[:, :, k, None] * weighted[:, None]) for k in every], axis=1),
        np.concatenate([mixing.T @ (whole[:, :, k].T @ weighted) for k in every], axis=1),
        np.block([[modes.T @ (own[:, k, other, None] * weighted) for other in every] for k in every]),
        np.concatenate([modes.T @ (rights * right[:, k]) for k in every]),
        np.full(len(at) * modes.shape[1], 1 / np.sqrt((modes**2).sum(axis=1).mean())),
    )


def without_shift(scene: Scene, found: Facets, columns: Integers, shift: Shift, numbers: Floats) -> Facets:
    """Return what the pictures say about the facets with a shift of them taken back, to first order.

    Parameters
    ----------
    found : with each facet's camera block, by `columns`
    numbers : (q,) the shift, by picture, coordinate and mode
    """
    cross, whole, right = _shown(scene, found, columns, shift)
    sizes = shift.modes @ numbers.reshape(shift.shown.shape[1], -1).T
    moved = np.einsum("fia,fa->fi", cross, sizes)
    turned = np.einsum("fab,fb->fa", shift.shown @ whole[:, _places(scene, columns)], sizes)
    statistics = found.statistics.copy()
    statistics[:, 0] += ((turned - 2 * right) * sizes).sum(axis=1)
    return replace(found, right=found.right - found.clean[:, None] * moved, statistics=statistics)


def _shown(scene: Scene, found: Facets, columns: Integers, shift: Shift) -> tuple[Floats, Floats, Floats]:
    """Return the blocks (f, 3, 2 v), (f, C, 2 v) and (f, 2 v) of nodes, cameras and residuals with what is shown."""
    at = _places(scene, columns)
    right = np.einsum("fa,fab->fb", found.each_right[:, at], shift.shown)
    return found.cross[:, :, at] @ shift.shown, found.whole[:, :, at] @ shift.shown, right


def _places(scene: Scene, columns: Integers) -> Integers:
    """Return where the shifts of the pictures stand among the camera parameters of all views."""
    within = np.searchsorted(columns, [SHIFT_X, SHIFT_Y])
    return (len(columns) * np.arange(scene.taking.shape[1])[:, None] + within).ravel()
