"""Finished inspections in a notebook: their natural display is a live view."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory

HEIGHT = 640
"""px, of the view in the notebook."""


@dataclass(frozen=True, init=False)
class Results:
    """The results of one or more inspections.

    A notebook shows them as the 3-D view of the report, which needs no server: it runs inside the notebook's page,
    also in one that was saved. Where pages show no HTML, there is a picture.

    Parameters
    ----------
    folders : what `inspect3d run` wrote
    """

    folders: tuple[Path, ...]

    def __init__(self, *folders: str | Path) -> None:
        object.__setattr__(self, "folders", tuple(map(Path, folders)))

    def _repr_html_(self) -> str:
        """Return the view as a frame of its own, out of reach for the notebook and it for the view."""
        from inspect3d.comparing import joined
        from inspect3d.report.page import view_alone
        from inspect3d.report.viewer import viewer_data
        from inspect3d.report.viewpoint import Viewpoint

        record = joined(self.folders)
        page = view_alone(record.recipe.part.name, viewer_data(record, Viewpoint.of("iso")))
        return (
            f'<iframe sandbox="allow-scripts" style="width: 100%; height: {HEIGHT}px; border: 0" '
            f'srcdoc="{escape(page)}"></iframe>'
        )

    def _repr_png_(self) -> bytes:
        """Return a picture of the first map."""
        from inspect3d.report.screenshot import screenshot

        with TemporaryDirectory() as folder:
            screenshot(self.folders[0], Path(folder) / "map.png", size=(1000, 750))
            return (Path(folder) / "map.png").read_bytes()
