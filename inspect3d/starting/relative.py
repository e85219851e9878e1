"""Where the cameras stand relative to each other, up to a scale, from tracks alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from inspect3d.arrays import Floats, floats
from inspect3d.camera import Camera, View
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from inspect3d.starting.bundle import Bundle, adjusted
from inspect3d.starting.epipolar import epipolar

STRAY = 4.0  # noises within which a track obeys the cameras, before these are adjusted
AGREES = 3.0  # and after
RIG_STRAY, LEAST_SHARE = 4.0, 0.3  # px off a calibrated rig, and least share of the tracks within
LEAST_ANGLE = np.radians(2.0)  # between two lines of sight that meet
FEWEST = 30
ENOUGH = 12  # tracks that place a further camera
FEW, MOST = 300, 800  # tracks that two cameras, and all, are adjusted to
ALIKE = 1.7  # times the cost of the best answer, up to which another is kept
SAME = np.radians(1.0)  # angle between cameras below which two answers are one
TURNS = (6.0, 12.0, 20.0, 30.0, 45.0)  # degrees


def relative(cameras: Sequence[Camera], lenses: Sequence[Lens], pixels: Floats, noise: float) -> tuple[Bundle, ...]:
    """Return cameras and points that explain the tracks, in the frame of the first camera, at unit distance.

    Two cameras are placed by an essential matrix and by the homography that a plane would make; of both, what explains
    the tracks is adjusted and kept, since a part that shows one flat face can leave two answers. The other cameras
    follow by perspective-n-point.

    Parameters
    ----------
    cameras : with the rough lenses
    lenses : how well these are known
    pixels : (n, v, 2) px, tracks; NaN where a view does not have one
    noise : px, of a feature's place

    Raises
    ------
    MeasurementError
        Too few tracks, or all cameras stand in one place.
    """
    seen = np.isfinite(pixels[:, :, 0])
    rays = np.full(pixels.shape, np.nan)
    for k, camera in enumerate(cameras):
        rays[seen[:, k], k] = camera.undistorted(pixels[seen[:, k], k])
    one, other = max(
        combinations(range(len(cameras)), 2), key=lambda pair: int(np.count_nonzero(seen[:, pair].all(axis=1)))
    )
    both = seen[:, [one, other]].all(axis=1)
    if np.count_nonzero(both) < FEWEST:
        raise MeasurementError(
            f"The pictures have too little in common to start from: only {np.count_nonzero(both)} features were found "
            "in two of them. Take them from places closer to each other, or give `landmarks`."
        )
    lens_pair = [lenses[one], lenses[other]]
    views = (View(cameras[one], Pose.identity()), View(cameras[other], Pose.identity()))
    pair = Bundle(views, np.zeros((np.count_nonzero(both), 3)), pixels[both][:, [one, other]])
    reach = STRAY * noise / float(np.mean([cameras[k].matrix[0, 0] for k in (one, other)]))
    answers = []
    for pose in _pair_poses(pair, rays[both, one], rays[both, other], lens_pair, noise, reach):
        bundle = _all_placed((one, other), pose, cameras, rays, pixels, noise)
        if bundle is not None:
            answers.append(_adjusted(bundle, lenses, noise))
    if not answers:
        raise MeasurementError(
            "The pictures do not tell where their cameras stand: the lines of sight of what they have in common hardly "
            "cross. Take them from places some 20 degrees apart, or give `landmarks`."
        )
    return _different(answers)


def triangulated(views: Sequence[View], pixels: Floats, noise: float) -> Bundle:
    """Return the points that tracks show to cameras in known places.

    Raises
    ------
    MeasurementError
        The tracks are too few, or do not obey the cameras.
    """
    seen = np.isfinite(pixels[:, :, 0])
    rays = np.full(pixels.shape, np.nan)
    for k, view in enumerate(views):
        rays[seen[:, k], k] = view.camera.undistorted(pixels[seen[:, k], k])
    points = np.full((len(pixels), 3), np.nan)
    _cross_all(points, {k: view.camera_from_cad for k, view in enumerate(views)}, rays)
    bundle = Bundle(tuple(views), points, pixels).chosen(np.isfinite(points[:, 0]))
    bundle = bundle.chosen(bundle.ahead).settled(noise)
    good = bundle.ahead & (bundle.misses < RIG_STRAY).all(axis=1) & (_widest(bundle) > LEAST_ANGLE)
    if np.count_nonzero(good) < FEWEST or good.mean() < LEAST_SHARE:
        raise MeasurementError(
            f"The pictures do not obey the calibration: {np.count_nonzero(good)} of {len(pixels)} features that they "
            "have in common lie where it says. Check the order of the pictures and cameras, and that nothing has moved."
        )
    return bundle.chosen(good)


def _pair_poses(
    pair: Bundle, one: Floats, other: Floats, lenses: Sequence[Lens], noise: float, reach: float
) -> list[Pose]:
    """Return the poses of the second camera before the first that explain a pair's tracks about as well as the best."""
    few = np.random.default_rng(0).permutation(len(one))[:FEW]
    freedom = Freedom("free", tuple(lenses), pair.views, np.array([0.0, 0.0, 1.0]))
    found: list[tuple[float, Pose]] = []
    for pose in (*_epipolar_poses(one, other, reach), *_affine_poses(one, other)):
        points = crossing(pose, one[few], other[few])
        views = (pair.views[0], replace(pair.views[1], camera_from_cad=pose))
        start = Bundle(views, points, pair.pixels[few])
        start = start.chosen(start.ahead & (_widest(start) > LEAST_ANGLE / 4))
        if len(start.points) < 0.7 * len(few):
            continue
        size = float(np.median(start.points[:, 2]))
        start = Bundle(tuple(_scaled(view, 1 / size) for view in views), start.points / size, start.pixels)
        end = adjusted(start, freedom, noise, steps=15)
        cost = end.cost + 9 * (len(few) - len(start.points))
        first, second = end.bundle.views
        found.append((cost, second.camera_from_cad @ first.camera_from_cad.inverse()))
    found.sort(key=lambda answer: answer[0])
    kept: list[Pose] = []
    for cost, pose in found:
        if cost <= ALIKE * found[0][0] and all((pose @ o.inverse()).angle > SAME for o in kept):
            kept.append(pose)
    return kept


def _epipolar_poses(one: Floats, other: Floats, reach: float) -> list[Pose]:
    """Return poses other_from_one with unit translation that may explain pairs of rays (n, 2)."""
    import cv2

    found: list[tuple[Any, Any]] = []
    common = epipolar(one, other, reach)
    if common is not None:
        turns = cv2.decomposeEssentialMat(common.essential)
        found += [(turn, side * turns[2].ravel()) for turn in turns[:2] for side in (1.0, -1.0)]
    plane, good = cv2.findHomography(one, other, cv2.USAC_MAGSAC, reach)
    if plane is not None and good.mean() > 0.3:
        _, turned, shifts, _ = cv2.decomposeHomographyMat(plane, np.eye(3))
        found += [(turn, shift.ravel()) for turn, shift in zip(turned, shifts, strict=True)]
    poses = []
    for turn, shift in found:
        length = np.linalg.norm(shift)
        if length > 1e-6 and np.linalg.det(turn) > 0:
            pose = Pose(floats(turn, "turn", 3, 3), floats(shift / length, "shift", 3))
            points = crossing(pose, one, other)
            ahead = (points[:, 2] > 0) & (pose(points)[:, 2] > 0)
            if ahead.mean() > 0.5:
                poses.append(pose)
    return poses


def _affine_poses(one: Floats, other: Floats) -> list[Pose]:
    """Return poses that explain pairs of rays (n, 2) under nearly parallel lines of sight, as long lenses have them.

    Such pictures tell the epipolar lines, but neither how far the second camera is turned about them nor to which
    side: each of `TURNS` is tried. J. J. Koenderink, A. J. van Doorn, "Affine structure from motion", Journal of the
    Optical Society of America A 8(2), 1991.
    """
    middle = np.concatenate([np.median(one, axis=0), np.median(other, axis=0)])
    pairs = np.column_stack([one, other]) - middle
    across = np.linalg.svd(pairs, full_matrices=False)[2][-1]
    for _ in range(5):
        away = np.abs(pairs @ across)
        across = np.linalg.svd(pairs[away <= np.quantile(away, 0.7)], full_matrices=False)[2][-1]
    first, second = across[:2], -across[2:]
    sizes = np.linalg.norm(first), np.linalg.norm(second)
    if min(sizes) < 1e-3:
        return []
    ratio = sizes[0] / sizes[1]
    upright = [_upright(axis / size) for axis, size in zip((first, second), sizes, strict=True)]
    here, there = np.append(middle[:2], 1.0), np.append(middle[2:], 1.0) / ratio
    poses = []
    for turn in np.radians([*TURNS, *(-turn for turn in TURNS)]):
        about = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
        rotation = upright[1].T @ about @ upright[0]
        poses.append(Pose(rotation, there - rotation @ here))
    return poses


def _upright(across: Floats) -> Floats:
    """Return the turn (3, 3) of a picture that makes the direction (2,) its y axis."""
    x, y = across
    return np.array([[y, -x, 0.0], [x, y, 0.0], [0.0, 0.0, 1.0]])


def _scaled(view: View, factor: float) -> View:
    pose = view.camera_from_cad
    return replace(view, camera_from_cad=Pose(pose.rotation, factor * pose.translation))


def crossing(other_from_one: Pose, one: Floats, other: Floats) -> Floats:
    """Return the points (n, 3) in the frame of the first camera nearest to both rays (n, 2) of a pair."""
    a = np.column_stack([one, np.ones(len(one))])
    b = np.column_stack([other, np.ones(len(other))]) @ other_from_one.rotation
    base = other_from_one.inverse().translation
    aa, bb, ab = (a * a).sum(axis=1), (b * b).sum(axis=1), (a * b).sum(axis=1)
    det = np.maximum(aa * bb - ab * ab, 1e-15)
    s = (bb * (a @ base) - ab * (b @ base)) / det
    t = (ab * (a @ base) - aa * (b @ base)) / det
    return (s[:, None] * a + base + t[:, None] * b) / 2


def _all_placed(
    pair: tuple[int, int], pose: Pose, cameras: Sequence[Camera], rays: Floats, pixels: Floats, noise: float
) -> Bundle | None:
    """Return all cameras and the points two of them see, the first of the two in its own frame; None where it fails."""
    import cv2

    seen = np.isfinite(rays[:, :, 0])
    places: dict[int, Pose] = {pair[0]: Pose.identity(), pair[1]: pose}
    points = np.full((len(rays), 3), np.nan)
    while True:
        _cross_all(points, places, rays)
        missing = [k for k in range(len(cameras)) if k not in places]
        if not missing:
            break
        have = np.isfinite(points[:, 0])
        k = max(missing, key=lambda k: int(np.count_nonzero(have & seen[:, k])))
        both = np.flatnonzero(have & seen[:, k])
        if len(both) < ENOUGH:
            raise MeasurementError(
                f"Picture {k + 1} has too little in common with the others to start from: {len(both)} features. Take "
                "it from a place closer to them, leave it out, or give `landmarks`."
            )
        reach = 2 * STRAY * noise / float(cameras[k].matrix[0, 0])
        done, turn, shift, good = cv2.solvePnPRansac(
            points[both], rays[both, k], np.eye(3), None, iterationsCount=1000, reprojectionError=reach,
            confidence=0.9999, flags=cv2.SOLVEPNP_SQPNP,
        )  # fmt: skip
        if not done or good is None or len(good) < ENOUGH:
            return None
        places[k] = Pose(floats(cv2.Rodrigues(turn)[0], "turn", 3, 3), floats(shift.ravel(), "shift", 3))
    views = tuple(View(camera, places[k]) for k, camera in enumerate(cameras))
    bundle = Bundle(views, points, pixels).chosen(np.isfinite(points[:, 0]))
    bundle = bundle.chosen(bundle.ahead)
    bundle = bundle.chosen(np.asarray((bundle.misses < 6 * STRAY * noise).all(axis=1)))
    return bundle if len(bundle.points) >= FEWEST else None


def _cross_all(points: Floats, places: dict[int, Pose], rays: Floats) -> None:
    """Write the points that two placed cameras see and that have no place yet, from the first such pair."""
    seen = np.isfinite(rays[:, :, 0])
    for one, other in combinations(sorted(places), 2):
        new = np.flatnonzero(np.isnan(points[:, 0]) & seen[:, one] & seen[:, other])
        there = crossing(places[other] @ places[one].inverse(), rays[new, one], rays[new, other])
        points[new] = places[one].inverse()(there)


def _adjusted(bundle: Bundle, lenses: Sequence[Lens], noise: float) -> Bundle:
    """Return the bundle adjusted, first to some of its tracks, with those that disagree left out."""
    bundle = _normalised(bundle)
    freedom = Freedom("free", tuple(lenses), bundle.views, bundle.points.mean(axis=0))
    for reach in (4 * STRAY, STRAY, AGREES):
        part = np.zeros(len(bundle.points), bool)
        part[np.random.default_rng(0).permutation(len(part))[:MOST]] = True
        views = adjusted(bundle.chosen(part), freedom, noise, steps=12).bundle.views
        bundle = Bundle(views, bundle.points, bundle.pixels).settled(noise)
        good = bundle.ahead & (bundle.misses < reach * noise).all(axis=1) & (_widest(bundle) > LEAST_ANGLE)
        if np.count_nonzero(good) < FEWEST:
            break
        bundle = bundle.chosen(good)
    return _normalised(bundle)


def _widest(bundle: Bundle) -> Floats:
    """Return the largest angle between two lines of sight of each point, (n,) rad."""
    widest = np.zeros(len(bundle.points))
    sights = np.stack([view.centre - bundle.points for view in bundle.views], axis=1)
    sights /= np.linalg.norm(sights, axis=2, keepdims=True)
    for one, other in combinations(range(len(bundle.views)), 2):
        both = bundle.seen[:, one] & bundle.seen[:, other]
        cosine = np.clip((sights[:, one] * sights[:, other]).sum(axis=1), -1, 1)
        widest[both] = np.maximum(widest[both], np.arccos(cosine[both]))
    return widest


def _normalised(bundle: Bundle) -> Bundle:
    """Return the same in the frame of the first camera, the points at a median depth of 1000."""
    first = bundle.views[0].camera_from_cad
    points = first(bundle.points)
    size = 1000 / float(np.median(points[:, 2]))
    views = []
    for view in bundle.views:
        pose = view.camera_from_cad @ first.inverse()
        views.append(View(view.camera, Pose(pose.rotation, size * pose.translation)))
    return Bundle(tuple(views), size * points, bundle.pixels)


def _different(answers: list[Bundle]) -> tuple[Bundle, ...]:
    """Return the answers that explain the tracks about as well as the best, each once."""
    most = max(len(bundle.points) for bundle in answers)
    scale = min(float(np.median(bundle.misses[bundle.seen])) for bundle in answers)
    costs = []
    for bundle in answers:
        squared = np.minimum((bundle.misses.max(axis=1) / (6 * scale)) ** 2, 1)
        costs.append(float(squared.sum() + max(most - len(bundle.points), 0)))
    kept: list[Bundle] = []
    for k in np.argsort(costs):
        if costs[k] <= ALIKE * min(costs) and all(_apart(answers[k], other) > SAME for other in kept):
            kept.append(answers[k])
    return tuple(kept)


def _apart(one: Bundle, other: Bundle) -> float:
    """Return the largest angle between the cameras of two bundles, rad."""
    return max(
        (a.camera_from_cad @ b.camera_from_cad.inverse()).angle for a, b in zip(one.views, other.views, strict=True)
    )
