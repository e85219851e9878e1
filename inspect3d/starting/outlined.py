"""A place of the part made to fit its outline, where the points in common leave it free to slide or to shrink."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.camera import View
from inspect3d.nominal.surface import Surface
from inspect3d.register.mobility import jacobian
from inspect3d.register.similarity import Similarity
from inspect3d.starting.bundle import Bundle, Lines
from inspect3d.starting.contour import Contours
from inspect3d.starting.features import Features
from inspect3d.starting.fitting import Fitted
from inspect3d.starting.texture import Texture, stacked

WEAK = 0.03  # of the firmest motion's stiffness, below which a motion is weak
ROUNDS, SHAKES = (0.02, 0.01, 0.005, 0.0025), 16  # shares of the diagonal, and tries in each
SHRUNK = -0.5  # growth of the part below which a shake is no small motion
SAMPLE = 200  # features of a picture that are asked whether they lie before the part
ON = 4e-3  # share of the diagonal within which a point lies on the CAD
LEAST_REACH, WIDEST = 5.0, 40.0  # cells of the texture within which an outline is looked for, at least and at most
SURE = 4.0  # times the reach by which the uncertainty of an outline's place is smaller
VISIBLE = 0.5  # least share of an outline that must be found
HITS = 1.5  # cells within which an outline is where it should be


@dataclass(frozen=True, eq=False)
class Outline:
    """What the pictures say about the outline of the part.

    Parameters
    ----------
    texture : where they have features, finely
    pixels : of each picture some of its features, (m, 2) px
    over : (n, 3) mm, points spread over the part
    """

    texture: Texture
    pixels: tuple[Floats, ...]
    over: Floats
    contours: Contours

    @classmethod
    def of(
        cls, found: Sequence[Features], sizes: Sequence[tuple[int, int]], over: Floats, contours: Contours
    ) -> Outline:
        """Return the outlines that the features of pictures of given sizes (px) tell."""
        random = np.random.default_rng(0)
        return cls(
            Texture.closed(found, sizes),
            tuple(random.permutation(each.pixels)[:SAMPLE] for each in found),
            over,
            contours,
        )

    def lines(self, views: Sequence[View], share: float) -> Lines | None:
        """Return where the outline of the part is in the pictures, near where cameras show it; None where it is not.

        Parameters
        ----------
        share : of the CAD's diagonal, how far it may be off
        """
        points, number, pixels, outward = [], [], [], []
        asked, widest = 0, 0.0
        for k, view in enumerate(views):
            width = self.texture.widths[k]
            contour = self.contours(view, width)
            cells = np.clip(share * _pixels_of(view, self.contours.surface) / width, LEAST_REACH, WIDEST)
            at = view.project(contour.points)
            away = self.texture.ends(k, at, contour.outward, int(cells))
            found = np.isfinite(away)
            asked += len(found)
            widest = max(widest, cells * width)
            points.append(contour.points[found])
            number.append(np.full(np.count_nonzero(found), k))
            pixels.append((at + away[:, None] * contour.outward)[found])
            outward.append(contour.outward[found])
        if sum(map(len, points)) < VISIBLE * max(asked, 1):
            return None
        return Lines(
            np.concatenate(points),
            np.concatenate(number),
            np.concatenate(pixels),
            np.concatenate(outward),
            widest / SURE,
        )

    def met(self, views: Sequence[View]) -> float:
        """Return the share of the part's outline that the pictures show where it should be."""
        hits, asked = 0, 0
        for k, view in enumerate(views):
            contour = self.contours(view, self.texture.widths[k])
            away = self.texture.ends(k, view.project(contour.points), contour.outward, int(2 * LEAST_REACH))
            hits += int(np.count_nonzero(np.abs(away) <= HITS * self.texture.widths[k]))
            asked += len(away)
        return hits / max(asked, 1)

    def unlike(self, views: Sequence[View], surface: Surface) -> float:
        """Return the share of the part that would appear beside the texture, and of the features beside the part."""
        bare = float(self.texture.bareness(views, stacked([Similarity.identity()]), self.over)[0])
        beside = []
        for view, pixels in zip(views, self.pixels, strict=True):
            rays = np.column_stack([view.camera.undistorted(pixels), np.ones(len(pixels))])
            sights = view.camera_from_cad.inverse().turned(rays)
            beside.append(float((surface.first_hit(view.centre, sights).triangle < 0).mean()))
        return bare + float(np.mean(beside))

    def fitted(self, fit: Fitted, surface: Surface, scaled: bool) -> tuple[Bundle, float]:
        """Return cameras and points moved along the weak motions to where the outline fits best, and its `unlike`."""
        best = self.unlike(fit.bundle.views, surface)
        weak, centre = weak_motions(fit, scaled)
        now, cost = fit.bundle, best + _off(fit.bundle.points, surface)
        random = np.random.default_rng(0)
        for share in ROUNDS if weak.size else ():
            for _ in range(SHAKES):
                motion = weak @ random.normal(0.0, share * surface.diagonal, weak.shape[1])
                if motion[-1] < SHRUNK:
                    continue
                moved = now.placed(Similarity.small(motion, centre))
                unlike = self.unlike(moved.views, surface)
                then = unlike + _off(moved.points, surface)
                if then < cost:
                    now, cost, best = moved, then, unlike
        return now, best


def weak_motions(fit: Fitted, scaled: bool) -> tuple[Floats, Floats]:
    """Return the motions (rx, ry, rz, tx, ty, tz, growth), (7, k), that hardly move points off the CAD; and their
    centre.

    They are scaled so that each moves the points by one mm or so.
    """
    on = np.isfinite(fit.distance)
    feet, normals = fit.feet.points[on], fit.feet.normals[on]
    if len(feet) < 7:
        return np.zeros((7, 0)), np.zeros(3)
    centre = feet.mean(axis=0)
    length = float(np.sqrt(((feet - centre) ** 2).sum(axis=1).mean()))
    growth = np.einsum("ni,ni->n", feet - centre, normals) * (not scaled)
    rows = np.column_stack([jacobian(feet, normals, centre), growth])
    unit = 1 / np.array([length, length, length, 1.0, 1.0, 1.0, length])
    values, vectors = np.linalg.eigh((rows * unit).T @ (rows * unit))
    chosen: Integers = np.flatnonzero(values < WEAK * values[-1])
    if scaled:
        chosen = chosen[np.abs(vectors[6, chosen]) < 0.5]
    return unit[:, None] * vectors[:, chosen], centre


def _pixels_of(view: View, surface: Surface) -> float:
    """Return how many pixels the diagonal of a part takes where it stands."""
    depth = float(view.depth(surface.bounds.mean(axis=0)[None])[0])
    return surface.diagonal * float(view.camera.matrix[0, 0]) / max(depth, 1e-9)


def _off(points: Floats, surface: Surface) -> float:
    """Return the share of points (n, 3) mm off the CAD, those near it counting in part."""
    feet = surface.closest(points)
    near = np.minimum((feet.distance / (ON * surface.diagonal)) ** 2, 1)
    return float(np.where(feet.on_rim, 1.0, near).mean())
