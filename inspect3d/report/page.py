"""The report as one HTML file."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from inspect3d.record import Record
from inspect3d.report.pictures import Shown


def page(
    record: Record,
    values: Mapping[str, Any],
    shown: Mapping[str, tuple[Shown, ...]],
    pictures: Path,
    moment: datetime,
) -> str:
    """Return the report; everything it needs is in it."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("inspect3d.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    embedded = {
        name: [(each.words, _data_uri(pictures / each.file)) for each in several] for name, several in shown.items()
    }
    return environment.get_template("report.html.j2").render(
        record=record, values=values, pictures=embedded, moment=moment
    )


def _data_uri(file: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode()
