"""The alignment of a cloud from any pose: search, refine, choose."""

from __future__ import annotations

from dataclasses import dataclass, field

from inspect3d.register.choice import Choice, choose
from inspect3d.register.field import Field
from inspect3d.register.icp import RobustIcp, fitted
from inspect3d.register.search import PoseSearch, distinct
from inspect3d.register.smooth import Smooth
from inspect3d.register.thinned import Thinned


@dataclass(frozen=True)
class BlindStart:
    """Find the pose of a cloud on a surface without any hint.

    Where the search tries scales, the scale is fitted in every refinement. The cloud should then come in the size of
    the CAD, roughly, since the distances that matter are shares of the CAD's diagonal at the cloud's size.

    Parameters
    ----------
    search : proposes poses
    tried : proposals refined on a few points
    kept : of those, refined on all; those that cost more than twice as much as the best are not, but for the first few
    named : poses that are refined however bad they are, to be told of
    """

    search: PoseSearch = field(default_factory=PoseSearch)
    tried: int = 20
    kept: int = 8
    named: int = 3

    @classmethod
    def of_unknown_scale(cls) -> BlindStart:
        """Return the start of a cloud that is between a fifth and twice the size it comes in."""
        return cls(PoseSearch(guesses=400_000, scales=(0.2, 2.0)))

    def __call__(self, cloud: Thinned, smooth: Smooth, grid: Field) -> Choice:
        """Return the pose cad_from_cloud the points choose, with its equals, its rivals and the others."""
        surface = smooth.surface
        size = surface.diagonal
        width = 3e-3 * size
        few = cloud.every(4)
        grows = self.search.scales is not None
        rough = RobustIcp(steps=10, first_width=0.03 * size, grows=grows)
        fits = [rough(few, surface, pose) for pose in self.search(cloud, surface, grid)[: self.tried]]
        fits.sort(key=lambda fit: fit.cost(width).mean())
        most = 2 * fits[0].cost(width).mean() + 0.02
        poses = [fit.pose for k, fit in enumerate(fits) if k < self.named or fit.cost(width).mean() < most]
        poses = distinct(poses, cloud.points, 0.01 * size)[: self.kept]
        fits = [RobustIcp(steps=40, still=0.01, grows=grows)(cloud, surface, pose) for pose in poses]
        fits.sort(key=lambda fit: fit.cost(width).mean())
        poses = distinct([fit.pose for fit in fits], cloud.points, 0.005 * size)
        return choose([fitted(cloud, surface, pose) for pose in poses], smooth, cloud.points, grows)
