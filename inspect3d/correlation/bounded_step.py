"""A step no longer than the pictures can tell: of the cameras before a shape that is held, or of both."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.state import State
from inspect3d.register.mobility import spread

LARGEST = 0.1  # of the extent of what is seen: turns much beyond a tenth of a radian are no longer linear
LONGEST = 2.0  # times the bound, of one node
SMALL = 1e-12  # px
VAGUE = 1e-6  # share of the stiffest motion's stiffness; softer ones are held


def bounded_step(
    scene: Scene, views: Sequence[View], freedom: Freedom, firm: Floats, matrix: Floats, right: Floats, farthest: float
) -> Floats:
    """Return the step (m,) of the cameras, damped until it moves the pictures of the part no farther than a bound.

    Where little but planes is seen, the pictures hardly tell a slide of all cameras along them, and what else is wrong
    asks for slides of many pixels. Nor do they tell well how each camera goes round the part: it moves before none of
    them by more than a tenth of its extent.

    Parameters
    ----------
    firm, matrix : motions of the cameras that are not held, (m, k), and their stiffness, (k, k)
    right : (m,)
    farthest : px, rms over the part and the pictures

    Notes
    -----
    K. Levenberg, "A method for the solution of certain non-linear problems in least squares", Quarterly of Applied
    Mathematics 2, 1944.
    """
    values, modes = np.linalg.eigh(matrix)
    told = values > VAGUE * values[-1]
    values, modes = values[told], firm @ modes[:, told]
    pulls, damping = modes.T @ right, 0.0
    here = np.concatenate([view.project(scene.sample) for view in views])

    def far(cameras: Floats) -> bool:
        if reach(scene, cameras, freedom) > LARGEST * scene.extent:
            return True
        there = np.concatenate([view.project(scene.sample) for view in freedom.moved(views, cameras)])
        return bool(((there - here) ** 2).sum(axis=1).mean() > farthest**2)

    while far(cameras := modes @ (pulls / (values + damping * values[-1]))):
        damping = max(2 * damping, VAGUE)
    return cameras


def bounded(
    scene: Scene, state: State, freedom: Freedom, shape: Floats, cameras: Floats, farthest: float
) -> tuple[Floats, Floats]:
    """Return a step of shape and cameras, shortened until the pictures move apart by no more than a bound.

    What moves all pictures alike, or hardly moves them, may go as far as it likes. Of nodes that each stand for one
    unknown, none moves the pictures apart by more than twice the bound: a few facets by themselves, seen steeply, may
    ask for many times that.

    Parameters
    ----------
    shape : (k,) mm, of the unknowns of the scene's space
    cameras : (m,)
    farthest : px, rms over the nodes and the pictures, from where a node goes in the mean of the pictures
    """
    here = scene.nodes + state.deviation[:, None] * scene.normals
    there = here + (scene.space.rows(scene) @ shape)[:, None] * scene.normals
    views = zip(state.views, freedom.moved(state.views, cameras), strict=True)
    moved = np.stack([now.project(there) - then.project(here) for then, now in views])
    apart = np.sqrt(((moved - moved.mean(axis=0)) ** 2).sum(axis=2).mean(axis=0))
    share = min(1.0, farthest / max(float(np.sqrt((apart**2).mean())), SMALL))
    each = 1.0 if scene.space.confined else np.minimum(1.0, LONGEST * farthest / np.maximum(share * apart, SMALL))
    return share * each * shape, share * cameras


def reach(scene: Scene, cameras: Floats, freedom: Freedom) -> float:
    """Return how far a step of the poses moves the part before a camera, mm."""
    if freedom.poses == "known":
        return 0.0
    motions = freedom.spread(np.arange(6))[0] @ cameras
    length = spread(scene.nodes, np.ones(len(scene.nodes)), scene.centre)
    return float(np.abs(motions.reshape(-1, 6) * np.array([length] * 3 + [1.0] * 3)).max())
