"""A start from any pose: many guesses, judged quickly, the best of them improved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats, unit
from inspect3d.nominal.surface import Surface
from inspect3d.pose import Pose
from inspect3d.register.field import Field
from inspect3d.register.similarity import Similarity
from inspect3d.register.thinned import Thinned

Judge = Callable[[Floats, Floats, Floats], Floats]
"""What else is known of poses, given as rotations (k, 3, 3), translations (k, 3) and scales (k,): a cost of each, (k,)
"""

LIKELY = 20  # guesses that are also judged by what else is known, for each one kept
AT_ONCE = 80_000  # guesses, so that they fit into memory
MARGIN = 1.2  # by which a scale may leave its bounds in the descent


@dataclass(frozen=True)
class PoseSearch:
    """Find the poses in which a cloud may lie on a surface.

    A guess puts one measured point with its normal onto a random point of the surface and turns it about the normal at
    random. Guesses are ranked by the share of the other points that come to lie near the surface with a fitting
    normal; the best descend by truncated point-to-plane steps on the `Field`, and those that arrive at the same pose
    are counted once. Distances are shares of the CAD's diagonal, at the size of the cloud.

    Where the scale is unknown, each guess draws one as well, and the descent improves it.

    Parameters
    ----------
    guesses : tried in all
    scales : least and largest scale that is tried; None: the scale is known
    kept : that descend
    judges : points a guess is judged by
    near : distance within which a point counts while guesses are ranked
    reaches : truncation of the descent, from first step to last
    apart : root mean square distance of the points below which two poses are the same
    seed : of the guesses
    """

    guesses: int = 80_000
    scales: tuple[float, float] | None = None
    kept: int = 400
    judges: int = 100
    near: float = 0.05
    reaches: tuple[float, float] = (0.10, 0.015)
    steps: int = 30
    apart: float = 0.03
    seed: int = 0

    def __call__(self, cloud: Thinned, surface: Surface, field: Field, judge: Judge | None = None) -> list[Similarity]:
        """Return the poses cad_from_cloud found, best first.

        Parameters
        ----------
        judge : what else is known; its costs are added to the share of points off the surface
        """
        from inspect3d.register.search_kernel import costs, descend

        random = np.random.default_rng(self.seed)
        size = surface.diagonal
        grid = (field.origin, field.step, field.feet, field.normals)
        judges = random.permutation(len(cloud.points))[: self.judges]
        parts = []
        for _ in range(0, self.guesses, AT_ONCE):
            rotations, translations, sizes = self._guess(cloud, surface, min(self.guesses, AT_ONCE), random)
            rank = costs(
                rotations, translations, sizes, cloud.points[judges], cloud.normals[judges], cloud.oriented,
                self.near * size, *grid,
            )  # fmt: skip
            if judge is not None:
                likely = np.argsort(rank)[: LIKELY * self.kept]
                rotations, translations, sizes = rotations[likely], translations[likely], sizes[likely]
                rank = rank[likely] + judge(rotations, translations, sizes)
            best = np.argsort(rank)[: self.kept]
            parts.append((rank[best], rotations[best], translations[best], sizes[best]))
        rank, rotations, translations, sizes = (np.concatenate(values) for values in zip(*parts, strict=True))
        best = np.argsort(rank)[: self.kept]
        rotations, translations, sizes = rotations[best].copy(), translations[best].copy(), sizes[best].copy()
        centre = cloud.points.mean(axis=0)
        length = float(np.sqrt(((cloud.points - centre) ** 2).sum(axis=1).mean()))
        half = random.permutation(len(cloud.points))[:500]
        reaches = np.geomspace(*self.reaches, self.steps) * size
        descend(
            rotations, translations, sizes, self.scales is not None, cloud.points[half], cloud.normals[half],
            cloud.oriented, reaches, centre, length, *grid,
        )  # fmt: skip
        kept = self._within(sizes)
        rotations, translations, sizes = rotations[kept], translations[kept], sizes[kept]
        rank = costs(
            rotations, translations, sizes, cloud.points, cloud.normals, cloud.oriented, self.near / 3 * size, *grid
        )
        if judge is not None:
            rank = rank + judge(rotations, translations, sizes)
        order = np.argsort(rank)
        poses = [Similarity(Pose(rotations[k], translations[k]), float(sizes[k])) for k in order]
        return distinct(poses, cloud.points, self.apart * size)

    def _within(self, sizes: Floats) -> Booleans:
        """Tell which scales lie within the bounds, (k,), or all where none does."""
        if self.scales is None:
            return np.ones(len(sizes), bool)
        within = (sizes > self.scales[0] / MARGIN) & (sizes < self.scales[1] * MARGIN)
        return within if within.any() else ~within

    def _guess(
        self, cloud: Thinned, surface: Surface, count: int, random: np.random.Generator
    ) -> tuple[Floats, Floats, Floats]:
        """Return guesses as rotations (k, 3, 3), translations (k, 3) and scales (k,)."""
        signed = np.flatnonzero(np.linalg.norm(cloud.normals, axis=1) > 0.5)
        if len(signed) < 10:
            signed = np.arange(len(cloud.points))
        source = random.choice(signed, count)
        triangle = random.choice(len(surface.triangles), count, p=surface.areas / surface.areas.sum())
        share = random.random((count, 2))
        share = np.where(share.sum(axis=1, keepdims=True) > 1, 1 - share, share)
        a, b, c = (surface.vertices[surface.triangles[triangle, k]] for k in range(3))
        target = a + share[:, :1] * (b - a) + share[:, 1:] * (c - a)
        normal = cloud.normals[source].copy()
        missing = np.linalg.norm(normal, axis=1) < 0.5
        normal[missing] = unit(random.normal(size=(np.count_nonzero(missing), 3)))
        if not cloud.oriented:
            normal *= random.choice([-1.0, 1.0], count)[:, None]
        frames_cloud = _frames(normal, random.random(count) * 2 * np.pi)
        frames_cad = _frames(surface.face_normals[triangle], np.zeros(count))
        rotations = frames_cad @ np.swapaxes(frames_cloud, 1, 2)
        sizes = np.ones(count)
        if self.scales is not None:
            low, high = self.scales
            sizes = low * (high / low) ** random.random(count)
        translations = target - sizes[:, None] * np.einsum("kij,kj->ki", rotations, cloud.points[source])
        return np.ascontiguousarray(rotations), translations, sizes


def distinct(poses: list[Similarity], points: Floats, apart: float) -> list[Similarity]:
    """Return the poses, in order, that move the points by more than `apart` (rms, mm) from every earlier one."""
    centre = points.mean(axis=0)
    scatter = np.cov((points - centre).T, bias=True)
    kept: list[Similarity] = []
    linears = np.empty((0, 3, 3))
    places = np.empty((0, 3))
    for pose in poses:
        place = pose(centre[None])[0]
        linear = pose.matrix[:3, :3]
        turned = linears - linear
        square = ((places - place) ** 2).sum(axis=1) + np.einsum("kij,jl,kil->k", turned, scatter, turned)
        if (square > apart**2).all():
            kept.append(pose)
            linears = np.concatenate([linears, linear[None]])
            places = np.concatenate([places, place[None]])
    return kept


def _frames(normals: Floats, spins: Floats) -> Floats:
    """Return right-handed frames (k, 3, 3), columns x y z, with z along the normals and x turned by the spins, rad."""
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    x = unit(np.cross(normals, helper))
    y = np.cross(normals, x)
    cosine, sine = np.cos(spins)[:, None], np.sin(spins)[:, None]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, normals], axis=2)
