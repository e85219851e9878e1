"""Where facets meet at an angle, and the nearest point of such lines."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers, unit


class Sides(NamedTuple):
    """The sides of triangles, each once.

    Parameters
    ----------
    ends : (k, 2) vertices
    uses : (k,) how many triangles have the side
    angle : (k,) rad between the facets of a side that two triangles share, 0 elsewhere
    """

    ends: Integers
    uses: Integers
    angle: Floats

    def sharp(self, angle: float) -> Integers:
        """Return the ends (l, 2) of sides whose facets are farther apart than `angle` rad or not exactly two."""
        return self.ends[(self.angle > angle) | (self.uses != 2)]


def sides_of(vertices: Floats, triangles: Integers) -> Sides:
    """Return the sides of triangles (m, 3) between vertices (n, 3), and the angle between the facets beside them."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = unit(np.cross(b - a, c - a))
    ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    keys, back, uses = np.unique(ends[:, 0] * len(vertices) + ends[:, 1], return_inverse=True, return_counts=True)
    order = np.argsort(back, kind="stable")
    first = np.cumsum(uses) - uses
    pair = uses == 2
    one, other = (normals[order[first[pair] + k] // 3] for k in (0, 1))
    angle = np.zeros(len(keys))
    angle[pair] = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1))
    return Sides(np.stack([keys // len(vertices), keys % len(vertices)], axis=1), uses, angle)


class OnLine(NamedTuple):
    """The nearest points of line segments.

    Parameters
    ----------
    segment : (n,) which segment
    share : (n,) how far along it, 0 to 1
    distance : (n,) mm
    """

    segment: Integers
    share: Floats
    distance: Floats


def nearest_on_segments(points: Floats, start: Floats, end: Floats, spacing: float) -> OnLine:
    """Return the nearest points of segments from `start` to `end`, both (k, 3) mm, to points (n, 3) mm.

    Segments are found by samples about `spacing` mm apart: the one found may be farther than the nearest by a share of
    that.
    """
    from scipy.spatial import cKDTree

    if not len(start):
        return OnLine(np.full(len(points), -1), np.zeros(len(points)), np.full(len(points), np.inf))
    count = np.maximum(1, np.ceil(np.linalg.norm(end - start, axis=1) / spacing).astype(int))
    of = np.repeat(np.arange(len(start)), count)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[of]
    samples = start[of] + share[:, None] * (end - start)[of]
    k = min(8, len(samples))
    candidates = of[cKDTree(samples).query(points, k)[1].reshape(len(points), k)]
    a, along = start[candidates], (end - start)[candidates]
    length2 = (along**2).sum(axis=2)
    s = np.clip(((points[:, None] - a) * along).sum(axis=2) / np.where(length2 > 0, length2, 1.0), 0.0, 1.0)
    distance = np.linalg.norm(a + s[:, :, None] * along - points[:, None], axis=2)
    best = distance.argmin(axis=1)
    rows = np.arange(len(points))
    return OnLine(candidates[rows, best], s[rows, best], distance[rows, best])


def corners_of_lines(vertices: Floats, segments: Integers, turn: float) -> Booleans:
    """Tell at which vertices (n,) lines end, branch, or turn by more than `turn` rad.

    Parameters
    ----------
    vertices : (n, 3) mm
    segments : (k, 2) the pieces of the lines
    """
    ends = segments.ravel()
    count = np.bincount(ends, minlength=len(vertices))
    away = unit(vertices[segments[:, ::-1].ravel()] - vertices[ends])
    total = np.stack([np.bincount(ends, away[:, k], minlength=len(vertices)) for k in range(3)], axis=1)
    # Two unit vectors at the angle pi - turn add up to a vector of length 2 sin(turn / 2).
    turned = (count == 2) & (np.linalg.norm(total, axis=1) > 2 * np.sin(turn / 2))
    return ((count > 0) & (count != 2)) | turned


def nearest_nodes(nodes: Floats, targets: Floats, reach: float) -> tuple[Integers, Integers]:
    """Return which nodes are the nearest to a target within `reach` mm, each once, and the index of that target.

    Parameters
    ----------
    nodes : (n, 3) mm
    targets : (k, 3) mm
    """
    from scipy.spatial import cKDTree

    if not len(targets) or not len(nodes):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    distance, node = cKDTree(nodes).query(targets, distance_upper_bound=reach)
    order = np.argsort(distance, kind="stable")[: np.count_nonzero(np.isfinite(distance))]
    taken, first = np.unique(node[order], return_index=True)
    return taken, order[first]
