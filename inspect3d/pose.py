"""Rigid motions, named after both frames: `cad_from_scan(points_scan)` lies in the CAD frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from inspect3d.arrays import Floats, floats

UNIT = np.eye(3)
ADMITTED = 1e-6 + 1e-5 * UNIT  # by how much R R' may differ from it
EXACT = 2e-15  # and by how much the rotation is not replaced by the nearest proper one


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid motion: y = R x + t.

    Parameters
    ----------
    rotation : (3, 3), proper
    translation : (3,) mm
    """

    rotation: Floats
    translation: Floats

    def __post_init__(self) -> None:
        rotation = floats(self.rotation, "rotation", 3, 3)
        off = np.abs(rotation @ rotation.T - UNIT)
        if (off > ADMITTED).any() or np.linalg.det(rotation) < 0:
            raise ValueError("the rotation of a pose is not a proper rotation matrix")
        if off.max() > EXACT:
            u, _, vt = np.linalg.svd(rotation)
            rotation = floats(u @ vt, "rotation", 3, 3)
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", floats(self.translation, "translation", 3))

    @classmethod
    def identity(cls) -> Pose:
        """Return the motion that moves nothing."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_matrix(cls, matrix: Floats) -> Pose:
        """Return the motion of a homogeneous matrix (4, 4) [R t; 0 1]."""
        matrix = floats(matrix, "pose matrix", 4, 4)
        if not np.allclose(matrix[3], [0, 0, 0, 1]):
            raise ValueError("the last row of a pose matrix is 0 0 0 1")
        return cls(matrix[:3, :3], matrix[:3, 3])

    @classmethod
    def small(cls, motion: Floats, origin: Floats) -> Pose:
        """Return the motion (rx, ry, rz, tx, ty, tz; rad, mm) about an origin (3,) mm: y = R (x - o) + o + t."""
        motion = np.asarray(motion, dtype=np.float64)
        rotation = Rotation.from_rotvec(motion[:3]).as_matrix()
        return cls(rotation, motion[3:] + origin - rotation @ origin)

    @property
    def matrix(self) -> Floats:
        """Return the homogeneous matrix (4, 4) [R t; 0 1]."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.translation
        return matrix

    @property
    def angle(self) -> float:
        """Return the angle of the rotation, rad."""
        return float(Rotation.from_matrix(self.rotation).magnitude())

    @property
    def rotation_vector(self) -> Floats:
        """Return the rotation as its axis times its angle, (3,) rad."""
        return floats(Rotation.from_matrix(self.rotation).as_rotvec(), "rotation vector", 3)

    def inverse(self) -> Pose:
        """Return the motion back: `a_from_b` of `b_from_a`."""
        return Pose(self.rotation.T, -self.rotation.T @ self.translation)

    def turned(self, vectors: Floats) -> Floats:
        """Return directions (n, 3) in the other frame: turned, not shifted."""
        return vectors @ self.rotation.T

    def __call__(self, points: Floats) -> Floats:
        """Return points (n, 3) mm in the other frame."""
        return points @ self.rotation.T + self.translation

    def __matmul__(self, other: Pose) -> Pose:
        """Return the chain: `c_from_b @ b_from_a` is `c_from_a`."""
        return Pose(self.rotation @ other.rotation, self.rotation @ other.translation + self.translation)
