"""Where the part may be: poses, with a scale, of the points that the pictures gave on the CAD."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.nominal.surface import Surface
from inspect3d.pose import Pose
from inspect3d.register.field import Field
from inspect3d.register.search import PoseSearch
from inspect3d.register.symmetry import surface_points
from inspect3d.register.thinned import Thinned
from inspect3d.starting.bundle import Bundle
from inspect3d.starting.sight import Textured, bareness
from inspect3d.starting.similar import Similar

SMALLEST, LARGEST = 0.3, 1.05  # extent of the cloud, as a share of the CAD's diagonal
STRIDE = 1.08  # from one scale that is tried to the next
PER_SCALE = 30  # poses that are kept at each scale
REFINED = 60  # of all, that are refined with the scale
NEAR = 0.02  # share of the cloud's extent within which a point lies on the CAD
SPREAD = 400  # points over the CAD by which the outline is judged
APART = 0.03  # share of the cloud's extent below which two poses are the same


@dataclass(frozen=True, eq=False)
class Placed:
    """A place of the cloud on the CAD and its cost: of the cloud off the CAD, and the CAD off the texture."""

    similar: Similar
    cost: float


@dataclass(frozen=True, eq=False)
class Candidates:
    """Find the places of a cloud on a CAD.

    For each of a range of scales, or the one that is known, `PoseSearch` proposes poses; the best are refined together
    with the scale, and those that put the CAD where the pictures show nothing are put back.

    Parameters
    ----------
    surface : nominal
    field : of it
    kept : how many are returned at most
    """

    surface: Surface
    field: Field
    kept: int = 10

    def __call__(
        self, cloud: Thinned, bundle: Bundle, textured: Sequence[Textured], scaled: bool
    ) -> list[Similar]:
        """Return places of the cloud, best first.

        Parameters
        ----------
        cloud : points of the bundle, with normals towards the cameras
        bundle : the cameras
        textured : of each view
        scaled : whether the scale is known already
        """
        extent = _extent(cloud.points)
        over, _ = surface_points(self.surface, SPREAD)
        size = self.surface.diagonal
        largest, smallest = np.log(LARGEST * size / extent), np.log(SMALLEST * size / extent)
        count = int(np.ceil((largest - smallest) / np.log(STRIDE))) + 1
        scales = np.ones(1) if scaled else np.exp(np.linspace(largest, smallest, count))
        search = PoseSearch(guesses=20_000, kept=PER_SCALE * 3, judges=60, apart=APART)
        first: list[Placed] = []
        for scale in scales:
            poses = search(cloud.scaled(float(scale)), self.surface, self.field)[:PER_SCALE]
            first += [self._judged(Similar(pose, float(scale)), cloud, bundle, textured, over) for pose in poses]
        first.sort(key=lambda placed: placed.cost)
        few = cloud.every(3)
        better = [self._improved(placed.similar, few, scaled) for placed in first[:REFINED]]
        last = [self._judged(similar, cloud, bundle, textured, over) for similar in better]
        last.sort(key=lambda placed: placed.cost)
        return _distinct(last, cloud.points, APART * extent)[: self.kept]

    def _judged(
        self, similar: Similar, cloud: Thinned, bundle: Bundle, textured: Sequence[Textured], over: Floats
    ) -> Placed:
        feet = self.surface.closest(similar(cloud.points))
        width = NEAR * similar.scale * _extent(cloud.points)
        cosine = np.einsum("ni,ni->n", similar.pose.turned(cloud.normals), feet.normals)
        fits = ~feet.on_rim & ((cosine > 0.3) | ~cloud.normals.any(axis=1))
        cost = np.where(fits, np.minimum(np.abs(feet.distance) / width, 1), 1).mean()
        return Placed(similar, float(cost) + bareness(similar.placed(bundle).views, textured, over))

    def _improved(self, start: Similar, cloud: Thinned, scaled: bool, steps: int = 25) -> Similar:
        """Return the place after truncated point-to-plane steps with the scale free."""
        points, normals = cloud.points, cloud.normals
        pose, scale = start.pose, start.scale
        extent = _extent(points)
        for reach in np.geomspace(0.05, 0.01, steps):
            there = pose(scale * points)
            feet = self.surface.closest(there)
            cosine = np.einsum("ni,ni->n", pose.turned(normals), feet.normals)
            share = feet.distance / (reach * scale * extent)
            weight = np.where(~feet.on_rim & (cosine > 0.3) & (np.abs(share) < 1), (1 - share**2) ** 2, 0.0)
            if weight.sum() < 12:
                break
            centre = np.average(there, axis=0, weights=weight)
            arm = (there - centre) / (scale * extent)
            columns = [np.cross(arm, feet.normals), feet.normals]
            if not scaled:
                columns.append((arm * feet.normals).sum(axis=1)[:, None])
            rows = np.concatenate(columns, axis=1)
            matrix = (rows * weight[:, None]).T @ rows
            matrix[np.diag_indices(len(matrix))] += 1e-4 * weight.sum()
            motion = -np.linalg.solve(matrix, (rows * weight[:, None]).T @ feet.distance)
            turn = motion[:3] / (scale * extent)
            growth = 1.0 if scaled else float(np.exp(np.clip(motion[6] / (scale * extent), -0.1, 0.1)))
            small = Pose.small(np.concatenate([turn, motion[3:6]]), centre)
            middle = pose(scale * points.mean(axis=0)[None])[0]
            grown = centre + growth * (middle - centre)  # growing about the centre of the points that lie on the CAD
            scale *= growth
            shifted = Pose(pose.rotation, grown - pose.rotation @ (scale * points.mean(axis=0)))
            pose = small @ shifted
        return Similar(pose, scale)


def _extent(points: Floats) -> float:
    """Return the distance of the far ends of a cloud, stray points left out, in its unit."""
    axes = np.linalg.svd(points - np.median(points, axis=0), full_matrices=False)[2]
    low, high = np.percentile(points @ axes.T, [1, 99], axis=0)
    return float(np.linalg.norm(high - low))


def _distinct(placed: list[Placed], points: Floats, apart: float) -> list[Similar]:
    """Return the places, in order, that move the points by more than `apart` (rms) from every earlier one."""
    kept: list[Similar] = []
    for each in placed:
        here = each.similar(points)
        limit = apart * each.similar.scale
        if all(np.sqrt(((here - other(points)) ** 2).sum(axis=1).mean()) > limit for other in kept):
            kept.append(each.similar)
    return kept
