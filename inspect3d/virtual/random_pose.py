"""Any pose."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from inspect3d.pose import Pose


def random_pose(random: np.random.Generator, distance: float = 400.0) -> Pose:
    """Return a pose turned uniformly at random and shifted by `distance` mm in a random direction."""
    rotation = Rotation.from_quat(random.normal(size=4)).as_matrix()
    direction = random.normal(size=3)
    return Pose(rotation, distance * direction / np.linalg.norm(direction))
