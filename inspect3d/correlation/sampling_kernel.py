"""Grey level and gradient of a picture between its pixels: numba kernels, one point at a time."""

from __future__ import annotations

from numba import njit

from inspect3d.arrays import Floats, Singles

Sample = tuple[float, float, float]


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def sample_cubic(coefficients: Singles, width: int, height: int, x: float, y: float) -> Sample:
    """Return value, d/dx and d/dy of the cubic B-spline with these coefficients at the pixel (x, y).

    Beyond the last but one pixel the outermost whole patch goes on.
    """
    i = min(max(int(x), 1), width - 3)
    j = min(max(int(y), 1), height - 3)
    s, t = x - i, y - j
    r = 1.0 - s
    b0, b3 = r * r * r / 6.0, s * s * s / 6.0
    b1 = 2.0 / 3.0 - s * s * (1.0 - 0.5 * s)
    b2 = 1.0 - b0 - b1 - b3
    d0, d3 = -0.5 * r * r, 0.5 * s * s
    d1 = s * (1.5 * s - 2.0)
    d2 = -d0 - d1 - d3
    value, slope_x, slope_y = 0.0, 0.0, 0.0
    r = 1.0 - t
    for k in range(4):
        row = coefficients[j - 1 + k]
        along = b0 * row[i - 1] + b1 * row[i] + b2 * row[i + 1] + b3 * row[i + 2]
        steep = d0 * row[i - 1] + d1 * row[i] + d2 * row[i + 1] + d3 * row[i + 2]
        if k == 0:
            weight, change = r * r * r / 6.0, -0.5 * r * r
        elif k == 1:
            weight, change = 2.0 / 3.0 - t * t * (1.0 - 0.5 * t), t * (1.5 * t - 2.0)
        elif k == 2:
            weight, change = 2.0 / 3.0 - r * r * (1.0 - 0.5 * r), r * (2.0 - 1.5 * r)
        else:
            weight, change = t * t * t / 6.0, 0.5 * t * t
        value += weight * along
        slope_x += weight * steep
        slope_y += change * along
    return value, slope_x, slope_y


@njit(cache=True, error_model="numpy")
def sample_linear(picture: Singles, width: int, height: int, x: float, y: float) -> Sample:
    """Return value, d/dx and d/dy of the bilinear interpolation at the pixel (x, y), as in the paper."""
    i = min(max(int(x), 0), width - 2)
    j = min(max(int(y), 0), height - 2)
    s, t = x - i, y - j
    a, b, c, d = picture[j, i], picture[j, i + 1], picture[j + 1, i], picture[j + 1, i + 1]
    upper, lower = a + s * (b - a), c + s * (d - c)
    return upper + t * (lower - upper), (1.0 - t) * (b - a) + t * (d - c), lower - upper


@njit(cache=True)
def sample_all(picture: Singles, cubic: bool, places: Floats, found: Floats) -> None:
    """Write value and gradient (n, 3) of a picture at places (n, 2) px; `cubic`: it holds B-spline coefficients."""
    height, width = picture.shape
    for n in range(len(places)):
        if cubic:
            found[n] = sample_cubic(picture, width, height, places[n, 0], places[n, 1])
        else:
            found[n] = sample_linear(picture, width, height, places[n, 0], places[n, 1])
