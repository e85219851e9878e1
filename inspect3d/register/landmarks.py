"""The pose that brings named points onto their places in the CAD."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.outcome import InputError
from inspect3d.pose import Pose
from inspect3d.register.mobility import jacobian


def pose_from_landmarks(measured: Floats, cad: Floats) -> Pose:
    """Return cad_from_measured that brings measured (n, 3) mm closest to cad (n, 3) mm in the least-squares sense.

    Raises
    ------
    InputError
        There are fewer than three landmarks, or they lie on one line.

    Notes
    -----
    K. S. Arun, T. S. Huang, S. D. Blostein, "Least-squares fitting of two 3-D point sets", IEEE PAMI 9 (1987), with the
    reflection ruled out as in S. Umeyama, IEEE PAMI 13 (1991), eq. 43.
    """
    measured, cad = np.asarray(measured, dtype=np.float64), np.asarray(cad, dtype=np.float64)
    if len(measured) < 3:
        raise InputError(
            f"An alignment by landmarks needs at least 3 of them; the recipe has {len(measured)}: add some."
        )
    for points, what in ((measured, "measured"), (cad, "cad")):
        widths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if widths[1] < 1e-3 * max(widths[0], 1e-12):
            raise InputError(
                f"The `{what}` points of the landmarks lie on one line, which leaves a turn open: add one off it."
            )
    middle_measured, middle_cad = measured.mean(axis=0), cad.mean(axis=0)
    u, _, vt = np.linalg.svd((cad - middle_cad).T @ (measured - middle_measured))
    rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return Pose(rotation, middle_cad - rotation @ middle_measured)


def landmark_covariance(measured: Floats, cad: Floats, origin: Floats) -> Floats:
    """Return the covariance (6, 6) of the pose that landmarks give, a small motion about `origin` (3,) mm, CAD frame.

    The scatter of the landmarks about their places, 3 n - 6 degrees of freedom, stands for their uncertainty. Three
    landmarks leave 3 of them.
    """
    measured, cad = np.asarray(measured, dtype=np.float64), np.asarray(cad, dtype=np.float64)
    gaps = pose_from_landmarks(measured, cad)(measured) - cad
    variance = (gaps**2).sum() / (3 * len(cad) - 6)
    rows = np.concatenate([jacobian(cad, np.tile(axis, (len(cad), 1)), origin) for axis in np.eye(3)])
    return variance * np.linalg.inv(rows.T @ rows)
