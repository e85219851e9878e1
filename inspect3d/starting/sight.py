"""What the pictures show as a whole: the part's texture, and with it where the part must lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import View
from inspect3d.starting.features import Features

CELLS = 160  # along the longer side of a picture
AROUND = 2  # cells around a feature that count as textured


@dataclass(frozen=True, eq=False)
class Textured:
    """Where a picture has features: cells of a coarse grid over it.

    Parameters
    ----------
    cells : (rows, columns)
    width : px of a cell
    """

    cells: Booleans
    width: float

    @classmethod
    def of(cls, found: Features, size: tuple[int, int]) -> Textured:
        """Return where a picture of a size (px) has features, gaps between neighbours closed."""
        import cv2

        width = max(size) / CELLS
        cells = np.zeros((int(np.ceil(size[1] / width)), int(np.ceil(size[0] / width))), np.uint8)
        at = np.floor((found.pixels + 0.5) / width).astype(int)
        cells[np.clip(at[:, 1], 0, cells.shape[0] - 1), np.clip(at[:, 0], 0, cells.shape[1] - 1)] = 1
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * AROUND + 1,) * 2)
        return cls(cv2.dilate(cells, disc) > 0, width)

    def bare(self, pixels: Floats) -> Floats:
        """Tell how far (n,) places (n, 2) px miss the texture: 1 off it, 0 on it or out of the picture."""
        at = np.floor((pixels + 0.5) / self.width).astype(int)
        inside = ((at >= 0) & (at < self.cells.shape[::-1])).all(axis=1)
        missed = np.zeros(len(pixels))
        missed[inside] = ~self.cells[at[inside, 1], at[inside, 0]]
        return missed


def bareness(views: Sequence[View], textured: Sequence[Textured], points_cad: Floats) -> float:
    """Return the share of points (n, 3) mm spread over the part that would appear where the pictures show nothing.

    What hides what does not matter: the outline is the union of the places of all points.
    """
    missed = []
    for view, each in zip(views, textured, strict=True):
        depth = view.depth(points_cad)
        if (depth <= 0).any():
            return 1.0
        missed.append(each.bare(view.project(points_cad)).mean())
    return float(np.mean(missed))
