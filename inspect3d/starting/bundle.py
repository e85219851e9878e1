"""Cameras and points adjusted together so that the points appear where they were found."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from inspect3d.register.similarity import Similarity

FIRM, STIFF = 1e-9, 1e-4  # least damping and that after a refused step, as a share of the normal matrix's diagonal
STEADY = 1e-5
LEAST = 1e-10  # share of the largest eigenvalue below which a motion of the cameras is held: those of all together
TRIES = 8
MARGIN = 20.0  # px around a picture, in which its lens must not fold it either
SETTLING = 8


@dataclass(frozen=True, eq=False)
class Planes:
    """Planes that the points should lie on.

    Parameters
    ----------
    feet, normals : (n, 3) mm; unit, zero for a point that has no plane
    sigma : mm, how far points may be off
    """

    feet: Floats
    normals: Floats
    sigma: float


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines of the pictures, nearly, on which points of the CAD should appear: the outline of the part.

    Parameters
    ----------
    points : (n, 3) mm, held
    views : (n,), the camera of each
    pixels, outward : (n, 2) px, a point of the line, and its unit normal
    sigma : px, standard uncertainty of a line's place
    """

    points: Floats
    views: Integers
    pixels: Floats
    outward: Floats
    sigma: float


@dataclass(frozen=True, eq=False)
class Bundle:
    """Cameras, and points seen by them.

    Parameters
    ----------
    views : v cameras
    points : (n, 3) mm, or in a unit of their own
    pixels : (n, v, 2) px, where the points were found; NaN where not
    """

    views: tuple[View, ...]
    points: Floats
    pixels: Floats

    @property
    def seen(self) -> Booleans:
        """Tell which view found which point, (n, v)."""
        return np.isfinite(self.pixels[:, :, 0])

    @property
    def rig(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return matrices (v, 3, 3), distortions (v, 5), rotations (v, 3, 3) and translations (v, 3) of the views."""
        return (
            np.stack([view.camera.matrix for view in self.views]),
            np.stack([view.camera.distortion for view in self.views]),
            np.stack([view.camera_from_cad.rotation for view in self.views]),
            np.stack([view.camera_from_cad.translation for view in self.views]),
        )

    @property
    def ahead(self) -> Booleans:
        """Tell which points lie before all the cameras that see them, (n,)."""
        depths = np.stack([view.depth(self.points) for view in self.views], axis=1)
        return np.asarray(((depths > 0) | ~self.seen).all(axis=1))

    @property
    def possible(self) -> bool:
        """Tell whether no lens folds its picture, as one of absurd distortion does."""
        for view in self.views:
            across, down = (np.linspace(-MARGIN, side + MARGIN, 5) for side in view.camera.size)
            try:
                view.camera.undistorted(np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2))
            except MeasurementError:
                return False
        return True

    @property
    def misses(self) -> Floats:
        """Return how far the points appear from where they were found, (n, v) px; zero where they were not."""
        found = np.zeros(self.seen.shape)
        for k, view in enumerate(self.views):
            part = np.flatnonzero(self.seen[:, k] & (view.depth(self.points) > 0))
            found[self.seen[:, k], k] = np.inf
            found[part, k] = np.linalg.norm(view.project(self.points[part]) - self.pixels[part, k], axis=1)
        return found

    @property
    def widest(self) -> Floats:
        """Return the largest angle between two lines of sight of each point, (n,) rad."""
        widest = np.zeros(len(self.points))
        sights = np.stack([view.centre - self.points for view in self.views], axis=1)
        sights /= np.linalg.norm(sights, axis=2, keepdims=True)
        for one, other in combinations(range(len(self.views)), 2):
            both = self.seen[:, one] & self.seen[:, other]
            cosine = np.clip((sights[:, one] * sights[:, other]).sum(axis=1), -1, 1)
            widest[both] = np.maximum(widest[both], np.arccos(cosine[both]))
        return widest

    def chosen(self, which: Booleans) -> Bundle:
        """Return the same cameras with some of the points."""
        return replace(self, points=self.points[which], pixels=self.pixels[which])

    def placed(self, cad_from_bundle: Similarity) -> Bundle:
        """Return cameras and points in the CAD frame, at its size."""
        back, scale = cad_from_bundle.pose.inverse(), cad_from_bundle.scale
        views = []
        for view in self.views:
            before = view.camera_from_cad
            views.append(replace(view, camera_from_cad=Pose(before.rotation, scale * before.translation) @ back))
        return replace(self, views=tuple(views), points=cad_from_bundle(self.points))

    def settled(self, noise: float) -> Bundle:
        """Return the same cameras, the points where they appear nearest to where they were found."""
        from inspect3d.starting.bundle_kernel import settle

        points = self.points.copy()
        settle(self.rig, self.pixels, self.seen, noise, SETTLING, points)
        return replace(self, points=points)


@dataclass(frozen=True, eq=False)
class Adjusted:
    """An adjusted bundle and its cost."""

    bundle: Bundle
    cost: float


def adjusted(
    bundle: Bundle,
    freedom: Freedom,
    noise: float,
    planes: Planes | None = None,
    steps: int = 20,
    firm: float = FIRM,
    lines: Lines | None = None,
) -> Adjusted:
    """Return the bundle that fits pixels, priors, planes and lines best.

    By Levenberg-Marquardt with the points eliminated. A point is weighted down the more, the farther it appears from
    where it was found, and a line from where it should be (Geman and McClure's weights).

    Parameters
    ----------
    noise : px, standard uncertainty of a pixel
    firm : least damping, as a share of the normal matrix's diagonal: what is determined less stays where it is

    Notes
    -----
    B. Triggs and others, "Bundle adjustment: a modern synthesis", Vision Algorithms: Theory and Practice, 2000.
    """
    damping = firm
    parts = _normal(bundle, freedom, noise, planes, lines, damping)
    for _ in range(steps):
        moved, then = bundle, parts
        for _ in range(TRIES):
            moved = _moved(bundle, freedom, parts, damping)
            then = _normal(moved, freedom, noise, planes, lines, max(damping / 10, firm))
            if then.cost <= parts.cost:
                break
            damping = max(10 * damping, STIFF)
        if not then.cost <= parts.cost:
            break
        gain, bundle, parts, damping = parts.cost - then.cost, moved, then, max(damping / 10, firm)
        if gain < STEADY * parts.cost:
            break
    return Adjusted(bundle, parts.cost)


@dataclass(frozen=True, eq=False)
class _Parts:
    """The normal equations of the unknowns (m, m) and (m,), what becomes of the points, and the cost."""

    normal: Floats
    right: Floats
    own: Floats
    folded: Floats
    cost: float


def _normal(
    bundle: Bundle, freedom: Freedom, noise: float, planes: Planes | None, lines: Lines | None, damping: float
) -> _Parts:
    from inspect3d.starting.bundle_kernel import CHANGES, accumulate
    from inspect3d.starting.contour_kernel import accumulate_outline

    spread, sigmas = freedom.spread(np.arange(CHANGES))
    n, size = len(bundle.points), CHANGES * len(bundle.views)
    normal, right = np.zeros((size, size)), np.zeros(size)
    own, folded = np.zeros((n, 3)), np.zeros((n, 3, size))
    nothing = np.zeros((n, 3))
    feet, normals, sigma = (planes.feet, planes.normals, planes.sigma) if planes else (nothing, nothing, 1.0)
    cost = accumulate(
        bundle.rig, freedom.origin, bundle.points, bundle.pixels, bundle.seen, noise,
        (feet, normals), sigma, damping, normal, right, own, folded,
    )  # fmt: skip
    if lines is not None:
        cost += accumulate_outline(
            bundle.rig, freedom.origin, lines.points, lines.views, lines.pixels, lines.outward, lines.sigma,
            normal, right,
        )  # fmt: skip
    offset = freedom.offset(bundle.views)
    cost += float(((offset / sigmas) ** 2).sum())
    normal = spread.T @ normal @ spread + np.diag(1 / sigmas**2)
    return _Parts(normal, spread.T @ right - offset / sigmas**2, own, folded @ spread, cost)


def _moved(bundle: Bundle, freedom: Freedom, parts: _Parts, damping: float) -> Bundle:
    size = np.sqrt(np.maximum(np.diag(parts.normal), 1e-300))
    scaled = parts.normal / np.outer(size, size) + damping * np.eye(len(size))
    step = np.linalg.lstsq(scaled, parts.right / size, rcond=LEAST)[0] / size
    shift = parts.own - parts.folded @ step
    return replace(bundle, views=freedom.moved(bundle.views, step), points=bundle.points + shift)
