"""Read the pictures at the evaluation points of a facet: numba kernels over plain arrays; see `facet_kernel`.

What is read of a facet stands in rows, one for each quantity, along which the points lie side by side, so that one
instruction handles several of them.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from inspect3d.arrays import Floats, Integers, Singles
from inspect3d.camera_kernel import distort, in_camera, project_with_slope
from inspect3d.correlation.sampling_kernel import sample_cubic, sample_linear

Stack = tuple[Singles, Integers, bool, int]
Rig = tuple[Floats, Floats, Floats, Floats, Floats]
Points = tuple[Floats, Floats, Integers, Integers, Floats]

GREY, SLOPE, AT, SLIDE, ALONG, PIXEL, READING = 0, 1, 3, 5, 7, 11, 17
"""Rows of a reading: the grey level; its slopes in the material (P T)' g (2 rows); where the point is in the picture
(2); how far over the material the picture slides when the surface moves by one along its normal, (P T)⁻¹ P n (2); P T
by columns (4); P by rows (6)."""

SHAPE, NORMAL, PLACE, PLACED = 0, 3, 6, 9
"""Rows of what is placed: the barycentric coordinates of the points (3), their unit normals (3), the points, mm (3)."""


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def place_facet(points: Points, f: int, deviation: Floats, placed: Floats) -> int:
    """Put a facet's n points, which are returned, where the deviation moves them; write the rows of `placed`."""
    places, shapes, starts, corners, normals = points
    a, b, d = corners[f]
    ax, ay, az, u = normals[a, 0], normals[a, 1], normals[a, 2], deviation[a]
    bx, by, bz, v = normals[b, 0], normals[b, 1], normals[b, 2], deviation[b]
    dx, dy, dz, w = normals[d, 0], normals[d, 1], normals[d, 2], deviation[d]
    here, shape = places[starts[f] : starts[f + 1]], shapes[starts[f] : starts[f + 1]]
    for q in range(len(here)):
        sa, sb, sd = shape[q, 0], shape[q, 1], shape[q, 2]
        nx, ny, nz = sa * ax + sb * bx + sd * dx, sa * ay + sb * by + sd * dy, sa * az + sb * bz + sd * dz
        over = 1.0 / np.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = over * nx, over * ny, over * nz
        lift = sa * u + sb * v + sd * w
        placed[SHAPE, q], placed[SHAPE + 1, q], placed[SHAPE + 2, q] = sa, sb, sd
        placed[NORMAL, q], placed[NORMAL + 1, q], placed[NORMAL + 2, q] = nx, ny, nz
        placed[PLACE, q] = here[q, 0] + lift * nx
        placed[PLACE + 1, q] = here[q, 1] + lift * ny
        placed[PLACE + 2, q] = here[q, 2] + lift * nz
    return len(here)


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def see_facet(rig: Rig, k: int, placed: Floats, n: int, reading: Floats) -> None:
    """Project the n points of `placed` to view k; write all rows of `reading` but grey level and slopes."""
    matrix, distortion, rotation, translation = rig[0][k], rig[1][k], rig[2][k], rig[3][k]
    for q in range(n):
        nx, ny, nz = placed[NORMAL, q], placed[NORMAL + 1, q], placed[NORMAL + 2, q]
        x, y, z = placed[PLACE, q], placed[PLACE + 1, q], placed[PLACE + 2, q]
        pixel, slope = project_with_slope(matrix, distortion, rotation, translation, x, y, z)
        xx, xy, xz, yx, yy, yz = slope
        sign = 1.0 if nz >= 0 else -1.0  # tangents without a branch: Duff et al., J. Comput. Graph. Tech. 6(1), 2017
        e = -1.0 / (sign + nz)
        g = nx * ny * e
        t1x, t1y, t1z = 1.0 + sign * nx * nx * e, sign * g, -sign * nx
        t2x, t2y, t2z = g, sign + ny * ny * e, -ny
        m00, m01 = xx * t1x + xy * t1y + xz * t1z, xx * t2x + xy * t2y + xz * t2z
        m10, m11 = yx * t1x + yy * t1y + yz * t1z, yx * t2x + yy * t2y + yz * t2z
        over = 1.0 / (m00 * m11 - m01 * m10)
        dx, dy = xx * nx + xy * ny + xz * nz, yx * nx + yy * ny + yz * nz
        reading[AT, q], reading[AT + 1, q] = pixel[0], pixel[1]
        reading[SLIDE, q], reading[SLIDE + 1, q] = over * (m11 * dx - m01 * dy), over * (m00 * dy - m10 * dx)
        reading[ALONG, q], reading[ALONG + 1, q], reading[ALONG + 2, q], reading[ALONG + 3, q] = m00, m10, m01, m11
        reading[PIXEL, q], reading[PIXEL + 1, q], reading[PIXEL + 2, q] = xx, xy, xz
        reading[PIXEL + 3, q], reading[PIXEL + 4, q], reading[PIXEL + 5, q] = yx, yy, yz


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def sample_facet(stack: Stack, k: int, n: int, reading: Floats) -> None:
    """Sample view k where its n points were seen; write the rows of grey level and slopes."""
    levels, sizes, cubic, step = stack
    picture, width, height = levels[k], sizes[k, 0], sizes[k, 1]
    over = 1.0 / step
    for q in range(n):
        x, y = over * reading[AT, q], over * reading[AT + 1, q]
        if cubic:
            v, gx, gy = sample_cubic(picture, width, height, x, y)
        else:
            v, gx, gy = sample_linear(picture, width, height, x, y)
        reading[GREY, q] = v
        reading[SLOPE, q] = over * (reading[ALONG, q] * gx + reading[ALONG + 1, q] * gy)
        reading[SLOPE + 1, q] = over * (reading[ALONG + 2, q] * gx + reading[ALONG + 3, q] * gy)


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def write_columns(
    columns: Integers, k: int, rig: Rig, placed: Floats, reading: Floats, gradient: Floats, n: int, rows: Floats
) -> None:
    """Write how fast the grey level of view k changes with its camera parameters, h . dx/dp, for h = (P T)⁻ᵀ G.

    Parameters
    ----------
    placed, reading : the rows named above
    gradient : (2, most), G
    rows : (c, most), written
    """
    matrices, distortions, rotations, translations, origin = rig
    for q in range(n):
        m00, m10, m01, m11 = reading[ALONG, q], reading[ALONG + 1, q], reading[ALONG + 2, q], reading[ALONG + 3, q]
        over = 1.0 / (m00 * m11 - m01 * m10)
        hx = over * (m11 * gradient[0, q] - m10 * gradient[1, q])
        hy = over * (m00 * gradient[1, q] - m01 * gradient[0, q])
        vx = hx * reading[PIXEL, q] + hy * reading[PIXEL + 3, q]
        vy = hx * reading[PIXEL + 1, q] + hy * reading[PIXEL + 4, q]
        vz = hx * reading[PIXEL + 2, q] + hy * reading[PIXEL + 5, q]
        px, py, pz = placed[PLACE, q], placed[PLACE + 1, q], placed[PLACE + 2, q]
        cx, cy, cz = in_camera(rotations[k], translations[k], px, py, pz)
        for j in range(len(columns)):
            column = columns[j]
            if column < 6:
                mx, my, mz = _motion(column, px - origin[0], py - origin[1], pz - origin[2])
                rows[j, q] = vx * mx + vy * my + vz * mz
            else:
                dx, dy = lens_slope(column, matrices[k], distortions[k], cx / cz, cy / cz)
                rows[j, q] = hx * dx + hy * dy


@njit(cache=True, error_model="numpy")
def _motion(column: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return how a point at (x, y, z) from the origin moves: in turns about the axes (0 to 2), in shifts (3 to 5)."""
    if column == 0:
        return 0.0, -z, y
    if column == 1:
        return z, 0.0, -x
    if column == 2:
        return -y, x, 0.0
    return 1.0 * (column == 3), 1.0 * (column == 4), 1.0 * (column == 5)


@njit(cache=True, error_model="numpy")
def lens_slope(column: int, matrix: Floats, distortion: Floats, x: float, y: float) -> tuple[float, float]:
    """Return the derivative (dx, dy) of the pixel of (x, y, 1) by fx, fy, cx, cy (6 to 9), k1 to k3 (to 14), skew."""
    if column == 6 or column == 7 or column == 15:
        u, v, _, _, _ = distort(x, y, distortion)
        return (0.0, v) if column == 7 else (u if column == 6 else v, 0.0)
    if column == 8 or column == 9:
        return (1.0, 0.0) if column == 8 else (0.0, 1.0)
    squared = x * x + y * y
    if column == 12:
        du, dv = 2.0 * x * y, squared + 2.0 * y * y
    elif column == 13:
        du, dv = squared + 2.0 * x * x, 2.0 * x * y
    else:
        radial = squared if column == 10 else squared * squared if column == 11 else squared * squared * squared
        du, dv = x * radial, y * radial
    return matrix[0, 0] * du + matrix[0, 1] * dv, matrix[1, 1] * dv
