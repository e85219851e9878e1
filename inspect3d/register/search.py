"""A start from any pose: many guesses, judged quickly, the best of them improved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats, unit
from inspect3d.nominal.surface import Surface
from inspect3d.pose import Pose
from inspect3d.register.field import Field
from inspect3d.register.thinned import Thinned


@dataclass(frozen=True)
class PoseSearch:
    """Find the poses in which a cloud may lie on a surface.

    A guess puts one measured point with its normal onto a random point of the surface and turns it about the normal at
    random. Guesses are ranked by the share of the other points that come to lie near the surface with a fitting
    normal; the best descend by truncated point-to-plane steps on the `Field`, and those that arrive at the same pose
    are counted once. Distances are shares of the CAD's diagonal.

    Parameters
    ----------
    guesses : tried in all
    kept : that descend
    judges : points a guess is judged by
    near : distance within which a point counts while guesses are ranked
    reaches : truncation of the descent, from first step to last
    apart : root mean square distance of the points below which two poses are the same
    seed : of the guesses
    """

    guesses: int = 80_000
    kept: int = 400
    judges: int = 100
    near: float = 0.05
    reaches: tuple[float, float] = (0.10, 0.015)
    steps: int = 30
    apart: float = 0.03
    seed: int = 0

    def __call__(self, cloud: Thinned, surface: Surface, field: Field) -> list[Pose]:
        """Return the poses cad_from_cloud found, best first."""
        from inspect3d.register.search_kernel import costs, descend

        random = np.random.default_rng(self.seed)
        size = surface.diagonal
        grid = (field.origin, field.step, field.feet, field.normals)
        judges = random.permutation(len(cloud.points))[: self.judges]
        rotations, translations = self._guess(cloud, surface, random)
        rank = costs(
            rotations,
            translations,
            cloud.points[judges],
            cloud.normals[judges],
            cloud.oriented,
            self.near * size,
            *grid,
        )
        best = np.argsort(rank)[: self.kept]
        rotations, translations = rotations[best].copy(), translations[best].copy()
        centre = cloud.points.mean(axis=0)
        length = float(np.sqrt(((cloud.points - centre) ** 2).sum(axis=1).mean()))
        half = random.permutation(len(cloud.points))[:500]
        reaches = np.geomspace(*self.reaches, self.steps) * size
        descend(
            rotations, translations, cloud.points[half], cloud.normals[half], cloud.oriented, reaches, centre, length,
            *grid,
        )  # fmt: skip
        rank = costs(rotations, translations, cloud.points, cloud.normals, cloud.oriented, self.near / 3 * size, *grid)
        order = np.argsort(rank)
        poses = [Pose(rotations[k], translations[k]) for k in order]
        return distinct(poses, cloud.points, self.apart * size)

    def _guess(self, cloud: Thinned, surface: Surface, random: np.random.Generator) -> tuple[Floats, Floats]:
        """Return guesses as rotations (k, 3, 3) and translations (k, 3)."""
        signed = np.flatnonzero(np.linalg.norm(cloud.normals, axis=1) > 0.5)
        if len(signed) < 10:
            signed = np.arange(len(cloud.points))
        source = random.choice(signed, self.guesses)
        triangle = random.choice(len(surface.triangles), self.guesses, p=surface.areas / surface.areas.sum())
        share = random.random((self.guesses, 2))
        share = np.where(share.sum(axis=1, keepdims=True) > 1, 1 - share, share)
        a, b, c = (surface.vertices[surface.triangles[triangle, k]] for k in range(3))
        target = a + share[:, :1] * (b - a) + share[:, 1:] * (c - a)
        normal = cloud.normals[source].copy()
        missing = np.linalg.norm(normal, axis=1) < 0.5
        normal[missing] = unit(random.normal(size=(np.count_nonzero(missing), 3)))
        if not cloud.oriented:
            normal *= random.choice([-1.0, 1.0], self.guesses)[:, None]
        frames_cloud = _frames(normal, random.random(self.guesses) * 2 * np.pi)
        frames_cad = _frames(surface.face_normals[triangle], np.zeros(self.guesses))
        rotations = frames_cad @ np.swapaxes(frames_cloud, 1, 2)
        translations = target - np.einsum("kij,kj->ki", rotations, cloud.points[source])
        return np.ascontiguousarray(rotations), translations


def distinct(poses: list[Pose], points: Floats, apart: float) -> list[Pose]:
    """Return the poses, in order, that move the points by more than `apart` (rms, mm) from every earlier one."""
    centre = points.mean(axis=0)
    scatter = np.cov((points - centre).T, bias=True)
    kept: list[Pose] = []
    rotations = np.empty((0, 3, 3))
    places = np.empty((0, 3))
    for pose in poses:
        place = pose(centre[None])[0]
        turned = rotations - pose.rotation
        square = ((places - place) ** 2).sum(axis=1) + np.einsum("kij,jl,kil->k", turned, scatter, turned)
        if (square > apart**2).all():
            kept.append(pose)
            rotations = np.concatenate([rotations, pose.rotation[None]])
            places = np.concatenate([places, place[None]])
    return kept


def _frames(normals: Floats, spins: Floats) -> Floats:
    """Return right-handed frames (k, 3, 3), columns x y z, with z along the normals and x turned by the spins, rad."""
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    x = unit(np.cross(normals, helper))
    y = np.cross(normals, x)
    cosine, sine = np.cos(spins)[:, None], np.sin(spins)[:, None]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, normals], axis=2)
