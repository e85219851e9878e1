"""A tree of boxes over triangles, as flat arrays a numba kernel can walk."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inspect3d.arrays import Floats

LEAF = 4
BINS = 16
MEDIAN_DEPTH = 40
STACK = 96


class Tree(NamedTuple):
    """Boxes around boxes around triangles.

    Parameters
    ----------
    boxes : (k, 6) mm, lower and upper corner of each node, a rounding error larger than what it holds
    links : (k, 2) first and count: a leaf holds `order[first : first + count]`; a node of count 0 has the children
        first and first + 1. Node 0 is the root.
    order : (m,) the triangles, those of a leaf side by side
    """

    boxes: Floats
    links: NDArray[np.int32]
    order: NDArray[np.int32]


def build(corners: Floats) -> Tree:
    """Return the tree over triangles with corners (m, 3, 3) mm.

    Nodes are split where the surface area heuristic, evaluated on 16 bins of the longest axis, is least, down to 4
    triangles per leaf; below depth 40 they are split in halves, so that no walk is deeper than `STACK`.

    Notes
    -----
    I. Wald, "On fast construction of SAH-based bounding volume hierarchies", IEEE Symp. Interactive Ray Tracing 2007.
    """
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    boxes, links, order = _build(lower, upper)
    slack = 8 * np.finfo(np.float64).eps * np.abs(corners).max()
    boxes[:, :3] -= slack
    boxes[:, 3:] += slack
    return Tree(boxes, links, order)


@njit(cache=True)
def _build(lower, upper):
    m = len(lower)
    boxes = np.empty((2 * m, 6))
    links = np.empty((2 * m, 2), dtype=np.int32)
    order = np.arange(m).astype(np.int32)
    centres = 0.5 * (lower + upper)
    tasks = np.empty((4 * STACK, 4), dtype=np.int64)
    tasks[0] = (0, 0, m, 0)
    waiting, used = 1, 1
    while waiting > 0:
        waiting -= 1
        node, start, stop, depth = tasks[waiting]
        _enclose(lower, upper, order, start, stop, boxes[node])
        if stop - start <= LEAF:
            links[node, 0], links[node, 1] = start, stop - start
            continue
        middle = _split(lower, upper, centres, order, start, stop, depth)
        links[node, 0], links[node, 1] = used, 0
        tasks[waiting] = (used + 1, middle, stop, depth + 1)
        tasks[waiting + 1] = (used, start, middle, depth + 1)
        waiting += 2
        used += 2
    return boxes[:used].copy(), links[:used].copy(), order


@njit(cache=True)
def _enclose(lower, upper, order, start, stop, box):
    box[:3] = np.inf
    box[3:] = -np.inf
    for i in range(start, stop):
        k = order[i]
        for axis in range(3):
            box[axis] = min(box[axis], lower[k, axis])
            box[3 + axis] = max(box[3 + axis], upper[k, axis])


@njit(cache=True)
def _split(lower, upper, centres, order, start, stop, depth):
    """Reorder order[start:stop] and return where its second part begins."""
    axis, low, extent = 0, 0.0, -1.0
    for a in range(3):
        least, most = np.inf, -np.inf
        for i in range(start, stop):
            least = min(least, centres[order[i], a])
            most = max(most, centres[order[i], a])
        if most - least > extent:
            axis, low, extent = a, least, most - least
    half = (start + stop) // 2
    if not extent > 1e-290:
        return half
    if depth >= MEDIAN_DEPTH:
        part = order[start:stop].copy()
        order[start:stop] = part[np.argsort(centres[part, axis])]
        return half

    scale = BINS * (1 - 1e-12) / extent
    counts = np.zeros(BINS, dtype=np.int64)
    bounds = np.empty((BINS, 6))
    bounds[:, :3] = np.inf
    bounds[:, 3:] = -np.inf
    for i in range(start, stop):
        k = order[i]
        b = int((centres[k, axis] - low) * scale)
        counts[b] += 1
        for a in range(3):
            bounds[b, a] = min(bounds[b, a], lower[k, a])
            bounds[b, 3 + a] = max(bounds[b, 3 + a], upper[k, a])
    cut = _cheapest_cut(counts, bounds)

    left, right = start, stop - 1
    while left <= right:
        k = order[left]
        if int((centres[k, axis] - low) * scale) <= cut:
            left += 1
        else:
            order[left], order[right] = order[right], k
            right -= 1
    return left


@njit(cache=True)
def _cheapest_cut(counts, bounds):
    """Return the last bin of the first part: area times count, summed over both parts, is least."""
    above = np.zeros(BINS)
    box = bounds[BINS - 1].copy()
    count = 0
    for b in range(BINS - 1, 0, -1):
        _widen(box, bounds[b])
        count += counts[b]
        above[b] = _area(box) * count if count else 0.0
    box[:] = bounds[0]
    count, cut, least = 0, 0, np.inf
    for b in range(BINS - 1):
        _widen(box, bounds[b])
        count += counts[b]
        cost = (_area(box) * count if count else 0.0) + above[b + 1]
        if cost < least:
            cut, least = b, cost
    return cut


@njit(cache=True)
def _widen(box, other):
    for a in range(3):
        box[a] = min(box[a], other[a])
        box[3 + a] = max(box[3 + a], other[3 + a])


@njit(cache=True)
def _area(box):
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x
