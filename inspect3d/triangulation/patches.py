"""The surface in patches: tie points made exact, and the gaps between them filled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from inspect3d.arrays import Booleans, Floats, Integers, unit
from inspect3d.camera import View
from inspect3d.correlation.picture import Pictures, Stack

NEIGHBOURS, FEW = 12, 9
AROUND = 6  # directions in which the surface is followed
CLOSE, TOO_CLOSE = 0.8, 0.7  # spacings; a new patch begins no closer to another, and is dropped if it ends closer
WILD = 4.0  # usual uncertainties, and usual gaps to the neighbours' planes, beyond which a patch is left out
OFF = 0.25  # px, gap to the planes of most neighbours that is always allowed
MAD = 1.4826
FACING = 0.5  # cosine between a first normal and the lines of sight, at the least
ALONE = 2.5  # spacings within which a patch has two neighbours at the least


@dataclass(frozen=True, eq=False)
class Patched:
    """Points of the surface.

    Parameters
    ----------
    points : (n, 3), in the frame and unit of the views
    normals : (n, 3), unit, towards the cameras
    sigma : (n,), standard uncertainty along the normal, in that unit
    views : (n,), how many photographs show the point
    """

    points: Floats
    normals: Floats
    sigma: Floats
    views: Integers

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points)

    def taken(self, which: Booleans | Integers) -> Patched:
        """Return some of the points."""
        return Patched(self.points[which], self.normals[which], self.sigma[which], self.views[which])

    def joined(self, other: Patched) -> Patched:
        """Return these points and others."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Patched(*(np.concatenate(pair) for pair in pairs))


@dataclass(frozen=True)
class FitPatches:
    """Fit patches of the surface to all photographs at once, at tie points and between them.

    Each patch is a square window on the surface whose height, slopes and curvatures make the photographs agree
    (least-squares matching under the constraint of the known cameras; see `patch_kernel`). Windows hardly overlap, so
    that the errors of neighbours are independent. From each patch the surface is followed to the sides until the
    photographs disagree.

    Parameters
    ----------
    half : px, on each side of the middle of a window
    spacing : px, between patches
    like : least correlation of a photograph with the others
    steepest : degrees, largest angle between normal and line of sight
    systematic : px, standard uncertainty of a shift of each picture that no model explains
    steps : of Gauss-Newton at the most
    rounds : of following the surface at the most

    Notes
    -----
    A. Gruen & E. P. Baltsavias, "Geometrically constrained multiphoto matching", Photogrammetric Engineering & Remote
    Sensing 54(5), 1988; the surface is followed as by Y. Furukawa & J. Ponce, "Accurate, dense, and robust multiview
    stereopsis", IEEE PAMI 32(8), 2010.
    """

    half: int = 5
    spacing: float = 10.0
    like: float = 0.7
    steepest: float = 65.0
    systematic: float = 0.01
    steps: int = 12
    rounds: int = 40

    def __call__(
        self,
        pictures: Pictures,
        views: Sequence[View],
        masks: Sequence[Booleans | None],
        seeds: Floats,
        towards: Floats,
    ) -> Patched:
        """Return the surface around seeds, in the frame of the views.

        Parameters
        ----------
        seeds, towards : (n, 3), points of the surface, and unit directions from them to the cameras that see them
        pictures : one of each view
        masks : of each view, True where its picture may be used, or None
        """
        stack = pictures.sharp
        normals = _normals(seeds, towards)
        pitch = _pitch(seeds, views)
        kept = _spread_out(seeds, self.spacing * pitch)
        surface = self._fitted(stack, views, masks, seeds[kept], normals[kept])
        surface = surface.taken(_spread_out(surface.points, TOO_CLOSE * self.spacing * _pitch(surface.points, views)))
        newest = surface
        for _ in range(self.rounds):
            begun, normals = self._beside(newest, surface, views)
            newest = self._fitted(stack, views, masks, begun, normals)
            if not len(newest):
                break
            apart = TOO_CLOSE * self.spacing * _pitch(newest.points, views)
            newest = newest.taken(cKDTree(surface.points).query(newest.points)[0] > apart)
            newest = newest.taken(_spread_out(newest.points, TOO_CLOSE * self.spacing * _pitch(newest.points, views)))
            surface = surface.joined(newest)
            if len(newest) < 1e-3 * len(surface):
                break
        return self._sound(surface, views)

    def _fitted(
        self, stack: Stack, views: Sequence[View], masks: Sequence[Booleans | None], points: Floats, normals: Floats
    ) -> Patched:
        """Return the patches that fit, of those that begin at points (n, 3) with normals (n, 3)."""
        from inspect3d.triangulation.patch_kernel import fit_patches

        points, normals = points.copy(), normals.copy()
        pitch = _pitch(points, views)
        allowed = np.stack([_shown(view, mask, points) for view, mask in zip(views, masks, strict=True)], axis=1)
        steepest = float(np.cos(np.radians(self.steepest)))
        settings = (self.half, self.spacing, self.steps, self.like, steepest, self.systematic)
        cameras = (
            np.stack([view.camera.matrix for view in views]),
            np.stack([view.camera.distortion for view in views]),
            np.stack([view.camera_from_cad.rotation for view in views]),
            np.stack([view.camera_from_cad.translation for view in views]),
        )
        found, fits = np.zeros((len(points), 3)), np.zeros(len(points), dtype=bool)
        fit_patches(points, normals, pitch, allowed, settings, (stack.levels, stack.sizes), cameras, found, fits)
        fits &= found[:, 1] > self.like
        patched = Patched(points, normals, np.sqrt(np.maximum(found[:, 0], 0.0)), found[:, 2].astype(np.int64))
        return patched.taken(fits)

    def _beside(self, newest: Patched, surface: Patched, views: Sequence[View]) -> tuple[Floats, Floats]:
        """Return where new patches may begin: beside the newest ones, on their tangent planes, where none is yet."""
        across, along = _tangents(newest.normals)
        reach = (self.spacing * _pitch(newest.points, views))[:, None]
        turns = np.arange(AROUND) * 2 * np.pi / AROUND
        begun = np.concatenate([newest.points + reach * (np.cos(t) * across + np.sin(t) * along) for t in turns])
        normals = np.tile(newest.normals, (AROUND, 1))
        apart = CLOSE * np.tile(reach[:, 0], AROUND)
        free = cKDTree(surface.points).query(begun)[0] > apart
        begun, normals, apart = begun[free], normals[free], apart[free]
        kept = _spread_out(begun, apart)
        return begun[kept], normals[kept]

    def _sound(self, surface: Patched, views: Sequence[View]) -> Patched:
        """Return the patches that are as certain as usual, have neighbours, and lie on the planes of most of them."""
        if len(surface) < FEW:
            return surface
        pitch = _pitch(surface.points, views)
        gaps, near = cKDTree(surface.points).query(surface.points, FEW)
        beside = ~(gaps[:, 2] > ALONE * self.spacing * pitch)
        away = surface.points[:, None] - surface.points[near[:, 1:]]
        off = np.abs(np.median(np.einsum("nki,nki->nk", away, surface.normals[near[:, 1:]]), axis=1))
        usual = surface.sigma < WILD * np.median(surface.sigma)
        return surface.taken(beside & usual & (off < np.maximum(OFF * pitch, WILD * MAD * np.median(off))))


def _tangents(normals: Floats) -> tuple[Floats, Floats]:
    """Return two directions across each of the normals (n, 3) and each other, (n, 3) both."""
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    across = unit(np.cross(normals, helper))
    return across, np.cross(normals, across)


def _pitch(points: Floats, views: Sequence[View]) -> Floats:
    """Return the size of a pixel at points (n, 3), (n,): the mean of the views that have them in front."""
    depths = np.stack([view.depth(points) / view.camera.matrix[0, 0] for view in views])
    return np.maximum(depths, 1e-12).mean(axis=0)


def _shown(view: View, mask: Booleans | None, points: Floats) -> Booleans:
    """Tell which points (n, 3) lie in front of a view, and where its mask lets it be used."""
    shown = view.depth(points) > 0
    if mask is not None and shown.any():
        column, row = np.round(view.project(points[shown])).astype(np.int64).T
        inside = (column >= 0) & (row >= 0) & (column < mask.shape[1]) & (row < mask.shape[0])
        inside[inside] = mask[row[inside], column[inside]]
        shown[shown] = inside
    return shown


def _normals(points: Floats, towards: Floats) -> Floats:
    """Return the directions of least scatter around points (n, 3), on the side of `towards` (n, 3), unit.

    Where they are far from that, for the points around being too few or wild, it takes their place.
    """
    _, near = cKDTree(points).query(points, min(NEIGHBOURS, len(points)))
    around = points[near]
    spread = around - np.median(around, axis=1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", spread, spread))[1][:, :, 0]
    side = np.einsum("ni,ni->n", normals, towards)[:, None]
    return np.where(np.abs(side) > FACING, normals * np.sign(side), towards)


def _spread_out(points: Floats, apart: Floats) -> Integers:
    """Return which of points (n, 3) to keep so that none is closer to another than `apart` (n,): the first ones."""
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    pairs = cKDTree(points).query_pairs(float(apart.max()), output_type="ndarray")
    gaps = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    pairs = pairs[gaps < np.minimum(apart[pairs[:, 0]], apart[pairs[:, 1]])]
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    starts = np.searchsorted(pairs[:, 0], np.arange(len(points) + 1))
    kept = np.ones(len(points), dtype=bool)
    for k in range(len(points)):
        if kept[k]:
            kept[pairs[starts[k] : starts[k + 1], 1]] = False
    return np.flatnonzero(kept)
