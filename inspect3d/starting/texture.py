"""Where the pictures have texture, and with it where the part must lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import View
from inspect3d.register.similarity import Similarity
from inspect3d.starting.features import Features

CELLS = 160  # along the longer side of a picture
Places = tuple[Floats, Floats, Floats]
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

    cells = np.zeros((int(np.ceil(size[1] / width)), int(np.ceil(size[0] / width))), np.uint8)
    at = np.floor((found.pixels + 0.5) / width).astype(int)
    cells[np.clip(at[:, 1], 0, cells.shape[0] - 1), np.clip(at[:, 0], 0, cells.shape[1] - 1)] = 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * AROUND + 1,) * 2)
    return np.asarray(cv2.dilate(cells, disc) > 0)
