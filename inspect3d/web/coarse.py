"""A mesh of fewer triangles between the same nodes, to draw while the part turns."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats, Integers

ENOUGH = 200_000
"""Triangles that are drawn fluidly even without a graphics card; a mesh of fewer needs no coarse one."""
WANTED = 40_000
"""Triangles, about, of a coarse mesh."""


def coarse_triangles(nodes: Floats, triangles: Integers, normals: Floats) -> Integers:
    """Return triangles (k, 3) between some of the nodes, near the surface of triangles (m, 3); none if those are few.

    Nodes in one cell of a grid, whose normals point into one octant, become one of them, the nearest to their mean:
    both sides of a thin wall stay apart, and the values shown are those of real nodes.

    Parameters
    ----------
    nodes : (n, 3) mm
    triangles : (m, 3)
    normals : (n, 3)

    Notes
    -----
    J. Rossignac, P. Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993.
    """
    if len(triangles) <= ENOUGH:
        return triangles[:0]
    a, b, c = (nodes[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    size = np.sqrt(2.0 * area / WANTED)
    cells = np.floor((nodes - nodes.min(axis=0)) / size).astype(np.int64)
    shape = cells.max(axis=0) + 1
    octant = (normals > 0) @ np.array([1, 2, 4])
    _, cluster = np.unique(np.ravel_multi_index((*cells.T, octant), (*shape, 8)), return_inverse=True)
    count = np.bincount(cluster)
    mean = np.stack([np.bincount(cluster, nodes[:, k]) for k in range(3)], axis=1) / count[:, None]
    order = np.lexsort([((nodes - mean[cluster]) ** 2).sum(axis=1), cluster])
    representative = order[np.r_[0, np.cumsum(count)[:-1]]]
    moved = cluster[triangles]
    proper = (moved != np.roll(moved, 1, axis=1)).all(axis=1)
    kept = np.unique(moved[proper], axis=0)
    return representative[kept]
