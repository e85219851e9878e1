"""Lines of sight and where they end on the exact, deviated surface: numba kernels over plain arrays.

They hold no lock and use one thread each, so that several bands of a picture can be worked on at once.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from inspect3d.arrays import Floats, Integers
from inspect3d.camera_kernel import distort
from inspect3d.virtual.patch_kernel import MOST, PackedPatches, write_place

ROUNDS = 12
SETTLED = 1e-5  # mm; the next step of Newton would be its square over the radius of curvature
LONGEST = 2.0  # mm; a step longer than that leads nowhere
LENS_ROUNDS = 30
LENS_SETTLED = 1e-13


@njit(cache=True, nogil=True, error_model="numpy")
def write_sights(matrix: Floats, distortion: Floats, rotation: Floats, pixels: Floats, directions: Floats) -> bool:
    """Write the unit directions (n, 3), CAD frame, in which pixels look.

    Parameters
    ----------
    pixels : (n, 2) px; fast where neighbours follow each other
    matrix, distortion : of the camera
    rotation : (3, 3), of camera_from_cad
    directions : (n, 3), written

    Returns
    -------
    Whether the distortion could be undone everywhere.
    """
    x = y = last_x = last_y = 0.0
    for i in range(len(pixels)):
        wanted_y = (pixels[i, 1] - matrix[1, 2]) / matrix[1, 1]
        wanted_x = (pixels[i, 0] - matrix[0, 2] - matrix[0, 1] * wanted_y) / matrix[0, 0]
        x, y = x + wanted_x - last_x, y + wanted_y - last_y
        last_x, last_y = wanted_x, wanted_y
        settled = False
        for _ in range(LENS_ROUNDS):
            u, v, u_x, u_y, v_y = distort(x, y, distortion)
            scale = u_x * v_y - u_y * u_y
            if not scale > 0.0:
                return False
            step_x = ((wanted_x - u) * v_y - (wanted_y - v) * u_y) / scale
            step_y = ((wanted_y - v) * u_x - (wanted_x - u) * u_y) / scale
            x, y = x + step_x, y + step_y
            settled = step_x * step_x + step_y * step_y < LENS_SETTLED
            if settled:
                break
        if not settled:
            return False
        length = np.sqrt(x * x + y * y + 1.0)
        for axis in range(3):
            directions[i, axis] = (rotation[0, axis] * x + rotation[1, axis] * y + rotation[2, axis]) / length
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def interpolate(
    origin: Floats,
    directions: Floats,
    triangle: Integers,
    distance: Floats,
    corners: Floats,
    at_corners: Floats,
    at: Floats,
) -> None:
    """Write the values (n, k) at the ends of rays, interpolated from those (m, 3, k) at the corners of triangles.

    Parameters
    ----------
    origin, directions : (3,) mm and (n, 3), unit
    triangle, distance : (n,), met by each ray, -1 for none, and how far along it, mm
    corners : (m, 3, 3) mm
    """
    for i in range(len(directions)):
        met = triangle[i]
        if met < 0:
            continue
        a, b, c = corners[met, 0], corners[met, 1], corners[met, 2]
        bb = cc = bc = bp = cp = 0.0
        for axis in range(3):
            p = origin[axis] + distance[i] * directions[i, axis] - a[axis]
            e, f = b[axis] - a[axis], c[axis] - a[axis]
            bb, cc, bc, bp, cp = bb + e * e, cc + f * f, bc + e * f, bp + e * p, cp + f * p
        scale = bb * cc - bc * bc
        s, t = (cc * bp - bc * cp) / scale, (bb * cp - bc * bp) / scale
        for k in range(at_corners.shape[2]):
            first = at_corners[met, 0, k]
            at[i, k] = first + s * (at_corners[met, 1, k] - first) + t * (at_corners[met, 2, k] - first)


@njit(cache=True, nogil=True, error_model="numpy")
def slide(
    origin: Floats,
    directions: Floats,
    which: Integers,
    face: Integers,
    patches: PackedPatches,
    at: Floats,
    points: Floats,
    normals: Floats,
) -> None:
    """Move places over their patches until S(u, v) + h n(u, v) lies on their rays.

    Newton's method on the two distances across the ray, the turning of the normal left out of the derivative. A place
    that does not settle, as where a ray only just touches the surface, stays where it began.

    Parameters
    ----------
    origin, directions : (3,) mm and (n, 3), unit
    which : (k,), the rays to work on
    face : (n,), the patch of each ray
    at : (n, 3), u and v, improved, and h, mm
    points, normals : (n, 3) mm and unit, written: S and n there
    """
    basis, place, across = np.empty((2, 2, MOST)), np.empty((4, 3)), np.empty((2, 3))
    for i in which:
        _write_across(directions[i], across)
        u, v, h = at[i, 0], at[i, 1], at[i, 2]
        du = dv = 0.0
        settled = False
        for _ in range(ROUNDS):
            write_place(patches, face[i], u, v, basis, place)
            f = g = fu = fv = gu = gv = 0.0
            for axis in range(3):
                off = place[0, axis] + h * place[3, axis] - origin[axis]
                f, g = f + across[0, axis] * off, g + across[1, axis] * off
                fu, gu = fu + across[0, axis] * place[1, axis], gu + across[1, axis] * place[1, axis]
                fv, gv = fv + across[0, axis] * place[2, axis], gv + across[1, axis] * place[2, axis]
            scale = fu * gv - fv * gu
            du, dv = (fv * g - gv * f) / scale, (gu * f - fu * g) / scale
            moved = 0.0
            for axis in range(3):
                moved += (place[1, axis] * du + place[2, axis] * dv) ** 2
            if not moved < LONGEST * LONGEST:
                break
            u, v = u + du, v + dv
            settled = moved < SETTLED * SETTLED
            if settled:
                break
        if not settled:
            du = dv = 0.0
            u, v = at[i, 0], at[i, 1]
            write_place(patches, face[i], u, v, basis, place)
        at[i, 0], at[i, 1] = u, v
        for axis in range(3):
            points[i, axis] = place[0, axis] + place[1, axis] * du + place[2, axis] * dv
            normals[i, axis] = place[3, axis]


@njit(cache=True, nogil=True, error_model="numpy")
def _write_across(direction: Floats, across: Floats) -> None:
    """Write two unit vectors (2, 3) at right angles to a direction and to each other."""
    x, y, z = direction[0], direction[1], direction[2]
    if abs(x) < abs(z):
        length = np.sqrt(y * y + z * z)
        ax, ay, az = 0.0, z / length, -y / length
    else:
        length = np.sqrt(x * x + y * y)
        ax, ay, az = -y / length, x / length, 0.0
    across[0, 0], across[0, 1], across[0, 2] = ax, ay, az
    across[1, 0], across[1, 1], across[1, 2] = y * az - z * ay, z * ax - x * az, x * ay - y * ax
