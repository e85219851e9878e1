"""A tree of boxes over triangles, as flat arrays a numba kernel can walk."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import config, njit
from numpy.typing import NDArray

from inspect3d.arrays import Floats, Integers

vars(config)["THREADING_LAYER_PRIORITY"] = ["omp", "tbb", "workqueue"]  # else numba warns about the TBB Open3D loads

LANES = 8
BRANCH, LEAF = 0, 1
BINS = 16
MEDIAN_DEPTH = 40
STACK = 96


class Tree(NamedTuple):
    """Boxes around boxes around packets of up to eight triangles.

    Parameters
    ----------
    origin : (3,) mm, the middle of the triangles; everything else is counted from there, so that it keeps its digits
    boxes : (k, 6) mm, lower and upper corner of each node, a rounding error larger than what it holds
    links : (k, 2) kind and number: (BRANCH, i) has the children i and i + 1, (LEAF, i) holds packet i. Node 0 is the
        root.
    packets : (l, 15, 8) for each of eight triangles side by side, so that one instruction handles them all: corners
        a, b, c (rows 0 to 8), unit normal (9 to 11; zero where there is no area), and one over the squared length of
        the edges ab, bc, ca (12 to 14; zero where there is no length). A packet that is not full repeats its last one.
    members : (l, 8) the numbers of the triangles of each packet
    """

    origin: Floats
    boxes: Floats
    links: NDArray[np.int32]
    packets: Floats
    members: Integers


def build(corners: Floats, normals: Floats) -> Tree:
    """Return the tree over triangles with corners (m, 3, 3) mm and unit normals (m, 3).

    Nodes are split where the surface area heuristic, evaluated on 16 bins of the longest axis, is least; below depth 40
    they are split in halves, so that no walk needs more than `STACK` places.

    Notes
    -----
    I. Wald, "On fast construction of SAH-based bounding volume hierarchies", IEEE Symposium on Interactive Ray Tracing,
    2007.
    """
    origin = 0.5 * (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1)))
    corners = corners - origin
    boxes, links, order, first = _build(corners.min(axis=1), corners.max(axis=1))
    slack = 8 * np.finfo(np.float64).eps * np.abs(corners).max()
    boxes[:, :3] -= slack
    boxes[:, 3:] += slack

    squared = ((np.roll(corners, -1, axis=1) - corners) ** 2).sum(axis=2)
    inverse = np.where(squared > 1e-280, 1.0 / np.maximum(squared, 1e-280), 0.0)
    records = np.concatenate([corners.reshape(-1, 9), normals, inverse], axis=1)
    last = np.append(first[1:], len(order)) - 1
    members = order[np.minimum(first[:, None] + np.arange(LANES), last[:, None])]
    return Tree(origin, boxes, links, np.ascontiguousarray(records[members].transpose(0, 2, 1)), members)


@njit(cache=True)
def _build(lower: Floats, upper: Floats) -> tuple[Floats, NDArray[np.int32], Integers, Integers]:
    m = len(lower)
    boxes = np.empty((2 * m, 6))
    links = np.empty((2 * m, 2), dtype=np.int32)
    order = np.arange(m)
    first = np.empty(m, dtype=np.int64)
    centres = 0.5 * (lower + upper)
    tasks = np.empty((2 * STACK, 4), dtype=np.int64)
    tasks[0] = (0, 0, m, 0)
    waiting, used, leaves = 1, 1, 0
    while waiting > 0:
        waiting -= 1
        node, start, stop, depth = tasks[waiting]
        _enclose(lower, upper, order[start:stop], boxes[node])
        if stop - start <= LANES:
            links[node] = (LEAF, leaves)
            first[leaves] = start
            leaves += 1
            continue
        middle = _split(lower, upper, centres, order, start, stop, depth)
        links[node] = (BRANCH, used)
        tasks[waiting] = (used + 1, middle, stop, depth + 1)
        tasks[waiting + 1] = (used, start, middle, depth + 1)
        waiting += 2
        used += 2
    return boxes[:used].copy(), links[:used].copy(), order, first[:leaves].copy()


@njit(cache=True)
def _enclose(lower: Floats, upper: Floats, members: Integers, box: Floats) -> None:
    box[:3] = np.inf
    box[3:] = -np.inf
    for k in members:
        _widen(box, lower[k], upper[k])


@njit(cache=True)
def _split(lower: Floats, upper: Floats, centres: Floats, order: Integers, start: int, stop: int, depth: int) -> int:
    """Reorder order[start:stop] and return where its second part begins."""
    axis, low, extent = 0, 0.0, -1.0
    for candidate in range(3):
        least, most = np.inf, -np.inf
        for k in order[start:stop]:
            least = min(least, centres[k, candidate])
            most = max(most, centres[k, candidate])
        if most - least > extent:
            axis, low, extent = candidate, least, most - least
    half = (start + stop) // 2
    if extent < 1e-280:
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
    for k in order[start:stop]:
        b = int((centres[k, axis] - low) * scale)
        counts[b] += 1
        _widen(bounds[b], lower[k], upper[k])
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
def _cheapest_cut(counts: Integers, bounds: Floats) -> int:
    """Return the last bin of the first part where area times count, summed over both parts, is least."""
    above = np.zeros(BINS)
    box = bounds[BINS - 1].copy()
    count = 0
    for b in range(BINS - 1, 0, -1):
        _widen(box, bounds[b, :3], bounds[b, 3:])
        count += counts[b]
        above[b] = _area(box) * count
    box[:] = bounds[0]
    count, cut, least = 0, 0, np.inf
    for b in range(BINS - 1):
        _widen(box, bounds[b, :3], bounds[b, 3:])
        count += counts[b]
        cost = _area(box) * count + above[b + 1]
        if cost < least:
            cut, least = b, cost
    return cut


@njit(cache=True)
def _widen(box: Floats, lower: Floats, upper: Floats) -> None:
    for axis in range(3):
        box[axis] = min(box[axis], lower[axis])
        box[3 + axis] = max(box[3 + axis], upper[axis])


@njit(cache=True)
def _area(box: Floats) -> float:
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x
