"""Kernel that judges many places of the part by what the pictures show there. Arrays only."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.camera_kernel import project_point


@njit(parallel=True, cache=True, error_model="numpy")
def bare_shares(
    rotations: Floats,
    translations: Floats,
    sizes: Floats,
    rig: tuple[Floats, Floats, Floats, Floats],
    cells: Booleans,
    counts: Integers,
    widths: Floats,
    points: Floats,
) -> Floats:
    """Return for each place of a rig (k,) the share of points of the part that would appear where no texture is.

    Those that would appear in no picture do not count; of those behind a camera, all do.

    Parameters
    ----------
    rotations, translations, sizes : (k, 3, 3), (k, 3) and (k,), cad_from_rig with its scale
    rig : camera matrices (v, 3, 3), distortions (v, 5), rotations (v, 3, 3) and translations (v, 3) in the rig
    cells : (v, rows, columns), textured or not
    counts : (v, 2), how many rows and columns each view has
    widths : (v,) px of a cell
    points : (n, 3) mm, CAD frame
    """
    matrices, distortions, turns, shifts = rig
    result = np.empty(len(rotations))
    for h in prange(len(rotations)):
        missed, inside = 0.0, 0.0
        there = np.empty(3)
        for p in range(len(points)):
            for a in range(3):
                there[a] = 0.0
                for b in range(3):
                    there[a] += rotations[h, b, a] * (points[p, b] - translations[h, b])
                there[a] /= sizes[h]
            for k in range(len(matrices)):
                x, y, depth = project_point(
                    matrices[k], distortions[k], turns[k], shifts[k], there[0], there[1], there[2]
                )
                if not depth > 0.0:
                    missed, inside = missed + 1.0, inside + 1.0
                    continue
                column, row = (x + 0.5) / widths[k], (y + 0.5) / widths[k]
                if column >= 0.0 and row >= 0.0 and column < counts[k, 1] and row < counts[k, 0]:
                    inside += 1.0
                    missed += 0.0 if cells[k, int(row), int(column)] else 1.0
        result[h] = missed / inside if inside > 0.0 else 1.0
    return result
