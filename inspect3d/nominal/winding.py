"""Which side of a mesh is outside."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.nominal.surface import Surface


class Wound(NamedTuple):
    """Triangles that agree on their outside.

    Parameters
    ----------
    triangles : (m, 3)
    disagreeing : how many were turned to agree with the greater part of their neighbours
    inverted : how many triangles of closed bodies were turned outside out
    open : (m,) the triangle belongs to a sheet that is not closed
    two_sided : False where neighbours cannot agree, as on a Möbius strip
    """

    triangles: Integers
    disagreeing: int
    inverted: int
    open: Booleans
    two_sided: bool


def wound(vertices: Floats, triangles: Integers, flip: bool = False) -> Wound:
    """Return triangles wound alike, closed ones with their normals out of the material.

    A closed body has a positive volume then; a body within another keeps its winding relative to it, so that a void
    stays one. An open sheet keeps the winding of the greater part of it, or is turned by `flip`.

    Parameters
    ----------
    vertices : (n, 3) mm
    triangles : (m, 3), not degenerate, none twice
    """
    sheet, turned, two_sided, is_open = _sheets(triangles)
    triangles = np.where(turned[:, None], triangles[:, ::-1], triangles)
    inside_out = _inside_out(vertices, triangles, sheet, is_open)
    turn = np.where(is_open, flip, inside_out)[sheet]
    triangles = np.where(turn[:, None], triangles[:, ::-1], triangles)
    inverted = int(inside_out[sheet].sum())
    return Wound(triangles, int(turned.sum()), inverted, is_open[sheet], two_sided)


def _sheets(triangles: Integers) -> tuple[Integers, Booleans, bool, Booleans]:
    """Return the sheet of each triangle, whether to turn it, whether all then agree, and which sheets are open.

    Neighbours share a side that has no third triangle. They agree if they run along it in opposite directions.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    m = len(triangles)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    keys = np.minimum(start, end) * (triangles.max() + 1) + np.maximum(start, end)
    _, side, uses = np.unique(keys, return_inverse=True, return_counts=True)
    order = np.argsort(side, kind="stable")
    pair = (np.cumsum(uses) - uses)[uses == 2]
    first, second = order[pair], order[pair + 1]
    one, other, agree = first // 3, second // 3, start[first] != start[second]
    sheets, sheet = connected_components(coo_array((np.ones(len(one)), (one, other)), shape=(m, m)), directed=False)
    # Two copies of each triangle, one turned, joined where they agree: a sheet has two sides if they stay apart.
    a, b = np.concatenate([one, one + m]), np.concatenate([other + m * ~agree, other + m * agree])
    _, side_of = connected_components(coo_array((np.ones(len(a)), (a, b)), shape=(2 * m, 2 * m)), directed=False)
    first_of_sheet = np.unique(sheet, return_index=True)[1]
    turned = side_of[:m] != side_of[first_of_sheet][sheet]
    most = np.bincount(sheet, turned, minlength=sheets) > np.bincount(sheet, minlength=sheets) / 2
    is_open = np.bincount(sheet, (uses[side].reshape(-1, 3) != 2).any(axis=1), minlength=sheets) > 0
    return sheet, turned ^ most[sheet], bool((side_of[:m] != side_of[m:]).all()), is_open


def _inside_out(vertices: Floats, triangles: Integers, sheet: Integers, is_open: Booleans) -> Booleans:
    """Tell which sheets are closed bodies, or within ones, whose normals point into the material."""
    corners = vertices[triangles]
    first = np.unique(sheet, return_index=True)[1]
    a, b, c = (corners[:, k] - corners[first[sheet], 0] for k in range(3))
    volume = np.bincount(sheet, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0)
    outermost = np.arange(len(first))
    low = np.full((len(first), 3), np.inf)
    high = -low
    np.minimum.at(low, sheet, corners.min(axis=1))
    np.maximum.at(high, sheet, corners.max(axis=1))
    size = np.where(is_open, -1.0, np.abs(volume))
    for outer in np.argsort(size)[size[np.argsort(size)] > 0]:
        within = (low >= low[outer]).all(axis=1) & (high <= high[outer]).all(axis=1) & ~is_open & (size < size[outer])
        candidates = np.flatnonzero(within)
        if len(candidates):
            shell = Surface(vertices, triangles[sheet == outer])
            depth = shell.closest(corners[first[candidates], 0]).distance * np.sign(volume[outer])
            outermost[candidates[depth < 0]] = outer
    return (volume[outermost] < 0) & ~is_open
