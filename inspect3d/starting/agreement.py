"""How well the pictures agree on the nominal surface, cameras and part being where a start says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from inspect3d.arrays import Booleans, Floats, unit
from inspect3d.camera import View
from inspect3d.correlation.picture import Stack
from inspect3d.nominal.surface import Surface
from inspect3d.register.symmetry import surface_points

SPREAD = 3000  # places over the part that are compared, those that no two cameras see left out
STEEPEST = np.cos(np.radians(65.0))
LIFT = 1e-3  # of the diagonal
HALF = 6  # samples of a patch on either side of its middle
SPACING = 2.0  # px between them
CORRELATED = 0.6  # least correlation coefficient of patches that agree
FAR = 1e6  # px, where points appear that the distortion of the lens does not hold for
FLAT = 1.0  # grey levels, contrast below which there is nothing to compare


@dataclass(frozen=True, eq=False)
class Agreement:
    """What the pictures say at places of the part.

    Parameters
    ----------
    points : (n, 3) mm, CAD frame, places that two cameras or more ought to see
    correlation : (n,), between the pictures there, the best of two cameras; -1 where a picture is flat
    """

    points: Floats
    correlation: Floats

    @property
    def share(self) -> float:
        """Return the share of the places where the pictures agree."""
        return float((self.correlation > CORRELATED).mean()) if len(self.points) else 0.0


def agreement(surface: Surface, views: Sequence[View], stack: Stack, masks: Sequence[Booleans | None]) -> Agreement:
    """Return how small patches of the nominal surface, as they appear in the pictures, correlate.

    A patch is a square of the tangent plane, some 25 px wide. If surface or cameras are off, its pictures show
    different paint.
    """
    points, normals = surface_points(surface, SPREAD)
    seen = np.stack([_seen(surface, view, points, normals, mask) for view, mask in zip(views, masks, strict=True)])
    twice = seen.sum(axis=0) >= 2
    points, normals, seen = points[twice], normals[twice], seen[:, twice]
    best = np.full(len(points), -1.0)
    if not len(points):
        return Agreement(points, best)
    step = SPACING * np.median(np.linalg.norm(views[0].centre - points, axis=1)) / views[0].camera.matrix[0, 0]
    grey = [_patches(view, stack, k, points, normals, step, seen[k]) for k, view in enumerate(views)]
    for one, other in combinations(range(len(views)), 2):
        both = np.flatnonzero(seen[one] & seen[other])
        best[both] = np.maximum(best[both], (grey[one][both] * grey[other][both]).sum(axis=1))
    return Agreement(points, best)


def _seen(surface: Surface, view: View, points: Floats, normals: Floats, mask: Booleans | None) -> Booleans:
    sight = unit(view.centre - points)
    seen = np.asarray((np.einsum("ni,ni->n", sight, normals) > STEEPEST) & (view.depth(points) > 0))
    at = np.rint(np.nan_to_num(view.project(points[seen]), nan=FAR, posinf=FAR, neginf=-FAR)).astype(int)
    margin = int(SPACING * HALF) + 2
    width, height = view.camera.size
    inside = np.asarray(((at >= margin) & (at < np.array([width, height]) - margin)).all(axis=1))
    if mask is not None:
        inside[inside] = mask[at[inside, 1], at[inside, 0]]
    seen[np.flatnonzero(seen)] = inside
    near = np.flatnonzero(seen)
    seen[near] = ~surface.hides(points[near] + LIFT * surface.diagonal * normals[near], view.centre)
    return seen


def _patches(
    view: View, stack: Stack, number: int, points: Floats, normals: Floats, step: float, seen: Booleans
) -> Floats:
    """Return the grey levels of each patch, (n, samples), less their mean and of unit length; zero where flat."""
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    across = unit(np.cross(normals, helper))
    along = np.cross(normals, across)
    grid = step * np.stack(np.meshgrid(*[np.arange(-HALF, HALF + 1.0, 2.0)] * 2), axis=-1).reshape(-1, 2)
    places = points[seen, None] + grid[:, :1] * across[seen, None] + grid[:, 1:] * along[seen, None]
    found = np.zeros((len(points), len(grid)))
    pixels = view.project(places.reshape(-1, 3))
    width, height = view.camera.size
    pixels = np.clip(pixels, 0.0, np.array([width, height]) - 1.0)
    values = stack.sampled(number, pixels)[:, 0].reshape(-1, len(grid))
    values = values - values.mean(axis=1, keepdims=True)
    length = np.linalg.norm(values, axis=1, keepdims=True)
    found[seen] = np.where(length > FLAT * np.sqrt(len(grid)), values / np.maximum(length, 1e-12), 0.0)
    return found
