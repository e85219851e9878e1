"""NURBS patches as flat arrays, and the point of one at given parameters: a kernel that allocates nothing.

On one span between knots every basis function is a polynomial; its coefficients are tabled once, so that a point
costs multiplications only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from inspect3d.arrays import Floats, Integers
from inspect3d.virtual.patch import Patch

MOST = 12
"""Most basis functions that act at a parameter: degree 11."""


class PackedPatches(NamedTuple):
    """Patches one after the other.

    Parameters
    ----------
    poles : (k, 4), homogeneous, mm; those of a patch row by row
    spans : (s, 2), lower end and width of each span of knots
    coefficients : (s, p, p), of basis function r and power j of (parameter - lower end) / width, p the largest order
    first : (n, 7) of each patch: pole, poles in a row, span in u, spans in u, span in v, spans in v, sign of the normal
    degrees : (n, 2)
    reach : (s,), the first pole that acts on a span
    """

    poles: Floats
    spans: Floats
    coefficients: Floats
    first: Integers
    degrees: Integers
    reach: Integers


def packed(patches: tuple[Patch, ...]) -> PackedPatches:
    """Return the patches as arrays."""
    order = max(max(_degrees(patch)) for patch in patches) + 1
    if order > MOST:
        raise ValueError(f"a patch has degree {order - 1}; at most {MOST - 1} are handled")
    spans: list[tuple[float, float]] = []
    coefficients, reach, first = [], [], []
    poles = 0
    for patch in patches:
        starts = []
        for knots, degree in zip((patch.knots_u, patch.knots_v), _degrees(patch), strict=True):
            at = degree + np.flatnonzero(np.diff(knots[degree : len(knots) - degree]) > 0)
            starts += [len(spans), len(at)]
            for k in at.tolist():
                spans.append((knots[k], knots[k + 1] - knots[k]))
                coefficients.append(_polynomials(knots, k, degree, order))
                reach.append(k - degree)
        first.append((poles, patch.poles.shape[1], *starts, -1 if patch.reversed else 1))
        poles += patch.poles.shape[0] * patch.poles.shape[1]
    return PackedPatches(
        np.concatenate([patch.poles.reshape(-1, 4) for patch in patches]),
        np.array(spans),
        np.array(coefficients),
        np.array(first),
        np.array([_degrees(patch) for patch in patches]),
        np.array(reach),
    )


def _degrees(patch: Patch) -> tuple[int, int]:
    across, along, _ = patch.poles.shape
    return len(patch.knots_u) - across - 1, len(patch.knots_v) - along - 1


def _polynomials(knots: Floats, span: int, degree: int, order: int) -> Floats:
    """Return the coefficients (order, order) of the basis functions that act on a span.

    Notes
    -----
    The recurrence of Cox and de Boor, applied to polynomials: L. Piegl, W. Tiller, The NURBS Book, 1997, eq. 2.5.
    """
    lower, width = knots[span], knots[span + 1] - knots[span]
    values = np.zeros((order, order))
    values[0, 0] = 1.0
    for p in range(1, degree + 1):
        before, values = values, np.zeros((order, order))
        for r in range(p):
            left, right = knots[span + 1 + r - p], knots[span + 1 + r]
            share = before[r] / (right - left)
            power = np.concatenate([[0.0], width * share[:-1]])
            values[r] += (right - lower) * share - power
            values[r + 1] += (lower - left) * share + power
    return values


@njit(cache=True, nogil=True, error_model="numpy")
def _span(patches: PackedPatches, start: int, count: int, at: float) -> int:
    """Return the span a parameter lies in: the first or the last where it lies beyond."""
    k = start
    while k < start + count - 1 and at >= patches.spans[k + 1, 0]:
        k += 1
    return k


@njit(cache=True, nogil=True, error_model="numpy")
def _write_basis(patches: PackedPatches, span: int, degree: int, at: float, basis: Floats) -> None:
    """Write the basis functions that act on a span, and their slopes, into basis (2, MOST)."""
    width = patches.spans[span, 1]
    t = (at - patches.spans[span, 0]) / width
    for r in range(degree + 1):
        value, slope = patches.coefficients[span, r, degree], 0.0
        for j in range(degree - 1, -1, -1):
            slope = slope * t + value
            value = value * t + patches.coefficients[span, r, j]
        basis[0, r], basis[1, r] = value, slope / width


@njit(cache=True, nogil=True, error_model="numpy")
def write_place(patches: PackedPatches, patch: int, u: float, v: float, basis: Floats, place: Floats) -> None:
    """Write what a patch is at (u, v) into place (4, 3): the point, dS/du, dS/dv, and the outward unit normal.

    Beyond its ends a patch goes on as its last polynomial does. `basis` (2, 2, MOST) is scratch.
    """
    start, row = patches.first[patch, 0], patches.first[patch, 1]
    span_u = _span(patches, patches.first[patch, 2], patches.first[patch, 3], u)
    span_v = _span(patches, patches.first[patch, 4], patches.first[patch, 5], v)
    degree_u, degree_v = patches.degrees[patch, 0], patches.degrees[patch, 1]
    _write_basis(patches, span_u, degree_u, u, basis[0])
    _write_basis(patches, span_v, degree_v, v, basis[1])
    x = y = z = w = xu = yu = zu = wu = xv = yv = zv = wv = 0.0
    for i in range(degree_u + 1):
        at = start + (patches.reach[span_u] + i) * row + patches.reach[span_v]
        sx = sy = sz = sw = tx = ty = tz = tw = 0.0
        for j in range(degree_v + 1):
            value, slope = basis[1, 0, j], basis[1, 1, j]
            k = at + j
            px, py, pz, pw = patches.poles[k, 0], patches.poles[k, 1], patches.poles[k, 2], patches.poles[k, 3]
            sx, sy, sz, sw = sx + value * px, sy + value * py, sz + value * pz, sw + value * pw
            tx, ty, tz, tw = tx + slope * px, ty + slope * py, tz + slope * pz, tw + slope * pw
        value, slope = basis[0, 0, i], basis[0, 1, i]
        x, y, z, w = x + value * sx, y + value * sy, z + value * sz, w + value * sw
        xu, yu, zu, wu = xu + slope * sx, yu + slope * sy, zu + slope * sz, wu + slope * sw
        xv, yv, zv, wv = xv + value * tx, yv + value * ty, zv + value * tz, wv + value * tw
    x, y, z = x / w, y / w, z / w
    xu, yu, zu = (xu - x * wu) / w, (yu - y * wu) / w, (zu - z * wu) / w
    xv, yv, zv = (xv - x * wv) / w, (yv - y * wv) / w, (zv - z * wv) / w
    nx, ny, nz = yu * zv - zu * yv, zu * xv - xu * zv, xu * yv - yu * xv
    length = np.sqrt(nx * nx + ny * ny + nz * nz) * patches.first[patch, 6]
    place[0, 0], place[0, 1], place[0, 2] = x, y, z
    place[1, 0], place[1, 1], place[1, 2] = xu, yu, zu
    place[2, 0], place[2, 1], place[2, 2] = xv, yv, zv
    place[3, 0], place[3, 1], place[3, 2] = nx / length, ny / length, nz / length
