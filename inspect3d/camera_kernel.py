"""The projection of one point, for kernels that project millions: scalars in, scalars out, nothing allocated.

The same camera as in `inspect3d.camera`; a point with a depth of zero or less lies behind it and has no picture.
"""

from __future__ import annotations

from numba import njit

from inspect3d.arrays import Floats

Pixel = tuple[float, float, float]
Slope = tuple[float, float, float, float, float, float]


@njit(cache=True, error_model="numpy")
def distort(x: float, y: float, distortion: Floats) -> tuple[float, float, float, float, float]:
    """Return the distorted place of (x, y) on z = 1, and its derivatives: du/dx, du/dy = dv/dx, dv/dy."""
    k1, k2, p1, p2, k3 = distortion[0], distortion[1], distortion[2], distortion[3], distortion[4]
    squared = x * x + y * y
    radial = 1.0 + squared * (k1 + squared * (k2 + squared * k3))
    slope = k1 + squared * (2.0 * k2 + squared * 3.0 * k3)
    u = x * radial + 2.0 * p1 * x * y + p2 * (squared + 2.0 * x * x)
    v = y * radial + p1 * (squared + 2.0 * y * y) + 2.0 * p2 * x * y
    u_x = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
    u_y = 2.0 * (x * y * slope + p1 * x + p2 * y)
    v_y = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
    return u, v, u_x, u_y, v_y


@njit(cache=True, error_model="numpy")
def in_camera(rotation: Floats, translation: Floats, px: float, py: float, pz: float) -> Pixel:
    """Return a point (px, py, pz) mm in the camera frame: R X + t."""
    return (
        rotation[0, 0] * px + rotation[0, 1] * py + rotation[0, 2] * pz + translation[0],
        rotation[1, 0] * px + rotation[1, 1] * py + rotation[1, 2] * pz + translation[1],
        rotation[2, 0] * px + rotation[2, 1] * py + rotation[2, 2] * pz + translation[2],
    )


@njit(cache=True, error_model="numpy")
def project_point(
    matrix: Floats, distortion: Floats, rotation: Floats, translation: Floats, px: float, py: float, pz: float
) -> Pixel:
    """Return the pixel (x, y) of a point, and its depth in mm.

    Parameters
    ----------
    matrix : (3, 3) px
    distortion : (5,), k1, k2, p1, p2, k3
    rotation, translation : (3, 3) and (3,) mm, of camera_from_cad
    px, py, pz : mm, the point in the CAD frame
    """
    x, y, depth = in_camera(rotation, translation, px, py, pz)
    u, v, _, _, _ = distort(x / depth, y / depth, distortion)
    return matrix[0, 0] * u + matrix[0, 1] * v + matrix[0, 2], matrix[1, 1] * v + matrix[1, 2], depth


@njit(cache=True, error_model="numpy")
def project_with_slope(
    matrix: Floats, distortion: Floats, rotation: Floats, translation: Floats, px: float, py: float, pz: float
) -> tuple[Pixel, Slope]:
    """Return (x, y, depth) as `project_point` does, and the derivative of (x, y) by the point, px/mm.

    The derivative is dx/dX, dx/dY, dx/dZ, dy/dX, dy/dY, dy/dZ, with (X, Y, Z) the point in the CAD frame. That by a
    small shift of the camera frame is the same times R'; that by a small rotation follows by the cross product.
    """
    cx, cy, depth = in_camera(rotation, translation, px, py, pz)
    over = 1.0 / depth
    x, y = over * cx, over * cy
    u, v, u_x, u_y, v_y = distort(x, y, distortion)
    x_u = over * (matrix[0, 0] * u_x + matrix[0, 1] * u_y)
    x_v = over * (matrix[0, 0] * u_y + matrix[0, 1] * v_y)
    y_u, y_v = over * matrix[1, 1] * u_y, over * matrix[1, 1] * v_y
    x_w, y_w = -(x_u * x + x_v * y), -(y_u * x + y_v * y)
    pixel = matrix[0, 0] * u + matrix[0, 1] * v + matrix[0, 2], matrix[1, 1] * v + matrix[1, 2], depth
    slope = (
        x_u * rotation[0, 0] + x_v * rotation[1, 0] + x_w * rotation[2, 0],
        x_u * rotation[0, 1] + x_v * rotation[1, 1] + x_w * rotation[2, 1],
        x_u * rotation[0, 2] + x_v * rotation[1, 2] + x_w * rotation[2, 2],
        y_u * rotation[0, 0] + y_v * rotation[1, 0] + y_w * rotation[2, 0],
        y_u * rotation[0, 1] + y_v * rotation[1, 1] + y_w * rotation[2, 1],
        y_u * rotation[0, 2] + y_v * rotation[1, 2] + y_w * rotation[2, 2],
    )
    return pixel, slope
