"""The report as one HTML file that needs neither network nor other files."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from inspect3d.record import Record
from inspect3d.report.account import account
from inspect3d.report.digits import grouped, number
from inspect3d.report.pictures import Shown
from inspect3d.report.viewer import viewer_data
from inspect3d.report.viewpoint import Viewpoint


@dataclass(frozen=True)
class Embedded:
    """A picture inside the page: a data URI and its caption."""

    data: str
    words: str


def page(
    record: Record, values: Mapping[str, Any], shown: Mapping[str, tuple[Shown, ...]], folder: Path, moment: datetime
) -> str:
    """Return the report as HTML.

    Parameters
    ----------
    record : the inspection
    values : what results.json holds
    shown : the pictures of each measurement, and under "" the one of the part
    folder : where the pictures lie
    moment : the date on the report
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(loader=PackageLoader("inspect3d.report"), autoescape=True, undefined=StrictUndefined)
    environment.trim_blocks = environment.lstrip_blocks = True
    embedded = {name: [_embedded(folder, each) for each in pictures] for name, pictures in shown.items()}
    accounts = [
        account(record, part, values["measurements"][part.name], f"measurement-{k}", embedded.get(part.name, []))
        for k, part in enumerate(record.parts, start=1)
    ]
    with_map = any(not each.failed for each in accounts)
    return environment.get_template("report.html.j2").render(
        part=_part(record, values["part"], embedded[""][0].data),
        moment=moment.strftime("%Y-%m-%d %H:%M %Z").strip(),
        accounts=accounts,
        warnings=record.warnings,
        inputs=record.inputs,
        versions=list(record.versions.items()),
        with_map=with_map,
        pane_css=Markup(_asset("pane.css")),
        css=Markup(_asset("report.css")),
        surface_code=Markup(_asset("surface.js")),
        pane_code=Markup(_asset("pane.js")),
        viewer_code=Markup(_asset("viewer.js")),
        viewer_data=Markup(viewer_data(record, _start(shown)) if with_map else ""),
    )


def _part(record: Record, values: Mapping[str, Any], picture: str) -> dict[str, Any]:
    mesh, tolerance = record.nominal.mesh, record.recipe.part.tolerance
    size = " × ".join(number(float(length), 1) for length in np.ptp(mesh.nodes, axis=0))
    rows = [
        ("size", f"{size} mm"),
        ("surface", f"{grouped(round(values['area']))} mm²"),
        ("nodes of the inspection mesh", grouped(len(mesh))),
        ("median edge of the inspection mesh", f"{number(values['edge_length'], 2)} mm"),
        ("nodes on edges sharper than 30°", grouped(int(np.count_nonzero(mesh.crease)))),
    ]
    if tolerance is not None:
        rows.append(("probability of the decision rule", f"{record.recipe.part.probability:g}"))
    return {
        "name": record.recipe.part.name,
        "cad": record.recipe.part.cad,
        "size": size,
        "tolerance": " to ".join(f"{limit:+g}".replace("-", "−") for limit in tolerance) if tolerance else "",
        "rows": rows,
        "remarks": record.nominal.remarks,
        "picture": picture,
    }


def _start(shown: Mapping[str, tuple[Shown, ...]]) -> Viewpoint:
    """Return the viewpoint of the first picture of a measurement."""
    found = (each.viewpoint for name, pictures in shown.items() if name for each in pictures if each.viewpoint)
    return next(found, Viewpoint.of("iso"))


def _embedded(folder: Path, shown: Shown) -> Embedded:
    data = base64.b64encode((folder / shown.file).read_bytes()).decode()
    return Embedded(f"data:image/png;base64,{data}", shown.words)


def _asset(name: str) -> str:
    return (files("inspect3d.report") / "templates" / name).read_text(encoding="utf-8")
