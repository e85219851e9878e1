"""What the pictures say about every facet at one state of shape and cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.camera import View
from inspect3d.correlation.evaluation import EvaluationPoints
from inspect3d.correlation.picture import Stack
from inspect3d.correlation.scene import Scene


@dataclass(frozen=True, eq=False)
class Facets:
    """Each facet's part of the normal equations; see `inspect3d.correlation.facet_kernel`.

    Parameters
    ----------
    node : (f, 3, 3) normal matrix of the three nodes, grey levels² / mm²
    right : (f, 3) right-hand side
    cross : (f, 3, C) nodes against the camera parameters of all views
    camera, camera_right : (C, C) and (C,), sums over the facets with their weights
    whole, each_right : (f, C, C) and (f, C), the camera block and right-hand side of each facet, or empty
    statistics : (f, 4)
    freedom : (f,) degrees of freedom: points less mean and scale, for each view beyond the first; 0 without contrast
    """

    node: Floats
    right: Floats
    cross: Floats
    camera: Floats
    camera_right: Floats
    whole: Floats
    each_right: Floats
    statistics: Floats
    freedom: Floats

    @property
    def energy(self) -> Floats:
        """Return the weighted sum of squared residuals, (f,) grey levels²."""
        return self.statistics[:, 0]

    @property
    def correlation(self) -> Floats:
        """Return the mean correlation coefficient between the views, (f,); 0 without contrast."""
        return self.statistics[:, 2]

    @property
    def clean(self) -> Floats:
        """Return the share of the curvature that is not gradient noise, (f,), from 0 to 1."""
        return self.statistics[:, 3]

    @cached_property
    def noise(self) -> Floats:
        """Return the mean squared residual per degree of freedom, (f,) grey levels²; infinite without contrast."""
        return np.divide(self.energy, self.freedom, out=np.full(len(self.energy), np.inf), where=self.freedom > 0)

    def after(self, corners: Floats, cameras: Floats) -> Facets:
        """Return what is left, to first order, when the corners have moved by (f, 3) mm and the cameras by (C,)."""
        moved = np.einsum("fij,fj->fi", self.node, corners) + self.cross @ cameras
        statistics = self.statistics.copy()
        statistics[:, 0] += ((moved - 2 * self.right) * corners).sum(axis=1)
        return replace(self, right=self.right - self.clean[:, None] * moved, statistics=statistics)


def facets(
    scene: Scene,
    stack: Stack,
    views: Sequence[View],
    motion: Floats,
    weights: Floats,
    columns: Integers,
    power: int = 1,
    whole: bool = False,
    points: EvaluationPoints | None = None,
    origin: Floats | None = None,
) -> Facets:
    """Return what the pictures say about every facet.

    Parameters
    ----------
    motion : (k,) unknowns of the scene's space
    weights : (f,) in the sums over the cameras
    columns : camera parameters of each view to differentiate by
    power : how often the sums over the cameras take the clean share of the curvature: 0, the curvature as it is; 1,
        the curvature without gradient noise H₀; 2, the information H₀ A⁻¹ H₀ of an estimate that has noisy slopes
    whole : keep each facet's camera block and right-hand side
    points : to compare at, some of the scene's; none: all of them
    origin : (3,) mm, about which the cameras' parameters turn the part, that of the `Freedom`; none: the scene's centre
    """
    from inspect3d.correlation.facet_kernel import CHUNKS, accumulate

    f, size = len(scene.triangles), len(views) * len(columns)
    rig = (
        np.stack([view.camera.matrix for view in views]),
        np.stack([view.camera.distortion for view in views]),
        np.stack([view.camera_from_cad.rotation for view in views]),
        np.stack([view.camera_from_cad.translation for view in views]),
        np.asarray(scene.centre if origin is None else origin),
    )
    points = scene.space.bent(scene, points or scene.points, motion)
    out = (
        np.empty((f, 3, 3)),
        np.empty((f, 3)),
        np.empty((f, 3, size)),
        np.zeros((CHUNKS, size, size)),
        np.zeros((CHUNKS, size)),
        np.zeros((f if whole else 0, size, size)),
        np.zeros((f if whole else 0, size)),
        np.empty((f, 4)),
    )
    accumulate(
        (stack.levels, stack.sizes, stack.cubic, stack.step),
        rig,
        (points.places, points.shapes, points.starts, scene.triangles, scene.normals),
        scene.taking,
        np.ascontiguousarray(scene.space.rows(scene) @ motion),
        weights,
        power,
        columns,
        out,
    )
    statistics = out[7]
    beyond = scene.taking.sum(axis=1) - 1
    freedom = np.where(statistics[:, 1] > 0, statistics[:, 1] - 2.0, 0.0) * beyond
    return Facets(*out[:3], out[3].sum(axis=0), out[4].sum(axis=0), out[5], out[6], statistics, freedom)
