"""Dots of paint in space: a numba kernel over plain arrays."""

from __future__ import annotations

import numpy as np
from numba import njit

from inspect3d.arrays import Floats

DOTS = 2
LOW, ONE = np.uint64(0x1FFFFF), float(0x200000)  # 21 bits, and the number one above them


@njit(cache=True, nogil=True, error_model="numpy")
def write_bareness(points: Floats, cell: float, softness: float, seed: int, bare: Floats) -> None:
    """Write how little paint there is at points (n, 3) mm: one where none is, zero inside a dot.

    Each cube of a grid holds `DOTS` balls, their centres at random in the cube, their radius half the side of the cube:
    no ball reaches farther than the eight cubes around a point that are nearest to it. Paint fades over the outer
    `softness` of the radius, twice continuously differentiable.
    """
    for i in range(len(points)):
        x, y, z = points[i, 0] / cell, points[i, 1] / cell, points[i, 2] / cell
        x0, y0, z0 = int(np.floor(x - 0.5)), int(np.floor(y - 0.5)), int(np.floor(z - 0.5))
        left = 1.0
        for a in range(x0, x0 + 2):
            for b in range(y0, y0 + 2):
                for c in range(z0, z0 + 2):
                    for dot in range(DOTS):
                        bits = _hashed(a, b, c, DOTS * seed + dot)
                        dx = a + (bits & LOW) / ONE - x
                        dy = b + ((bits >> np.uint64(21)) & LOW) / ONE - y
                        dz = c + ((bits >> np.uint64(42)) & LOW) / ONE - z
                        squared = dx * dx + dy * dy + dz * dz
                        if squared < 0.25:
                            t = min((1.0 - 2.0 * np.sqrt(squared)) / softness, 1.0)
                            left *= 1.0 - t * t * t * (t * (6.0 * t - 15.0) + 10.0)
        bare[i] = left


@njit(cache=True, nogil=True)
def _hashed(a: int, b: int, c: int, seed: int) -> np.uint64:
    """Return 64 random bits that belong to a cube.

    Notes
    -----
    The finaliser of splitmix64: G. L. Steele, D. Lea, C. H. Flood, Fast Splittable Pseudorandom Number Generators,
    2014.
    """
    bits = np.uint64(a) * np.uint64(0x9E3779B97F4A7C15)
    bits ^= np.uint64(b) * np.uint64(0xC2B2AE3D27D4EB4F)
    bits ^= np.uint64(c) * np.uint64(0x165667B19E3779F9)
    bits += np.uint64(seed) * np.uint64(0xD6E8FEB86659FD93)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))
