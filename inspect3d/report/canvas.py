"""A sheet of paper in pixels, on which a picture and its annotations are put."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from inspect3d.report.fonts import installed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#1d2127"
PALE = "#5d6570"


@dataclass(frozen=True, eq=False)
class Canvas:
    """A white sheet; (0, 0) is its top left corner, y goes down, lengths are pixels.

    Parameters
    ----------
    width, height : px
    """

    width: int
    height: int

    @cached_property
    def unit(self) -> float:
        """Return the size of everything relative to a sheet of 1600 x 1200 px."""
        return min(self.width / 1600, self.height / 1200)

    @cached_property
    def figure(self) -> Figure:
        """Return the sheet as a matplotlib figure."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(self.width / 100, self.height / 100), dpi=100, facecolor="white")
        FigureCanvasAgg(figure)
        return figure

    @cached_property
    def axes(self) -> Axes:
        """Return the axes in pixels."""
        axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set_xlim(0, self.width)
        axes.set_ylim(self.height, 0)
        return axes

    def text(self, x: float, y: float, words: str, size: float, **style: Any) -> None:
        """Write words as they are, whatever characters they hold; size in px of a 1600 x 1200 sheet."""
        style = {"color": INK, "va": "center", "ha": "left"} | style
        self.axes.text(x, y, words, fontsize=size * self.unit * 0.72, parse_math=False, family=installed(), **style)

    def fitted(self, x: float, y: float, words: str, size: float, width: float, **style: Any) -> None:
        """Write words, cut with an ellipsis where they are wider than asked."""
        kept = words
        while len(kept) > 1 and self.measure(kept, size, style.get("weight", "normal")) > width:
            words = words[:-1]
            kept = words.rstrip() + "…"
        self.text(x, y, kept, size, **style)

    def measure(self, words: str, size: float, weight: str = "normal") -> float:
        """Return the width of words, px."""
        from matplotlib.font_manager import FontProperties
        from matplotlib.textpath import text_to_path

        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=r"Glyph .* missing", category=UserWarning)
            properties = FontProperties(family=installed(), weight=weight, size=size * self.unit)
            width, _, _ = text_to_path.get_text_width_height_descent(words, properties, ismath=False)
        return float(width)

    def line(self, xs: list[float], ys: list[float], **style: Any) -> None:
        """Draw a line through points."""
        width = style.pop("width", 1.5) * self.unit * 0.72
        self.axes.plot(xs, ys, linewidth=width, **({"color": INK, "solid_capstyle": "butt"} | style))

    def picture(self, left: float, top: float, image: NDArray[np.uint8]) -> None:
        """Put a picture (height, width, 3) with its pixels on those of the sheet."""
        height, width = image.shape[:2]
        extent = (left, left + width, top + height, top)
        self.axes.imshow(image, extent=extent, interpolation="none", aspect="auto", zorder=0)
        self.axes.set_xlim(0, self.width)
        self.axes.set_ylim(self.height, 0)

    def save(self, file: Path) -> None:
        """Write the sheet as PNG; the same sheet gives the same bytes."""
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=r"Glyph .* missing", category=UserWarning)
            self.figure.savefig(file, format="png", dpi=100, metadata={"Software": "inspect3d"})
