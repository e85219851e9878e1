"""Where things lie on the sheet of a picture."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Layout:
    """A title strip on top, axes and scale at the foot, the colour bar on the right, columns of flags where there are.

    Parameters
    ----------
    width, height : of the sheet, px
    flags : keep a column free on either side of the drawing
    """

    width: int
    height: int
    flags: bool = False

    @property
    def unit(self) -> float:
        """Return the size of everything relative to a sheet of 1600 x 1200 px."""
        return min(self.width / 1600, self.height / 1200)

    @property
    def column(self) -> int:
        """Return the width of a column of flags, px."""
        return round(262 * self.unit) if self.flags else round(30 * self.unit)

    @property
    def top(self) -> int:
        """Return where the drawing begins, px from the top."""
        return round(158 * self.unit)

    @property
    def right(self) -> int:
        """Return where the colour bar's column begins, px from the left."""
        return self.width - round(285 * self.unit)

    @property
    def bottom(self) -> int:
        """Return where the foot begins, px from the top."""
        return self.height - round(130 * self.unit)

    @property
    def window(self) -> tuple[int, int]:
        """Return width and height of the drawing, px."""
        return max(self.right - 2 * self.column, 16), max(self.bottom - self.top, 16)
