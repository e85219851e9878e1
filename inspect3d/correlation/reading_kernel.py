"""Read the pictures at the evaluation points of a facet: numba kernels over plain arrays; see `facet_kernel`."""

from __future__ import annotations

import numpy as np
from numba import njit

from inspect3d.arrays import Floats, Integers
from inspect3d.camera_kernel import distort, in_camera, project_with_slope
from inspect3d.correlation.sampling_kernel import sample_cubic, sample_linear

Stack = tuple[Floats, Integers, bool]
Rig = tuple[Floats, Floats, Floats, Floats, Floats]
Points = tuple[Floats, Floats, Integers, Integers, Floats]


@njit(cache=True, error_model="numpy")
def read_facet(
    stack: Stack,
    rig: Rig,
    points: Points,
    f: int,
    seen: Integers,
    deviation: Floats,
    columns: Integers,
    grey: Floats,
    slopes: Floats,
    normal_slides: Floats,
    slides: Floats,
    shape: Floats,
) -> int:
    """Sample the views at a facet's points; return how many points count.

    Writes grey levels, their slopes in the material (P T)' g, and how far over the material the picture slides when
    the surface moves by one along its normal, (P T)⁻¹ P n, or a camera parameter grows by one, (P T)⁻¹ dx/dp.
    """
    places, shapes, starts, corners, normals = points
    levels, sizes, cubic = stack
    matrices, distortions, rotations, translations, origin = rig
    a, b, d = corners[f]
    n = 0
    for p in range(starts[f], starts[f + 1]):
        sa, sb, sd = shapes[p]
        nx = sa * normals[a, 0] + sb * normals[b, 0] + sd * normals[d, 0]
        ny = sa * normals[a, 1] + sb * normals[b, 1] + sd * normals[d, 1]
        nz = sa * normals[a, 2] + sb * normals[b, 2] + sd * normals[d, 2]
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx / length, ny / length, nz / length
        sign = 1.0 if nz >= 0 else -1.0  # tangents without a branch: Duff et al., J. Comput. Graph. Tech. 6(1), 2017
        e = -1.0 / (sign + nz)
        g = nx * ny * e
        t1x, t1y, t1z = 1.0 + sign * nx * nx * e, sign * g, -sign * nx
        t2x, t2y, t2z = g, sign + ny * ny * e, -ny
        lift = sa * deviation[a] + sb * deviation[b] + sd * deviation[d]
        x, y, z = places[p, 0] + lift * nx, places[p, 1] + lift * ny, places[p, 2] + lift * nz
        for m in range(len(seen)):
            k = seen[m]
            pixel, slope = project_with_slope(matrices[k], distortions[k], rotations[k], translations[k], x, y, z)
            xx, xy, xz, yx, yy, yz = slope
            if cubic:
                v, gx, gy = sample_cubic(levels[k], sizes[k, 0], sizes[k, 1], pixel[0], pixel[1])
            else:
                v, gx, gy = sample_linear(levels[k], sizes[k, 0], sizes[k, 1], pixel[0], pixel[1])
            m00, m01 = xx * t1x + xy * t1y + xz * t1z, xx * t2x + xy * t2y + xz * t2z
            m10, m11 = yx * t1x + yy * t1y + yz * t1z, yx * t2x + yy * t2y + yz * t2z
            over = 1.0 / (m00 * m11 - m01 * m10)
            grey[m, n] = v
            slopes[m, n, 0], slopes[m, n, 1] = m00 * gx + m10 * gy, m01 * gx + m11 * gy
            dx, dy = xx * nx + xy * ny + xz * nz, yx * nx + yy * ny + yz * nz
            normal_slides[m, n, 0] = over * (m11 * dx - m01 * dy)
            normal_slides[m, n, 1] = over * (m00 * dy - m10 * dx)
            if len(columns):
                cx, cy, cz = in_camera(rotations[k], translations[k], x, y, z)
                for j in range(len(columns)):
                    if columns[j] < 6:
                        mx, my, mz = _motion(columns[j], x - origin[0], y - origin[1], z - origin[2])
                        dx, dy = xx * mx + xy * my + xz * mz, yx * mx + yy * my + yz * mz
                    else:
                        dx, dy = lens_slope(columns[j], matrices[k], distortions[k], cx / cz, cy / cz)
                    slides[m, n, j, 0] = over * (m11 * dx - m01 * dy)
                    slides[m, n, j, 1] = over * (m00 * dy - m10 * dx)
        shape[n, 0], shape[n, 1], shape[n, 2] = sa, sb, sd
        n += 1
    return n


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


@njit(cache=True, error_model="numpy")
def normalise(grey: Floats, views: int, n: int, spread: Floats) -> bool:
    """Bring each view's grey levels to mean 0 and variance 1; return False where one has no contrast at all."""
    for m in range(views):
        mean = 0.0
        for q in range(n):
            mean += grey[m, q]
        mean /= n
        square = 0.0
        for q in range(n):
            grey[m, q] -= mean
            square += grey[m, q] * grey[m, q]
        spread[m] = np.sqrt(square / n)
        if not spread[m] > 1e-9 * (1.0 + abs(mean)):
            return False
        for q in range(n):
            grey[m, q] /= spread[m]
    return True


@njit(cache=True, error_model="numpy")
def share(slopes: Floats, views: int, n: int, spread: Floats) -> None:
    """Turn each view's slopes into its part of the shared gradient, w_k (P_k T)' g_k / s_k / sum w."""
    total = 0.0
    for m in range(views):
        total += spread[m] ** 2
    for m in range(views):
        part = spread[m] / total
        for q in range(n):
            slopes[m, q, 0] *= part
            slopes[m, q, 1] *= part
