"""Where one camera stands, from points in known places that it sees, some of them wrongly."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Booleans, Floats, floats
from inspect3d.pose import Pose

ENOUGH = 12  # points that place a camera
TRIES, CERTAIN = 5000, 0.9999


def resected(points: Floats, rays: Floats, reach: float) -> tuple[Pose | None, Booleans]:
    """Return the pose, camera from the points' frame, that most points and rays obey, and which do, (n,).

    None where too few do. G. Terzakis, M. Lourakis, "A consistently fast and globally optimal solution to the
    perspective-n-point problem", ECCV 2020, on random samples.

    Parameters
    ----------
    points : (n, 3)
    rays : (n, 2), where the lines of sight cross z = 1
    reach : within which a ray agrees, in the same plane
    """
    import cv2

    good = np.zeros(len(points), bool)
    if len(points) < ENOUGH:
        return None, good
    done, turn, shift, which = cv2.solvePnPRansac(
        points, rays, np.eye(3), None, iterationsCount=TRIES, reprojectionError=reach, confidence=CERTAIN,
        flags=cv2.SOLVEPNP_SQPNP,
    )  # fmt: skip
    if not done or which is None or len(which) < ENOUGH:
        return None, good
    good[which.ravel()] = True
    return Pose(floats(cv2.Rodrigues(turn)[0], "turn", 3, 3), floats(shift.ravel(), "shift", 3)), good
