"""One annotated picture: the part in the colours of a field, its colour bar, flags, axes and scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.recipe_types import Interval
from inspect3d.report.canvas import PALE, Canvas
from inspect3d.report.colour_bar import draw_colour_bar
from inspect3d.report.colours import ColourScale
from inspect3d.report.compass import draw_compass
from inspect3d.report.flags import draw_flags
from inspect3d.report.layout import Layout
from inspect3d.report.reading import Reading
from inspect3d.report.scene import Scene
from inspect3d.report.viewpoint import Viewpoint


@dataclass(frozen=True)
class Caption:
    """The words above a picture: the part; the measurement and what is shown; the key figures."""

    title: str
    subtitle: str
    figures: str = ""

    def write(self, canvas: Canvas) -> None:
        """Write the words at the top of a sheet."""
        u = canvas.unit
        width = canvas.width - 60 * u
        size = min(40.0, max(26.0, 40.0 * width / max(canvas.measure(self.title, 40, "bold"), 1.0)))
        canvas.fitted(30 * u, 40 * u, self.title, size, width, weight="bold")
        canvas.fitted(30 * u, 86 * u, self.subtitle, 30, width)
        canvas.fitted(30 * u, 126 * u, self.figures, 24, width, color=PALE)


@dataclass(frozen=True, eq=False)
class Picture:
    """What all pictures of one field share.

    Parameters
    ----------
    mesh : whose nodes carry the field
    layout : of the sheet
    caption : the words above
    scale : of the colours; None where the part is drawn in grey
    flagged : readings to flag where they are seen
    tolerance : mm, marked at the colour bar
    """

    mesh: InspectionMesh
    layout: Layout
    caption: Caption
    scale: ColourScale | None = None
    flagged: Sequence[Reading] = ()
    tolerance: Interval | None = None

    def taken(self, window: Scene, viewpoint: Viewpoint) -> Canvas:
        """Return the sheet with the part as it is seen from a viewpoint."""
        (image, sight), layout = window.draw(viewpoint), self.layout
        canvas = Canvas(layout.width, layout.height)
        canvas.picture(layout.column, layout.top, image)
        self.caption.write(canvas)
        if self.scale is not None:
            draw_colour_bar(canvas, layout, self.scale, self.tolerance)
        draw_compass(canvas, layout, sight.axes, sight.pixel, f"seen from {viewpoint.words}")
        nodes = [reading.node for reading in self.flagged if reading.node is not None]
        if nodes:
            seen = sight.sees(self.mesh.nodes[nodes], self.mesh.normals[nodes])
            pixels = sight.pixels(self.mesh.nodes[nodes])[seen] + 0.5 + [layout.column, layout.top]
            with_node = [reading for reading in self.flagged if reading.node is not None]
            draw_flags(canvas, layout, [with_node[k] for k in np.flatnonzero(seen)], pixels)
        return canvas
