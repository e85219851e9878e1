"""The pose that brings named points onto their places in the CAD."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.outcome import InputError
from inspect3d.pose import Pose
from inspect3d.register.mobility import jacobian
from inspect3d.register.similarity import Similarity


def pose_from_landmarks(measured: Floats, cad: Floats) -> Pose:
    """Return cad_from_measured, a rigid motion; see `similarity_from_landmarks`."""
    return similarity_from_landmarks(measured, cad).pose


def similarity_from_landmarks(measured: Floats, cad: Floats, grows: bool = False) -> Similarity:
    """Return cad_from_measured that brings measured (n, 3) mm closest to cad (n, 3) mm in the least-squares sense.

    The scale is 1, or the best one where the measured points have none of their own and `grows` says so.

    Raises
    ------
    InputError
        There are fewer than three landmarks, or they lie on one line.

    Notes
    -----
    K. S. Arun, T. S. Huang, S. D. Blostein, "Least-squares fitting of two 3-D point sets", IEEE PAMI 9 (1987), with the
    reflection ruled out and the scale as in S. Umeyama, IEEE PAMI 13 (1991), eq. 42 and 43.
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
    u, d, vt = np.linalg.svd((cad - middle_cad).T @ (measured - middle_measured))
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = u @ np.diag(signs) @ vt
    scale = float(d @ signs / ((measured - middle_measured) ** 2).sum()) if grows else 1.0
    return Similarity(Pose(rotation, middle_cad - scale * rotation @ middle_measured), scale)


def landmark_covariance(measured: Floats, cad: Floats, origin: Floats, grows: bool = False) -> Floats:
    """Return the covariance (6, 6) of the pose that landmarks give, a small motion about `origin` (3,) mm, CAD frame.

    The scatter of the landmarks about their places, 3 n - 6 degrees of freedom, or one less where the scale was fitted
    (`grows`), stands for their uncertainty. Three landmarks leave 3 of them.
    """
    measured, cad = np.asarray(measured, dtype=np.float64), np.asarray(cad, dtype=np.float64)
    gaps = similarity_from_landmarks(measured, cad, grows)(measured) - cad
    rows = np.concatenate([jacobian(cad, np.tile(axis, (len(cad), 1)), origin) for axis in np.eye(3)])
    if grows:
        rows = np.column_stack([rows, (cad - origin).T.ravel()])
    variance = (gaps**2).sum() / (3 * len(cad) - rows.shape[1])
    return (variance * np.linalg.inv(rows.T @ rows))[:6, :6]
