"""A few thousand points that stand for a cloud: evenly spread, with normals, stray points left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from inspect3d.arrays import Floats, unit
from inspect3d.measure import Cloud

NEIGHBOURS = 16
DENSE_ENOUGH = 0.1  # a cell holding less than this share of the usual number of points is stray


@dataclass(frozen=True, eq=False)
class Thinned:
    """Evenly spread points of a cloud.

    Parameters
    ----------
    points : (n, 3) mm
    normals : (n, 3), unit; zero where the points around do not lie on a surface
    oriented : the normals point out of the material, as the instrument said
    noise : mm, usual scatter of a point about the plane through its neighbours
    """

    points: Floats
    normals: Floats
    oriented: bool
    noise: float = 0.0

    def every(self, stride: int) -> Thinned:
        """Return every so many-th point."""
        return Thinned(self.points[::stride], self.normals[::stride], self.oriented, self.noise)

    def scaled(self, factor: float) -> Thinned:
        """Return the points a factor farther from the origin."""
        return Thinned(self.points * factor, self.normals, self.oriented, self.noise * factor)


def thinned(cloud: Cloud, count: int, even: bool = True, seed: int = 0) -> Thinned:
    """Return about `count` points of the cloud, with normals.

    Even: space is divided into cells, and the point nearest to the mean of each well-filled cell is taken. Otherwise
    they are drawn at random, as dense as the cloud. Normals are the direction of least scatter of the 16 nearest
    points, signed by the cloud's own normals where it has them.
    """
    points = cloud.points
    random = np.random.default_rng(seed)
    keep = _one_per_cell(points, count) if even else random.permutation(len(points))[:count]
    chosen = points[keep]
    crowd = points if len(points) <= 200_000 else points[random.choice(len(points), 200_000, replace=False)]
    crowd_normals = None
    if cloud.normals is not None and len(points) <= 200_000:
        crowd_normals = cloud.normals
    _, near = cKDTree(crowd).query(chosen, min(NEIGHBOURS, len(crowd)))
    around = crowd[near]
    spread = around - around.mean(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", spread, spread))
    noise = float(np.sqrt(np.median(values[:, 0]) / max(around.shape[1] - 3, 1)))
    normals = vectors[:, :, 0].copy()
    normals[values[:, 0] > 0.2 * values[:, 1]] = 0.0
    if cloud.normals is None:
        return Thinned(chosen, normals, oriented=False, noise=noise)
    told = unit(crowd_normals[near].mean(axis=1)) if crowd_normals is not None else cloud.normals[keep]
    side = np.einsum("ni,ni->n", told, normals)
    normals *= np.where(np.abs(side) > 0.2, np.sign(side), 0.0)[:, None]
    return Thinned(chosen, normals, oriented=bool(np.mean(np.abs(side) > 0.2) > 0.5), noise=noise)


def _one_per_cell(points: Floats, count: int) -> np.ndarray:
    """Return the indices of one point per well-filled cell, the cells so large that about `count` are filled."""
    low, high = np.percentile(points, [0.5, 99.5], axis=0)
    sample = points[np.linspace(0, len(points) - 1, min(len(points), 100_000)).astype(int)]
    inside = sample[((sample >= low) & (sample <= high)).all(axis=1)]
    step = float(np.linalg.norm(high - low)) / 10
    if not step > 0:
        return np.arange(min(count, len(points)))
    for _ in range(12):
        filled = len(np.unique(np.floor((inside - low) / step).astype(np.int64), axis=0))
        if abs(filled / count - 1) < 0.1 or filled == len(inside):
            break
        step *= (filled / count) ** 0.5
    cells = np.floor((points - low) / step).astype(np.int64)
    _, cell, number = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    cell = cell.ravel()
    middle = np.stack([np.bincount(cell, points[:, k]) for k in range(3)], axis=1) / number[:, None]
    apart = np.linalg.norm(points - middle[cell], axis=1)
    order = np.lexsort((apart, cell))
    first = order[np.searchsorted(cell[order], np.arange(len(number)))]
    usual = np.median(number[cell])
    return first[number >= DENSE_ENOUGH * usual]
