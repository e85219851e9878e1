"""The report as one HTML file that needs neither network nor other files."""

from __future__ import annotations

import base64
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from inspect3d.report.blocks import Document, as_data

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup


def page(document: Document, pictures: Path, viewer_data: str) -> str:
    """Return the report as HTML.

    Parameters
    ----------
    document : the report
    pictures : the folder where its pictures lie
    viewer_data : of the 3-D view; empty where there is nothing to show
    """
    environment = _environment()
    environment.globals["embedded"] = lambda file: _embedded(pictures / file)
    return environment.get_template("report.html.j2").render(document=as_data(document), **_viewer(viewer_data))


def view_alone(title: str, viewer_data: str) -> str:
    """Return a page that shows the 3-D view only."""
    return _environment().get_template("alone.html.j2").render(title=title, **_viewer(viewer_data))


def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(loader=PackageLoader("inspect3d.report"), autoescape=True, undefined=StrictUndefined)
    environment.trim_blocks = environment.lstrip_blocks = True
    return environment


def _viewer(viewer_data: str) -> dict[str, Markup]:
    """Return what the templates need for the 3-D view."""
    from markupsafe import Markup

    return {
        "pane_css": Markup(asset("pane.css")),
        "css": Markup(asset("report.css")),
        "surface_code": Markup(asset("surface.js")),
        "pane_code": Markup(asset("pane.js")),
        "viewer_code": Markup(asset("viewer.js")),
        "viewer_data": Markup(viewer_data),
    }


def asset(name: str) -> str:
    """Return a template as text."""
    return (files("inspect3d.report") / "templates" / name).read_text(encoding="utf-8")


def _embedded(file: Path) -> str:
    """Return a picture as a data URI, in WebP: a quarter of its size as PNG."""
    from io import BytesIO

    from PIL import Image

    buffer = BytesIO()
    with Image.open(file) as image:
        image.convert("RGB").save(buffer, "WEBP", quality=90, method=4)
    return f"data:image/webp;base64,{base64.b64encode(buffer.getvalue()).decode()}"
