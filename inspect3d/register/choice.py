"""Which of several fitted poses the data choose, and which they cannot tell apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.register.gauge import Gauge
from inspect3d.register.icp import Fit
from inspect3d.register.smooth import Smooth
from inspect3d.register.symmetry import is_symmetry

BLOCKS = 8  # cells along the diagonal of the cloud within which errors may correlate
CERTAIN = 3.0  # standard errors by which a worse pose must be worse to be ruled out


@dataclass(frozen=True, eq=False)
class Choice:
    """What the data say about a list of fits.

    Parameters
    ----------
    fit : the one taken: of the equivalent best ones that with the smallest rotation
    equivalent : fits that are the same answer by a symmetry of the CAD, or that differ by the free motions
    rivals : inequivalent fits that explain the data as well
    others : fits the data rule out, best first
    by_symmetry : some of the equivalent fits differ by a symmetry of the whole CAD
    """

    fit: Fit
    equivalent: tuple[Fit, ...]
    rivals: tuple[Fit, ...]
    others: tuple[Fit, ...]
    by_symmetry: bool


def choose(fits: list[Fit], smooth: Smooth, points: Floats, grows: bool = False) -> Choice:
    """Return what the data say about fits of the same points (n, 3) mm.

    Costs are compared point by point, in blocks of space, since neighbouring errors correlate: a fit is ruled out when
    its cost is higher by three standard errors. Of those left, two are the same answer if the motion between them
    brings the CAD onto itself, or if both leave motions free and lie on the same smooth faces. Where the cloud `grows`,
    its growth is one of the motions.
    """
    surface = smooth.surface
    width = max(3 * min(fit.scale for fit in fits), 2e-3 * surface.diagonal)
    costs = [fit.cost(width) for fit in fits]
    order = np.argsort([cost.mean() for cost in costs])
    best = fits[order[0]]
    block = _blocks(points)
    equivalent, rivals, others, by_symmetry = [best], [], [], False
    for k in order[1:]:
        fit = fits[k]
        if _worse_by(costs[k] - costs[order[0]], block) > CERTAIN:
            others.append(fit)
            continue
        motion = fit.pose @ best.pose.inverse()
        if is_symmetry(surface, motion):
            equivalent.append(fit)
            by_symmetry = True
        elif _same_up_to_free_motions(best, fit, smooth, grows):
            equivalent.append(fit)
        else:
            rivals.append(fit)
    equivalent.sort(key=lambda fit: round(fit.pose.angle, 3))
    return Choice(equivalent[0], tuple(equivalent), tuple(rivals), tuple(others), by_symmetry)


def freedom(fit: Fit, smooth: Smooth, grows: bool = False) -> int:
    """Return how many motions a fit leaves free, growth among them if the cloud `grows`; all where no point is near."""
    width = (3 * fit.scale + 1e-3 * smooth.surface.diagonal) * fit.pose.scale
    part = fit.agrees & ~fit.feet.on_rim & (np.abs(fit.feet.distance) < width)
    if np.count_nonzero(part) < 6:
        return 6 + grows
    feet = fit.feet.points[part]
    normals = smooth.normals(feet, fit.feet.triangle[part])
    gauge = Gauge(feet, normals, np.ones(len(feet)), growth=grows)
    return len(gauge.free) + gauge.growth_is_free


def _same_up_to_free_motions(one: Fit, other: Fit, smooth: Smooth, grows: bool) -> bool:
    count = freedom(one, smooth, grows)
    if count == 0 or freedom(other, smooth, grows) != count:
        return False
    patches = smooth.patches
    return bool(np.mean(patches[one.feet.triangle] == patches[other.feet.triangle]) > 0.9)


def _blocks(points: Floats) -> Integers:
    low, high = points.min(axis=0), points.max(axis=0)
    cells = np.floor((points - low) / (np.linalg.norm(high - low) / BLOCKS)).astype(np.int64)
    return np.unique(cells, axis=0, return_inverse=True)[1].ravel()


def _worse_by(extra: Floats, block: Integers) -> float:
    """Return by how many standard errors the mean of `extra` (n,) lies above zero, blocks being independent."""
    sums = np.bincount(block, extra)
    error = np.sqrt(np.sum((sums - sums.mean()) ** 2) * len(sums) / max(len(sums) - 1, 1))
    return float(sums.sum() / error) if error > 0 else float(np.sign(sums.sum()) * np.inf if sums.sum() else 0.0)
