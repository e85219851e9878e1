"""Where the pictures have texture, and with it where the part must lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import View
from inspect3d.register.similarity import Similarity
from inspect3d.starting.features import Features

CELLS = 160  # along the longer side of a picture
Places = tuple[Floats, Floats, Floats]
FINEST = 3.0  # px of the reduced picture, of a cell that shows the outline
CLOSED = 4  # cells within which gaps of such are closed
UNCLEAR = 0.2  # share of the cells across an outline that may contradict a step from texture to none
AROUND = 2  # cells around a feature that count as textured


@dataclass(frozen=True, eq=False)
class Texture:
    """Where the pictures have features: cells of coarse grids over them.

    Parameters
    ----------
    cells : of each picture (rows, columns)
    widths : px of a cell of each
    """

    cells: tuple[Booleans, ...]
    widths: tuple[float, ...]

    @classmethod
    def of(cls, found: Sequence[Features], sizes: Sequence[tuple[int, int]]) -> Texture:
        """Return where pictures of given sizes (px) have features, gaps between neighbours closed."""
        widths = tuple(max(size) / CELLS for size in sizes)
        return cls(tuple(map(_cells, found, sizes, widths)), widths)

    @classmethod
    def closed(cls, found: Sequence[Features], sizes: Sequence[tuple[int, int]]) -> Texture:
        """Return where pictures of given sizes (px) have features, as finely as the distances of these tell."""
        spacings = [_spacing(each.pixels) for each in found]
        widths = tuple(max(FINEST * each.step, s / 2) for each, s in zip(found, spacings, strict=True))
        return cls(tuple(map(_closed_cells, found, sizes, widths)), widths)

    def ends(self, number: int, pixels: Floats, outward: Floats, reach: int) -> Floats:
        """Return how far out of the part the texture of a picture ends, (n,) px; NaN where it does not, or not clearly.

        Along each way out, the step from texture to none is taken that most cells agree with.

        Parameters
        ----------
        pixels, outward : (n, 2) px, where to look, and the unit direction out of the part
        reach : cells, how far, either way
        """
        cells, width = self.cells[number], self.widths[number]
        steps = 0.5 * np.arange(-2 * reach, 2 * reach + 1)
        at = np.floor((pixels[:, None] + width * steps[:, None] * outward[:, None] + 0.5) / width)
        inside = ((at >= 0) & (at < np.array(cells.shape)[::-1])).all(axis=(1, 2))
        row, column = (np.clip(at[:, :, k], 0, cells.shape[1 - k] - 1).astype(np.int64) for k in (1, 0))
        filled = cells[row, column]
        wrong = np.zeros((len(pixels), len(steps) + 1), np.int64)
        wrong[:, 1:] = np.cumsum(~filled, axis=1)
        wrong += np.count_nonzero(filled, axis=1)[:, None]
        wrong[:, 1:] -= np.cumsum(filled, axis=1)
        cost = wrong + 1e-3 * np.abs(np.arange(len(steps) + 1) - len(steps) / 2)
        best = cost.argmin(axis=1)
        clear = wrong[np.arange(len(best)), best] <= UNCLEAR * len(steps)
        good = inside & clear & (best > 1) & (best < len(steps) - 1)
        return np.where(good, width * 0.5 * (best - len(steps) / 2), np.nan)

    def bareness(self, views: Sequence[View], places: Places, points_cad: Floats) -> Floats:
        """Return the share of the part that would appear where the pictures show nothing, for each of k places, (k,).

        What hides what does not matter: the outline is the union of the pictures of all points.

        Parameters
        ----------
        views : in a frame of their own
        places : cad_from_rig: rotations (k, 3, 3), translations (k, 3) and scales (k,)
        points_cad : (n, 3) mm, spread over the part
        """
        from inspect3d.starting.bare_kernel import bare_shares

        counts = np.array([each.shape for each in self.cells], dtype=np.int64)
        stack = np.zeros((len(self.cells), *counts.max(axis=0)), dtype=np.bool_)
        for page, each in zip(stack, self.cells, strict=True):
            page[: each.shape[0], : each.shape[1]] = each
        rig = (
            np.stack([view.camera.matrix for view in views]),
            np.stack([view.camera.distortion for view in views]),
            np.stack([view.camera_from_cad.rotation for view in views]),
            np.stack([view.camera_from_cad.translation for view in views]),
        )
        return bare_shares(*places, rig, stack, counts, np.array(self.widths), points_cad)


def stacked(places: Sequence[Similarity]) -> Places:
    """Return the rotations (k, 3, 3), translations (k, 3) and scales (k,) of places, as kernels take them."""
    return (
        np.stack([each.pose.rotation for each in places]),
        np.stack([each.pose.translation for each in places]),
        np.array([each.scale for each in places]),
    )


def _cells(found: Features, size: tuple[int, int], width: float) -> Booleans:
    import cv2

    return np.asarray(cv2.dilate(_filled(found, size, width), _disc(AROUND)) > 0)


def _closed_cells(found: Features, size: tuple[int, int], width: float) -> Booleans:
    import cv2

    framed = cv2.copyMakeBorder(_filled(found, size, width), *(2 * CLOSED,) * 4, cv2.BORDER_REPLICATE)
    closed = cv2.morphologyEx(framed, cv2.MORPH_CLOSE, _disc(CLOSED))
    return np.asarray(closed[2 * CLOSED : -2 * CLOSED, 2 * CLOSED : -2 * CLOSED] > 0)


def _filled(found: Features, size: tuple[int, int], width: float) -> NDArray[np.uint8]:
    cells = np.zeros((int(np.ceil(size[1] / width)), int(np.ceil(size[0] / width))), np.uint8)
    at = np.floor((found.pixels + 0.5) / width).astype(int)
    cells[np.clip(at[:, 1], 0, cells.shape[0] - 1), np.clip(at[:, 0], 0, cells.shape[1] - 1)] = 1
    return cells


def _disc(radius: int) -> NDArray[np.uint8]:
    import cv2

    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1,) * 2), np.uint8)


def _spacing(pixels: Floats) -> float:
    """Return the usual distance of a feature to its nearest neighbour, px."""
    if len(pixels) < 2:
        return 0.0
    return float(np.median(cKDTree(pixels).query(pixels[:2000], 2)[0][:, 1]))
