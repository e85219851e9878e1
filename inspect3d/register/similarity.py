"""Motions of a body that is scaled first: `cad_from_cloud(points)` lies in the CAD frame, at its size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.pose import Pose


@dataclass(frozen=True, eq=False)
class Similarity:
    """A scaling and a rigid motion: y = R (scale x) + t.

    Parameters
    ----------
    pose : R and t
    scale : positive; 1 for a rigid motion
    """

    pose: Pose
    scale: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.scale) and self.scale > 0):
            raise ValueError(f"the scale of a similarity is positive, not {self.scale}")

    @classmethod
    def identity(cls) -> Similarity:
        """Return the motion that moves nothing."""
        return cls(Pose.identity())

    @classmethod
    def small(cls, motion: Floats, origin: Floats) -> Similarity:
        """Return the motion (rx, ry, rz, tx, ty, tz, and perhaps growth; rad, mm, relative) about `origin` (3,) mm."""
        rigid = Pose.small(motion[:6], origin)
        growth = float(motion[6]) if len(motion) > 6 else 0.0
        return cls(Pose(rigid.rotation, rigid.translation - growth * rigid.rotation @ origin), 1.0 + growth)

    @property
    def matrix(self) -> Floats:
        """Return the homogeneous matrix (4, 4) [scale R t; 0 1]."""
        matrix = self.pose.matrix
        matrix[:3, :3] *= self.scale
        return matrix

    @property
    def angle(self) -> float:
        """Return the angle of the rotation, rad."""
        return self.pose.angle

    def inverse(self) -> Similarity:
        """Return the motion back."""
        back = self.pose.inverse()
        return Similarity(Pose(back.rotation, back.translation / self.scale), 1.0 / self.scale)

    def turned(self, vectors: Floats) -> Floats:
        """Return directions (n, 3) in the other frame: turned, neither shifted nor scaled."""
        return self.pose.turned(vectors)

    def __call__(self, points: Floats) -> Floats:
        """Return points (n, 3) in the other frame."""
        return self.pose(self.scale * points)

    def __matmul__(self, other: Similarity) -> Similarity:
        """Return the chain: `c_from_b @ b_from_a` is `c_from_a`."""
        shift = self(other.pose.translation[None])[0]
        return Similarity(Pose(self.pose.rotation @ other.pose.rotation, shift), self.scale * other.scale)
