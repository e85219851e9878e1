"""Triangles that hang together."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Integers


def bodies_of(triangles: Integers) -> list[Integers]:
    """Return the triangles of each body: those of (m, 3) that share vertices, directly or through others."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = int(triangles.max()) + 1
    start, end = triangles[:, [0, 1]].ravel(), triangles[:, [1, 2]].ravel()
    joined = coo_array((np.ones(len(start), dtype=np.int8), (start, end)), shape=(n, n))
    label = connected_components(joined, directed=False)[1][triangles[:, 0]]
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
