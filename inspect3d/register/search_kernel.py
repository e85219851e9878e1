"""Kernels of the pose search: the cost of many poses, and their descent, against the field of a surface.

Arrays only. A pose is a rotation, a translation and a size by which the points are multiplied first; poses come in
stacks. Distances that count, reaches, are mm at the size of the cloud: a cloud does not fit for having shrunk.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Floats

STRIDE = 0.2  # largest relative change of the size in a step
OPPOSED = 0.3  # normals whose cosine is below this do not belong to the same surface


@njit(cache=True)
def _look_up(
    point: Floats, origin: Floats, step: float, feet: Floats, normals: Floats, foot: Floats, normal: Floats
) -> float:
    """Write foot and normal of the cell nearest to the point; return the distance it is known to have at least."""
    nx, ny, nz = feet.shape[0], feet.shape[1], feet.shape[2]
    i = min(max(int((point[0] - origin[0]) / step + 0.5), 0), nx - 1)
    j = min(max(int((point[1] - origin[1]) / step + 0.5), 0), ny - 1)
    k = min(max(int((point[2] - origin[2]) / step + 0.5), 0), nz - 1)
    across = 0.0
    total = 0.0
    for a in range(3):
        foot[a] = feet[i, j, k, a]
        normal[a] = normals[i, j, k, a]
        gap = point[a] - foot[a]
        across += gap * normal[a]
        total += gap * gap
    along = max(math.sqrt(max(total - across * across, 0.0)) - 0.87 * step, 0.0)
    return math.sqrt(across * across + along * along)


@njit(cache=True)
def _agrees(turned: Floats, normal: Floats, oriented: bool) -> bool:
    """Tell whether a measured normal may lie on a surface with this normal; a zero normal may lie on any."""
    length = turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2]
    if length < 0.25:
        return True
    cosine = turned[0] * normal[0] + turned[1] * normal[1] + turned[2] * normal[2]
    return cosine > OPPOSED or (not oriented and cosine < -OPPOSED)


@njit(cache=True)
def _apply(rotation: Floats, translation: Floats, point: Floats, moved: Floats) -> None:
    for a in range(3):
        moved[a] = rotation[a, 0] * point[0] + rotation[a, 1] * point[1] + rotation[a, 2] * point[2] + translation[a]


@njit(cache=True)
def _cost(
    rotation: Floats,
    translation: Floats,
    size: float,
    points: Floats,
    point_normals: Floats,
    oriented: bool,
    reach: float,
    origin: Floats,
    step: float,
    feet: Floats,
    normals: Floats,
) -> float:
    moved, turned, foot, normal, zero = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.zeros(3)
    scaled = size * rotation
    cost = 0.0
    for p in range(len(points)):
        _apply(scaled, translation, points[p], moved)
        distance = _look_up(moved, origin, step, feet, normals, foot, normal) / size
        _apply(rotation, zero, point_normals[p], turned)
        if distance < reach and _agrees(turned, normal, oriented):
            cost += distance / reach
        else:
            cost += 1.0
    return cost / len(points)


@njit(parallel=True, cache=True)
def costs(
    rotations: Floats,
    translations: Floats,
    sizes: Floats,
    points: Floats,
    point_normals: Floats,
    oriented: bool,
    reach: float,
    origin: Floats,
    step: float,
    feet: Floats,
    normals: Floats,
) -> Floats:
    """Return the mean of min(distance / reach, 1) for each pose (k,); normals that disagree cost 1."""
    result = np.empty(len(rotations))
    for h in prange(len(rotations)):
        result[h] = _cost(
            rotations[h], translations[h], sizes[h], points, point_normals, oriented, reach, origin, step, feet, normals
        )
    return result


@njit(cache=True)
def solve_spd(matrix: Floats, right: Floats) -> Floats:
    """Return the solution of a small symmetric positive definite system, by Cholesky, in place of `matrix`."""
    n = len(right)
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = math.sqrt(max(total, 1e-300)) if i == j else total / matrix[j, j]
    for i in range(n):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
    return right


@njit(cache=True)
def _rotation_of(vector: Floats, rotation: Floats) -> None:
    """Write the rotation matrix of a rotation vector (Rodrigues)."""
    angle = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    if angle < 1e-12:
        s, c = 1.0, 0.5
    else:
        s, c = math.sin(angle) / angle, (1.0 - math.cos(angle)) / (angle * angle)
    x, y, z = vector[0], vector[1], vector[2]
    rotation[0, 0] = 1.0 - c * (y * y + z * z)
    rotation[1, 1] = 1.0 - c * (x * x + z * z)
    rotation[2, 2] = 1.0 - c * (x * x + y * y)
    rotation[0, 1], rotation[1, 0] = c * x * y - s * z, c * x * y + s * z
    rotation[0, 2], rotation[2, 0] = c * x * z + s * y, c * x * z - s * y
    rotation[1, 2], rotation[2, 1] = c * y * z - s * x, c * y * z + s * x


@njit(cache=True)
def _descend(
    rotation: Floats,
    translation: Floats,
    size: float,
    grows: bool,
    points: Floats,
    point_normals: Floats,
    oriented: bool,
    reaches: Floats,
    centre: Floats,
    length: float,
    origin: Floats,
    step: float,
    feet: Floats,
    normals: Floats,
) -> float:
    """Improve one pose in place: a truncated point-to-plane step for each reach; return its size."""
    moved, turned, foot, normal, zero = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.zeros(3)
    middle, row, turn, new = np.empty(3), np.zeros(7), np.empty((3, 3)), np.empty((3, 3))
    for relative in reaches:
        matrix, right = np.zeros((7, 7)), np.zeros(7)
        reach, scaled = size * relative, size * rotation
        _apply(scaled, translation, centre, middle)
        total = 0.0
        for p in range(len(points)):
            _apply(scaled, translation, points[p], moved)
            distance = _look_up(moved, origin, step, feet, normals, foot, normal)
            _apply(rotation, zero, point_normals[p], turned)
            if distance >= reach or not _agrees(turned, normal, oriented):
                continue
            weight = (1.0 - (distance / reach) ** 2) ** 2
            x, y, z = (moved[0] - middle[0]) / length, (moved[1] - middle[1]) / length, (moved[2] - middle[2]) / length
            row[0], row[1], row[2] = (
                y * normal[2] - z * normal[1],
                z * normal[0] - x * normal[2],
                x * normal[1] - y * normal[0],
            )
            row[3], row[4], row[5] = normal[0], normal[1], normal[2]
            if grows:
                row[6] = x * normal[0] + y * normal[1] + z * normal[2]
            gap = 0.0
            for a in range(3):
                gap += (moved[a] - foot[a]) * normal[a]
            total += weight
            for a in range(7):
                right[a] -= weight * row[a] * gap
                for b in range(a + 1):
                    matrix[a, b] += weight * row[a] * row[b]
        if total < 7.0:
            return size
        for a in range(7):
            matrix[a, a] += 0.01 * total
        motion = solve_spd(matrix, right)
        for a in range(3):
            motion[a] /= length
        _rotation_of(motion[:3], turn)
        for a in range(3):
            zero[a] = 0.0
            for b in range(3):
                new[a, b] = turn[a, 0] * rotation[0, b] + turn[a, 1] * rotation[1, b] + turn[a, 2] * rotation[2, b]
        for a in range(3):
            for b in range(3):
                rotation[a, b] = new[a, b]
        size *= 1.0 + min(max(motion[6] / length, -STRIDE), STRIDE)
        _apply(size * rotation, zero, centre, moved)
        for a in range(3):
            translation[a] = middle[a] + motion[3 + a] - moved[a]
    return size


@njit(parallel=True, cache=True)
def descend(
    rotations: Floats,
    translations: Floats,
    sizes: Floats,
    grows: bool,
    points: Floats,
    point_normals: Floats,
    oriented: bool,
    reaches: Floats,
    centre: Floats,
    length: float,
    origin: Floats,
    step: float,
    feet: Floats,
    normals: Floats,
) -> None:
    """Improve each pose of a stack in place by truncated point-to-plane steps, one for each of `reaches` (mm).

    The sizes are improved as well where the cloud `grows`.
    """
    for h in prange(len(rotations)):
        sizes[h] = _descend(
            rotations[h], translations[h], sizes[h], grows, points, point_normals, oriented, reaches, centre, length,
            origin, step, feet, normals,
        )  # fmt: skip
