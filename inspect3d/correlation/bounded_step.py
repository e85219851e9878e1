"""A step of the cameras before a shape that is held, no longer than the pictures can tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.scene import Scene

VAGUE = 1e-6  # share of the stiffest motion's stiffness; softer ones are held


def bounded_step(
    scene: Scene, views: Sequence[View], freedom: Freedom, firm: Floats, matrix: Floats, right: Floats, farthest: float
) -> Floats:
    """Return the step (m,) of the cameras, damped until it moves the pictures of the part no farther than a bound.

    Where little but planes is seen, the pictures hardly tell a slide of all cameras along them, and what else is wrong
    asks for slides of many pixels.

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
    while True:
        cameras: Floats = modes @ (pulls / (values + damping * values[-1]))
        there = np.concatenate([view.project(scene.sample) for view in freedom.moved(views, cameras)])
        if not ((there - here) ** 2).sum(axis=1).mean() > farthest**2:
            return cameras
        damping = max(2 * damping, VAGUE)
