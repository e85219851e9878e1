"""Where the cameras stand relative to each other, up to a scale, from tracks alone."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import Camera, View
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from inspect3d.starting.bundle import Bundle, adjusted
from inspect3d.starting.pair import ALIKE, SAME, crossing, pair_poses, turned_only
from inspect3d.starting.resection import ENOUGH, resected

STRAY = 4.0  # noises within which a track obeys the cameras, before these are adjusted
AGREES = 3.0  # and after
RIG_STRAY, LEAST_SHARE = 4.0, 0.3  # px off a calibrated rig, and least share of the tracks within
LEAST_ANGLE = np.radians(2.0)  # between two lines of sight that meet
FEWEST = 30
MOST = 800  # tracks that all cameras are adjusted to


def joined(pixels: Floats) -> tuple[int, ...]:
    """Return which pictures tracks (n, v, 2) px join so that `relative` can place their cameras, the best pair first.

    Each further picture shows enough of what two of those before it show.
    """
    seen = np.isfinite(pixels[:, :, 0])
    shared = (seen[:, :, None] & seen[:, None, :]).sum(axis=0)
    found = list(max(combinations(range(seen.shape[1]), 2), key=lambda pair: int(shared[pair])))
    while len(found) < seen.shape[1]:
        have = seen[:, found].sum(axis=1) >= 2
        common = np.where(np.isin(np.arange(seen.shape[1]), found), -1, (have[:, None] & seen).sum(axis=0))
        if common.max() < ENOUGH:
            break
        found.append(int(common.argmax()))
    return tuple(found)


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
    order = joined(pixels)
    one, other = order[:2]
    both = seen[:, [one, other]].all(axis=1)
    if np.count_nonzero(both) < FEWEST:
        raise MeasurementError(
            f"The pictures have too little in common to start from: only {np.count_nonzero(both)} features were found "
            "in two of them. Take them from places closer to each other, or give `landmarks`."
        )
    if len(order) < len(cameras):
        raise too_little(min(set(range(len(cameras))) - set(order)))
    lens_pair = [lenses[one], lenses[other]]
    views = (View(cameras[one], Pose.identity()), View(cameras[other], Pose.identity()))
    pair = Bundle(views, np.zeros((np.count_nonzero(both), 3)), pixels[both][:, [one, other]])
    reach = STRAY * noise / float(np.mean([cameras[k].matrix[0, 0] for k in (one, other)]))
    answers = []
    still = turned_only(rays[both, one], rays[both, other], reach)
    for pose in () if still else pair_poses(pair, rays[both, one], rays[both, other], lens_pair, noise, reach):
        bundle = _all_placed(order, pose, cameras, rays, pixels, noise)
        if bundle is not None:
            answer = _adjusted(bundle, lenses, noise)
            answers += [answer] if answer.possible else []
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
    good = bundle.ahead & (bundle.misses < RIG_STRAY).all(axis=1) & (bundle.widest > LEAST_ANGLE)
    if np.count_nonzero(good) < FEWEST or good.mean() < LEAST_SHARE:
        raise MeasurementError(
            f"The pictures do not obey the calibration: {np.count_nonzero(good)} of {len(pixels)} features that they "
            "have in common lie where it says. Check the order of the pictures and cameras, and that nothing has moved."
        )
    return bundle.chosen(good)


def _all_placed(
    order: Sequence[int], pose: Pose, cameras: Sequence[Camera], rays: Floats, pixels: Floats, noise: float
) -> Bundle | None:
    """Return all cameras and the points two of them see, the first of the order in its own frame; or None."""
    seen = np.isfinite(rays[:, :, 0])
    places: dict[int, Pose] = {order[0]: Pose.identity(), order[1]: pose}
    points = np.full((len(rays), 3), np.nan)
    _cross_all(points, places, rays)
    for k in order[2:]:
        both = np.flatnonzero(np.isfinite(points[:, 0]) & seen[:, k])
        reach = 2 * STRAY * noise / float(cameras[k].matrix[0, 0])
        place, _ = resected(points[both], rays[both, k], reach)
        if place is None:
            return None
        places[k] = place
        _cross_all(points, places, rays)
    views = tuple(View(camera, places[k]) for k, camera in enumerate(cameras))
    bundle = Bundle(views, points, pixels).chosen(np.isfinite(points[:, 0]))
    bundle = bundle.chosen(bundle.ahead)
    bundle = bundle.chosen(np.asarray((bundle.misses < 6 * STRAY * noise).all(axis=1)))
    return bundle if len(bundle.points) >= FEWEST else None


def too_little(number: int) -> MeasurementError:
    """Return what to say of a picture, counted from 0, that has too little in common with the others."""
    return MeasurementError(
        f"Picture {number + 1} has too little in common with the others to start from. Take it from a place closer to "
        "them, leave it out, or give `landmarks`."
    )


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
        good = bundle.ahead & (bundle.misses < reach * noise).all(axis=1) & (bundle.widest > LEAST_ANGLE)
        if np.count_nonzero(good) < FEWEST:
            break
        bundle = bundle.chosen(good)
    return _normalised(bundle)


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
