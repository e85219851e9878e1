"""Where cameras stand, from a few points of the CAD that somebody picked in the pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inspect3d.arrays import Floats, floats
from inspect3d.camera import Camera, View
from inspect3d.correlation.freedom import Freedom
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose

FEWEST, FEWEST_DLT = 4, 6
PICKED = 2.0  # px, standard uncertainty of a click
WORST = 0.02  # of the picture's width: reprojection error above which picks do not belong together
VAGUE = 4.0  # px, uncertainty over the part above which picks do not determine a matrix
STEPS, SETTLED = 60, 1e-9


@dataclass(frozen=True, eq=False)
class Picks:
    """Points picked on the CAD and in every picture.

    Parameters
    ----------
    points_cad : (n, 3) mm
    pixels : (n, v, 2) px
    """

    points_cad: Floats
    pixels: Floats

    def __post_init__(self) -> None:
        points = floats(self.points_cad, "points_cad", None, 3)
        object.__setattr__(self, "points_cad", points)
        object.__setattr__(self, "pixels", floats(self.pixels, "pixels", len(points), None, 2))

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points_cad)


@dataclass(frozen=True, eq=False)
class Placed:
    """Cameras placed by picks.

    Parameters
    ----------
    views : the cameras
    errors : (n, v) px, distance of each pick from where its point appears
    """

    views: tuple[View, ...]
    errors: Floats


def placed_by_picks(picks: Picks, views: Sequence[View | None], cameras: Sequence[Camera], freedom: Freedom) -> Placed:
    """Return the cameras that see the picked points where they were clicked on, with the freedom they have.

    Each camera is placed by itself (perspective-n-point), then poses and lenses are adjusted together under their
    priors. Where the cameras are a rig, the part is placed before the first camera, and the others with it.

    Parameters
    ----------
    views : in the frame of the rig, where the cameras are a known rig; else None each
    cameras : the lenses to start with

    Raises
    ------
    MeasurementError
        There are fewer than four picks, they lie on one line or in one place, or they do not fit the part.
    """
    if len(picks) < FEWEST:
        raise MeasurementError(
            f"There are {len(picks)} landmarks, and {FEWEST} or more are needed to place a camera: pick "
            f"{FEWEST - len(picks)} more, far apart from each other."
        )
    _require_spread(picks.points_cad)
    for pixels in picks.pixels.swapaxes(0, 1):
        _require_apart(pixels)
    if freedom.poses == "common":
        start = _rig_at(picks, [view for view in views if view], cameras)
    else:
        poses = [_pose(picks.points_cad, picks.pixels[:, k], camera) for k, camera in enumerate(cameras)]
        start = tuple(map(View, cameras, poses))
    found = _adjusted(picks, start, freedom)
    errors = np.linalg.norm(_residuals(picks, found), axis=2)
    _require_fit(errors, found)
    return Placed(found, errors)


def ideal_camera(focal: float, size: tuple[int, int]) -> Camera:
    """Return a camera with square pixels, its principal point in the middle, and no distortion."""
    matrix = np.array([[focal, 0.0, (size[0] - 1) / 2], [0.0, focal, (size[1] - 1) / 2], [0.0, 0.0, 1.0]])
    return Camera(matrix, np.zeros(5), size)


def view_from_dlt(points_cad: Floats, pixels: Floats, size: tuple[int, int], nodes: Floats) -> View:
    """Return the camera whose 3 x 4 matrix sees the picks where they are (paper, eq. 1), without distortion.

    Parameters
    ----------
    points_cad : (n, 3) mm, n >= 6
    pixels : (n, 2) px
    size : width and height of the picture, px
    nodes : (m, 3) mm, the part: a click's error must not move the pictures of its nodes by more than a few pixels

    Raises
    ------
    MeasurementError
        There are fewer than six picks, or they are not deep enough to determine a matrix.

    Notes
    -----
    Y. I. Abdel-Aziz, H. M. Karara, "Direct linear transformation from comparator coordinates into object space
    coordinates in close-range photogrammetry", 1971; normalised as in R. Hartley, A. Zisserman, "Multiple View
    Geometry", 2nd edition, algorithm 7.1.
    """
    if len(points_cad) < FEWEST_DLT:
        raise MeasurementError(
            f"A projection matrix takes {FEWEST_DLT} picks, and there are {len(points_cad)}: pick more, or give a "
            "rough `focal`."
        )
    _require_apart(pixels)
    space, plane = _normaliser(points_cad), _normaliser(pixels)
    x, u = _homogeneous(points_cad) @ space.T, _homogeneous(pixels) @ plane.T
    rows = _dlt_rows(x, u)
    _, values, vectors = np.linalg.svd(rows)
    matrix = vectors[-1].reshape(3, 4)
    vague = _vagueness(matrix, values, vectors, _homogeneous(nodes) @ space.T) * PICKED
    if not values[-2] > 1e-9 * values[0] or not vague < VAGUE:
        raise MeasurementError(
            f"The {len(points_cad)} picks do not determine a projection matrix: a click that is {PICKED:g} px off "
            f"moves the rest of the part by {min(vague, 9999):.0f} px. Pick points that differ more in depth, or give "
            "a rough `focal`, with which four picks suffice."
        )
    return _decomposed(np.linalg.inv(plane) @ matrix @ space, points_cad, size)


def _require_spread(points: Floats) -> None:
    widths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if widths[1] < 1e-2 * widths[0]:
        raise MeasurementError("The landmarks lie on one line or in one point of the CAD: pick some off it.")


def _require_apart(pixels: Floats) -> None:
    if np.ptp(pixels, axis=0).max() < PICKED:
        raise MeasurementError("The landmarks were all picked at one place of a picture: pick them where they appear.")


def _require_fit(errors: Floats, views: Sequence[View]) -> None:
    widths = np.array([view.camera.size[0] for view in views])
    if (errors > WORST * widths).any():
        pick, view = np.unravel_index(np.argmax(errors / widths), errors.shape)
        raise MeasurementError(
            f"The landmarks do not fit the part: number {pick + 1} is {errors[pick, view]:.0f} px off in picture "
            f"{view + 1} in the best pose found. Check their order, that each is the same point of the CAD in every "
            "picture, and the focal length."
        )


def _pose(points: Floats, pixels: Floats, camera: Camera) -> Pose:
    """Return the pose camera_from_cad by perspective-n-point (SQPnP), refined; of a plane's two, the better one."""
    import cv2

    ideal = camera.undistorted(pixels)
    answers = []
    for method in (cv2.SOLVEPNP_SQPNP, cv2.SOLVEPNP_IPPE) if _flat(points) else (cv2.SOLVEPNP_SQPNP,):
        _, turns, shifts, _ = cv2.solvePnPGeneric(points, ideal, np.eye(3), None, flags=method)
        for turn, shift in zip(turns, shifts, strict=True):
            turn, shift = cv2.solvePnPRefineLM(points, ideal, np.eye(3), None, turn, shift)
            pose = Pose(floats(cv2.Rodrigues(turn)[0], "turn", 3, 3), floats(shift.ravel(), "shift", 3))
            if (pose(points)[:, 2] > 0).all():
                error = camera.project(pose(points)) - pixels
                answers.append((float((error**2).sum()), pose))
    if not answers:
        raise MeasurementError(
            "No place of the camera shows the landmarks where they were picked: check their order, and that each is "
            "the same point in the CAD and in the pictures."
        )
    return min(answers, key=lambda answer: answer[0])[1]


def _flat(points: Floats) -> bool:
    widths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(widths[2] < 1e-3 * widths[0])


def _rig_at(picks: Picks, views: Sequence[View], cameras: Sequence[Camera]) -> tuple[View, ...]:
    """Return the cameras of a rig before the part, as the camera says whose picks the rig then fits best."""
    answers = []
    for k, view in enumerate(views):
        rig_from_cad = view.camera_from_cad.inverse() @ _pose(picks.points_cad, picks.pixels[:, k], cameras[k])
        placed = tuple(replace(each, camera_from_cad=each.camera_from_cad @ rig_from_cad) for each in views)
        if all((each.depth(picks.points_cad) > 0).all() for each in placed):
            answers.append((float((_residuals(picks, placed) ** 2).sum()), placed))
    if not answers:
        raise MeasurementError(
            "The landmarks and the calibration do not go together: where one camera sees the part, another looks away "
            "from it. Check the order of the pictures and cameras."
        )
    return min(answers, key=lambda answer: answer[0])[1]


def _residuals(picks: Picks, views: Sequence[View]) -> Floats:
    """Return how far each point appears from where it was picked, (n, v, 2) px."""
    return np.stack([view.project(picks.points_cad) for view in views], axis=1) - picks.pixels


def _adjusted(picks: Picks, views: tuple[View, ...], freedom: Freedom) -> tuple[View, ...]:
    """Return views that fit picks and priors together best, by Gauss-Newton with differences as derivatives."""
    sigmas = freedom.spread(freedom.columns)[1]
    if not len(sigmas):
        return views
    scale = freedom.scale(views, picks.points_cad)
    weights = 1 / sigmas
    damping = 1e-9

    def misfit(views: tuple[View, ...]) -> Floats:
        return np.concatenate([_residuals(picks, views).ravel() / PICKED, freedom.offset(views) * weights])

    now = misfit(views)
    for _ in range(STEPS):
        slopes = np.stack([(misfit(freedom.moved(views, step)) - now) / 1e-3 for step in np.diag(1e-3 * scale)], axis=1)
        normal = slopes.T @ slopes
        normal += damping * np.diag(np.diag(normal)) + 1e-12 * np.trace(normal) * np.eye(len(normal))
        step = scale * -np.linalg.solve(normal, slopes.T @ now)
        try:
            moved = freedom.moved(views, step)
            then = misfit(moved)
        except (MeasurementError, ValueError):  # the step went behind a camera
            damping = max(10 * damping, 1e-3)
            continue
        if then @ then > now @ now:
            damping = max(10 * damping, 1e-3)
            continue
        gain, views, now, damping = now @ now - then @ then, moved, then, damping / 10
        if gain < SETTLED * (1 + then @ then):
            break
    return views


def _normaliser(points: Floats) -> Floats:
    """Return the similarity that brings points (n, d) to the origin and to the mean distance sqrt(d) from it."""
    middle = points.mean(axis=0)
    d = points.shape[1]
    size = np.sqrt(d) / np.linalg.norm(points - middle, axis=1).mean()
    matrix = np.diag([size] * d + [1.0])
    matrix[:d, d] = -size * middle
    return matrix


def _homogeneous(points: Floats) -> Floats:
    return np.column_stack([points, np.ones(len(points))])


def _dlt_rows(x: Floats, u: Floats) -> Floats:
    """Return the 2 n equations of the twelve entries of the matrix."""
    nothing = np.zeros_like(x)
    first = np.concatenate([x, nothing, -u[:, :1] * x], axis=1)
    second = np.concatenate([nothing, x, -u[:, 1:2] * x], axis=1)
    return np.concatenate([first, second])


def _vagueness(matrix: Floats, values: Floats, vectors: Floats, nodes: Floats) -> float:
    """Return the rms change (px) of the part's picture for clicks that are one pixel off, to first order.

    The equations' errors are the clicks' times the depth; with unit depth on average both have one size, and pixels
    of picture and picks are scaled alike, so that the scale falls out.
    """
    depth = nodes @ matrix[2]
    rows = _dlt_rows(nodes, (nodes @ matrix[:2].T) / depth[:, None])
    covariance = (vectors[:-1].T / np.maximum(values[:11], 1e-300) ** 2) @ vectors[:-1] * np.mean(depth**2)
    variance = np.einsum("ij,jk,ik->i", rows, covariance, rows).reshape(2, -1) / depth**2
    return float(np.sqrt(variance.sum(axis=0).mean()))


def _decomposed(matrix: Floats, points: Floats, size: tuple[int, int]) -> View:
    """Return the camera of a 3 x 4 matrix: K [R t], by RQ decomposition."""
    from scipy.linalg import rq

    if ((_homogeneous(points) @ matrix[2]) < 0).sum() * 2 > len(points):
        matrix = -matrix
    upper, rotation = rq(matrix[:, :3])
    signs = np.diag(np.sign(np.diag(upper)))
    upper, rotation = upper @ signs, signs @ rotation
    if np.linalg.det(rotation) < 0:
        raise MeasurementError(
            "The picks are those of a mirrored part: check that the pictures are not mirrored, and the order of picks."
        )
    translation = np.linalg.solve(upper, matrix[:, 3])
    return View(Camera(upper / upper[2, 2], np.zeros(5), size), Pose(rotation, translation))
