"""How the second of two cameras may stand before the first, from what their pictures have in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from inspect3d.arrays import Floats, floats, unit
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.pose import Pose
from inspect3d.starting.bundle import Bundle, adjusted
from inspect3d.starting.epipolar import epipolar

LEAST_ANGLE = np.radians(0.5)  # between two lines of sight that meet, before cameras are adjusted
FEW = 300  # tracks that two cameras are adjusted to
ALIKE = 1.7  # times the cost of the best answer, up to which another is kept
MOSTLY = 0.8  # share of the tracks that a turn explains, from which on there is no other change
SAME = np.radians(1.0)  # angle between cameras below which two answers are one
TURNS = (6.0, 12.0, 20.0, 30.0, 45.0)  # degrees


def pair_poses(
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
        start = start.chosen(start.ahead & (start.widest > LEAST_ANGLE))
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


def turned_only(one: Floats, other: Floats, reach: float) -> bool:
    """Tell whether cameras that only turned, in one place, would see most pairs of rays (n, 2) as well, within `reach`.

    W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta Crystallographica A 32, 1976.
    """
    here, there = (unit(np.column_stack([rays, np.ones(len(rays))])) for rays in (one, other))
    near = np.ones(len(one), bool)
    away = np.zeros(len(one))
    for _ in range(3):
        u, _, vt = np.linalg.svd(there[near].T @ here[near])
        turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        away = np.linalg.norm(here @ turn.T - there, axis=1)
        near = away <= np.quantile(away, MOSTLY)
    return bool((away < reach).mean() > MOSTLY)


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
