"""Closest points of triangles: numba kernels over plain arrays.

A triangle has seven features a foot can lie on: 0 the face, 1 to 3 the edges ab, bc, ca, and 4 to 6 the vertices
a, b, c.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.nominal.bvh import LANES, Tree
from inspect3d.nominal.features import Features
from inspect3d.nominal.gather_kernel import gathered_normal
from inspect3d.nominal.nearest_kernel import write_nearest

BATCH = 512


@njit(cache=True, parallel=True)
def closest(
    points: Floats,
    visit: Integers,
    tree: Tree,
    features: Features,
    feet: Floats,
    distance: Floats,
    normals: Floats,
    triangle: Integers,
    on_rim: Booleans,
) -> None:
    """Write the feet of points[visit]; neighbours in `visit` should be neighbours in space.

    Parameters
    ----------
    points : (n, 3) mm, from the origin of the tree
    visit : (k,) which points, in which order
    tree : the arrays of `Tree`
    features : the arrays of `Features`
    feet, distance, normals, triangle, on_rim : (n, ...), written
    """
    for batch in prange((len(visit) + BATCH - 1) // BATCH):
        turn = visit[batch * BATCH : (batch + 1) * BATCH]
        _closest_in_turn(points, turn, tree, features, feet, distance, normals, triangle, on_rim)


@njit(cache=True)
def _closest_in_turn(
    points: Floats,
    visit: Integers,
    tree: Tree,
    features: Features,
    feet: Floats,
    distance: Floats,
    normals: Floats,
    triangle: Integers,
    on_rim: Booleans,
) -> None:
    here, slots = np.empty((len(visit), 3)), np.empty(len(visit), dtype=np.int64)
    for k in range(len(visit)):
        for axis in range(3):
            here[k, axis] = points[visit[k], axis] - tree.origin[axis]
    write_nearest(here, tree, slots)
    for k in range(len(visit)):
        i, packet, lane = visit[k], slots[k] // LANES, slots[k] % LANES
        x, y, z = here[k]
        feature, vx, vy, vz = _foot(x, y, z, tree.packets[packet], lane)
        length = math.sqrt(vx * vx + vy * vy + vz * vz)

        triangle[i] = tree.members[packet, lane]
        which = features.of_triangle[triangle[i], feature]
        nx, ny, nz = features.normals[which]
        on_rim[i] = features.rims[which]
        if _doubtful(feature, on_rim[i], nx, ny, nz, vx, vy, vz, length, tree.packets[packet], lane):
            nx, ny, nz, on_rim[i] = gathered_normal(x - vx, y - vy, z - vz, tree, features)
        if nx == 0 and ny == 0 and nz == 0:
            nx, ny, nz = (vx / length, vy / length, vz / length) if length > 0 else (0.0, 0.0, 1.0)

        distance[i] = -length if nx * vx + ny * vy + nz * vz < 0 else length
        normals[i, 0], normals[i, 1], normals[i, 2] = nx, ny, nz
        feet[i, 0], feet[i, 1], feet[i, 2] = points[i, 0] - vx, points[i, 1] - vy, points[i, 2] - vz


@njit(cache=True)
def _foot(x: float, y: float, z: float, packet: Floats, lane: int) -> tuple[int, float, float, float]:
    """Return the feature a foot lies on, and the vector from there to the point; by the rule of the nearest kernel."""
    nx, ny, nz = packet[9, lane], packet[10, lane], packet[11, lane]
    height = nx * (x - packet[0, lane]) + ny * (y - packet[1, lane]) + nz * (z - packet[2, lane])
    feature, vx, vy, vz = 0, height * nx, height * ny, height * nz
    least = np.inf
    for k in range(3):
        i, j = 3 * k, 3 * ((k + 1) % 3)
        px, py, pz = x - packet[i, lane], y - packet[i + 1, lane], z - packet[i + 2, lane]
        qx, qy, qz = x - packet[j, lane], y - packet[j + 1, lane], z - packet[j + 2, lane]
        ex = packet[j, lane] - packet[i, lane]
        ey = packet[j + 1, lane] - packet[i + 1, lane]
        ez = packet[j + 2, lane] - packet[i + 2, lane]
        if nx * (ey * pz - ez * py) + ny * (ez * px - ex * pz) + nz * (ex * py - ey * px) > 0:
            continue
        along, whole = ex * px + ey * py + ez * pz, ex * ex + ey * ey + ez * ez
        candidate = 1 + k
        if along <= 0:
            candidate = 4 + k
        elif along >= whole:
            candidate = 4 + (k + 1) % 3
            px, py, pz = qx, qy, qz
        else:
            s = along / whole
            px, py, pz = px - s * ex, py - s * ey, pz - s * ez
        square = px * px + py * py + pz * pz
        if square < least:
            least, feature, vx, vy, vz = square, candidate, px, py, pz
    return feature, vx, vy, vz


@njit(cache=True)
def _doubtful(
    feature: int,
    rim: bool,
    nx: float,
    ny: float,
    nz: float,
    vx: float,
    vy: float,
    vz: float,
    length: float,
    packet: Floats,
    lane: int,
) -> bool:
    """Tell whether a pseudo-normal N is missing, or cannot belong to a foot with the vector v to the point.

    From a foot on an edge, v lies between the normals of the two faces, so no farther from N than they are. Otherwise
    the foot lies on another edge: at the tip of a needle two of them are equally near for all that rounding can tell.
    """
    if nx == 0 and ny == 0 and nz == 0:
        return True
    if feature == 0 or feature > 3 or rim:
        return False
    spread = nx * packet[9, lane] + ny * packet[10, lane] + nz * packet[11, lane]
    return abs(nx * vx + ny * vy + nz * vz) < (spread - 1e-6) * length
