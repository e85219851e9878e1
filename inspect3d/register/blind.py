"""The alignment of a cloud from any pose: search, refine, choose."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from inspect3d.pose import Pose
from inspect3d.register.choice import Choice, choose
from inspect3d.register.field import Field
from inspect3d.register.icp import Fit, RobustIcp, fitted
from inspect3d.register.search import PoseSearch, distinct
from inspect3d.register.smooth import Smooth
from inspect3d.register.thinned import Thinned


@dataclass(frozen=True)
class BlindStart:
    """Find the pose of a cloud on a surface without any hint.

    Parameters
    ----------
    search : proposes poses
    tried : proposals refined on a few points
    kept : of those, refined on all
    """

    search: PoseSearch = field(default_factory=PoseSearch)
    tried: int = 24
    kept: int = 8

    def __call__(self, cloud: Thinned, smooth: Smooth, grid: Field) -> Choice:
        """Return the pose cad_from_cloud the points choose, with its equals, its rivals and the others."""
        surface = smooth.surface
        size = surface.diagonal
        poses = self.search(cloud, surface, grid)[: self.tried]
        few = cloud.every(4)
        rough = RobustIcp(steps=12, first_width=0.03 * size)
        poses = _ranked([rough(few, surface, pose) for pose in poses], 3e-3 * size)
        poses = distinct(poses, cloud.points, 0.01 * size)[: self.kept]
        poses = _ranked([RobustIcp(steps=40, still=0.01)(cloud, surface, pose) for pose in poses], 3e-3 * size)
        poses = distinct(poses, cloud.points, 0.005 * size)
        return choose([fitted(cloud, surface, pose) for pose in poses], smooth, cloud.points)


def _ranked(fits: list[Fit], width: float) -> list[Pose]:
    order = np.argsort([fit.cost(width).mean() for fit in fits], kind="stable")
    return [fits[k].pose for k in order]
