"""Which motions of the part the measured points leave free, in words a machinist would use."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats, unit
from inspect3d.register.alignment import FreeMotion

SMALL = 1e-2  # components below this share count as zero when a motion is put in words


def jacobian(points: Floats, normals: Floats, origin: Floats) -> Floats:
    """Return how a small motion moves points along their normals, (n, 6): (x - o) × n and n.

    The motion is (rx, ry, rz, tx, ty, tz), rad and mm, about `origin` (3,) mm; points and normals are (n, 3).
    """
    return np.concatenate([np.cross(points - origin, normals), normals], axis=1)


def spread(points: Floats, weights: Floats, origin: Floats) -> float:
    """Return the weighted root mean square distance of the points from the origin, mm."""
    return float(np.sqrt(np.average(((points - origin) ** 2).sum(axis=1), weights=weights))) or 1.0


def named(free: Floats, origin: Floats, length: float) -> tuple[FreeMotion, ...]:
    """Return the free motions (k, 6) about `origin` as shifts and turns, each in words.

    Shifts come first; a turn is put about its own axis. `length` (mm) weighs turns against shifts.
    """
    if not len(free):
        return ()
    scaled = free * np.array([length] * 3 + [1.0] * 3)
    _, s, vt = np.linalg.svd(scaled[:, :3].T, full_matrices=True)
    turning = int(np.count_nonzero(s > SMALL))
    shifts = _sparse(vt[turning:] @ scaled)
    turns = vt[:turning] @ scaled
    if len(shifts):
        turns = turns - np.concatenate(
            [np.zeros((len(turns), 3)), turns[:, 3:] @ shifts[:, 3:].T @ shifts[:, 3:]], axis=1
        )
    motions = [_shift(shift) for shift in shifts]
    if turning == 3 and not len(shifts):
        return tuple(_turns_about_a_point(turns, origin, length))
    return tuple(motions + [_turn(turn, origin, length) for turn in turns])


def _sparse(shifts: Floats) -> Floats:
    """Return an orthonormal basis of the same shifts (k, 6) that lies along the coordinate axes where it can."""
    if len(shifts) < 2:
        return shifts
    projector = shifts[:, 3:].T @ shifts[:, 3:]
    basis: list[Floats] = []
    for axis in np.argsort(-np.diag(projector)):
        vector = projector[axis] - sum((np.dot(projector[axis], b) * b for b in basis), np.zeros(3))
        if np.linalg.norm(vector) > 0.3 and len(basis) < len(shifts):
            basis.append(unit(vector))
    return np.concatenate([np.zeros((len(basis), 3)), np.array(basis)], axis=1)


def _shift(motion: Floats) -> FreeMotion:
    direction = _signed(unit(motion[3:]))
    return FreeMotion(f"shift along {_vector(direction, 2)}", np.concatenate([np.zeros(3), direction]))


def _turn(scaled: Floats, origin: Floats, length: float) -> FreeMotion:
    rotation, translation = scaled[:3] / length, scaled[3:]
    speed = np.linalg.norm(rotation)
    axis = _signed(rotation / speed)
    translation = translation / speed * np.sign(axis @ rotation)
    foot = origin + np.cross(axis, translation)
    foot = foot - (foot @ axis) * axis  # the point of the axis nearest to the CAD's origin
    where = f"about the axis along {_vector(axis, 2)} through {_vector(foot, 1)} mm"
    pitch = float(axis @ translation)
    if abs(pitch) < SMALL * length:
        return FreeMotion(f"turn {where}", np.concatenate([axis, translation - pitch * axis]))
    return FreeMotion(f"screw of {2 * np.pi * pitch:.2f} mm a turn {where}", np.concatenate([axis, translation]))


def _turns_about_a_point(turns: Floats, origin: Floats, length: float) -> list[FreeMotion]:
    """Return the three turns about the common point of a sphere."""
    rotations, translations = turns[:, :3] / length, turns[:, 3:]
    cross = np.concatenate([cross_matrix(rotation) for rotation in rotations])
    point = np.linalg.lstsq(-cross, translations.ravel(), rcond=None)[0]
    words = f"turn about the axis along {{}} through {_vector(origin + point, 1)} mm"
    axes = np.eye(3)
    return [FreeMotion(words.format(_vector(a, 0)), np.concatenate([a, -np.cross(a, point)])) for a in axes]


def cross_matrix(vector: Floats) -> Floats:
    """Return the matrix (3, 3) of v -> vector x v."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _signed(vector: Floats) -> Floats:
    """Return the vector or its opposite: the largest component is positive."""
    return vector * np.sign(vector[np.argmax(np.abs(vector))])


def _vector(vector: Floats, digits: int) -> str:
    rounded = np.round(vector, digits) + 0.0
    return (
        "("
        + ", ".join(f"{value:.{digits}f}".rstrip("0").rstrip(".") if digits else f"{value:.0f}" for value in rounded)
        + ")"
    )
