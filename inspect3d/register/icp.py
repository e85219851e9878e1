"""Robust point-to-plane ICP on the CAD surface itself, with Open3D's estimator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.nominal.surface import Feet, Surface
from inspect3d.pose import Pose
from inspect3d.register.mobility import jacobian
from inspect3d.register.similarity import Similarity
from inspect3d.register.thinned import Thinned
from inspect3d.system import import_open3d

MAD = 1.4826  # standard deviation of a normal distribution over its median absolute deviation
TUKEY = 4.685  # scales at which Tukey's biweight rejects: 95 % efficient for normal noise
OPPOSED = 0.2
HELD = 1e-4  # stiffness per point that keeps a free motion at rest
STRIDE = 0.2  # largest relative growth in a step
LEANING = 1.5  # robust scales that the median distance must have to be called an offset


@dataclass(frozen=True, eq=False)
class Fit:
    """A pose and how the points lie on the surface in it.

    Distances are at the size of the cloud, mm: divided by the scale of the pose, so that a cloud does not fit the
    better for having shrunk.

    Parameters
    ----------
    pose : cad_from_cloud
    feet : of the points on the surface
    agrees : (n,), the normal of the point fits that of the surface, or it has none
    scale : robust standard deviation of the distances about zero, mm
    """

    pose: Similarity
    feet: Feet
    agrees: Booleans
    scale: float

    @property
    def distance(self) -> Floats:
        """Return the signed distances of the points from the surface, (n,) mm, positive outside the material."""
        return self.feet.distance / self.pose.scale

    def cost(self, width: float) -> Floats:
        """Return min(d², width²) / width² of each point, (n,); 1 where the normals disagree or the foot is on a rim."""
        cost = np.minimum((self.distance / width) ** 2, 1.0)
        return np.where(self.agrees & ~self.feet.on_rim, cost, 1.0)


@dataclass(frozen=True)
class RobustIcp:
    """Iterative closest points on a surface: feet by `Surface.closest`, motion by Open3D's point-to-plane estimator
    with Tukey's kernel, whose width falls to that of the noise. Where the cloud `grows`, its scale is a seventh unknown
    of the same step, which is then ours.

    Twelve weightless pairs ("anchors") around the cloud keep a motion that nothing determines at rest: they shrink the
    step by a part in a thousand, not the answer.

    Parameters
    ----------
    steps : at the most
    still : share of the robust scale below which the largest motion of a point ends the iteration
    first_width : half width of the kernel in the first step, mm; None starts at the noise
    offset : mm, distance from the surface that the points are brought to
    grows : the scale of the cloud is unknown
    """

    steps: int = 60
    still: float = 1e-3
    first_width: float | None = None
    offset: float = 0.0
    grows: bool = False

    def __call__(self, cloud: Thinned, surface: Surface, start: Similarity) -> Fit:
        """Return the fit that the iteration from `start` (cad_from_cloud) ends in."""
        pose, width = start, self.first_width or np.inf
        for _ in range(self.steps):
            fit = fitted(cloud, surface, pose)
            valid = fit.agrees & ~fit.feet.on_rim
            distance = np.abs(fit.distance - self.offset)
            scale = MAD * float(np.median(distance[valid])) if valid.any() else fit.scale
            width = max(0.7 * width, TUKEY * scale) if np.isfinite(width) else TUKEY * scale
            part = valid & (distance < width)
            if np.count_nonzero(part) < 7:
                return fit
            points, normals = pose(cloud.points[part]), fit.feet.normals[part]
            brought = fit.feet.points[part] + pose.scale * self.offset * normals
            towards = grown_step if self.grows else step
            motion = towards(points, brought, normals, pose.scale * width)
            pose = motion @ pose
            moved = np.abs(motion(points) - points).max() / pose.scale
            if moved < self.still * scale and width <= 1.01 * TUKEY * scale:
                break
        return fitted(cloud, surface, pose)


def settled(cloud: Thinned, surface: Surface, start: Similarity, grows: bool = False) -> Fit:
    """Return the fit of robust ICP from a start near the end, uniform offsets considered.

    A part that is too large all over, as a ring of too large a diameter, leans over to lie closer to the CAD. If the
    distances stand out from zero in the first fit, the points are brought to their median instead, and so twice again.
    A cloud that grows has no such offset: its size gives way.
    """
    fit = RobustIcp(still=0.01, grows=grows)(cloud, surface, start)
    for _ in range(0 if grows else 3):
        middle, scatter = median_and_scale(fit.distance[fit.agrees & ~fit.feet.on_rim])
        if abs(middle) < LEANING * scatter:
            break
        fit = RobustIcp(still=0.01, offset=middle)(cloud, surface, fit.pose)
    return fit


def fitted(cloud: Thinned, surface: Surface, pose: Similarity) -> Fit:
    """Return how the points lie on the surface in a given pose."""
    feet = surface.closest(pose(cloud.points))
    cosine = np.einsum("ni,ni->n", pose.turned(cloud.normals), feet.normals)
    told = np.linalg.norm(cloud.normals, axis=1) > 0.5
    agrees = ~told | ((cosine if cloud.oriented else np.abs(cosine)) > OPPOSED)
    part = agrees & ~feet.on_rim
    distance = np.abs(feet.distance[part]) / pose.scale if part.any() else np.array([surface.diagonal])
    return Fit(pose, feet, agrees, float(MAD * np.median(distance)))


def step(points: Floats, feet: Floats, normals: Floats, width: float) -> Similarity:
    """Return the small motion that brings points (n, 3) mm towards the tangent planes of their feet, Tukey-weighted."""
    open3d = import_open3d()
    geometry, registration = open3d.geometry, open3d.pipelines.registration
    centre = points.mean(axis=0)
    length = float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean())) or 1.0
    places, directions = _anchors(length)
    source, target = geometry.PointCloud(), geometry.PointCloud()
    vectors = open3d.utility.Vector3dVector
    source.points = vectors(np.concatenate([points - centre, places]))
    target.points = vectors(np.concatenate([feet - centre, places]))
    target.normals = vectors(np.concatenate([normals, directions]))
    pairs = np.repeat(np.arange(len(points) + len(places), dtype=np.int32)[:, None], 2, axis=1)
    estimator = registration.TransformationEstimationPointToPlane(registration.TukeyLoss(width))
    matrix = np.asarray(estimator.compute_transformation(source, target, open3d.utility.Vector2iVector(pairs)))
    turned = Pose.from_matrix(matrix)
    return Similarity(Pose(turned.rotation, turned.translation + centre - turned.rotation @ centre))


def grown_step(points: Floats, feet: Floats, normals: Floats, width: float) -> Similarity:
    """Return the small motion and growth that bring points (n, 3) mm towards the tangent planes of their feet.

    Weights are Tukey's. A slight stiffness holds what nothing determines, as the anchors of `step` do.
    """
    centre = points.mean(axis=0)
    length = float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean())) or 1.0
    gaps = np.einsum("ni,ni->n", points - feet, normals)
    weights = np.clip(1 - (gaps / width) ** 2, 0, None) ** 2
    growth = np.einsum("ni,ni->n", points - centre, normals)
    rows = np.column_stack([jacobian(points, normals, centre), growth])
    rows[:, [0, 1, 2, 6]] /= length
    matrix = (rows * weights[:, None]).T @ rows + HELD * len(points) * np.eye(7)
    motion = np.linalg.solve(matrix, -rows.T @ (weights * gaps))
    motion[[0, 1, 2, 6]] /= length
    motion[6] = np.clip(motion[6], -STRIDE, STRIDE)
    return Similarity.small(motion, centre)


def _anchors(length: float) -> tuple[Floats, Floats]:
    """Return twelve points (12, 3) at ±length on the axes and normals across: their normal matrix is diagonal."""
    axes = np.eye(3)
    pairs = [(side * length * axes[k], axes[j]) for k in range(3) for j in range(3) if j != k for side in (1.0, -1.0)]
    places, directions = zip(*pairs, strict=True)
    return np.array(places), np.array(directions)


def median_and_scale(distances: Floats) -> tuple[float, float]:
    """Return the median of distances (n,) and 1.4826 times the median absolute deviation about it, mm."""
    middle = float(np.median(distances))
    return middle, float(MAD * np.median(np.abs(distances - middle)))
