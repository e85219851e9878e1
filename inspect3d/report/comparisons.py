"""The methods against each other: difference and E_n maps, Bland-Altman plots, the matrix of all, figures and words."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.compare.agreement_words import LOOSE
from inspect3d.compare.comparison import Comparison
from inspect3d.record import Record
from inspect3d.report.agreement_plot import draw_agreement
from inspect3d.report.blocks import Block, Bullets, Cell, Chapter, Column, Heading, Link, Paragraph, Table
from inspect3d.report.blocks import Picture as Shown
from inspect3d.report.colours import ColourScale, deviation_scale, en_classes, en_scale, symmetric_limits
from inspect3d.report.digits import number
from inspect3d.report.layout import Layout
from inspect3d.report.matrix import draw_matrix
from inspect3d.report.picture import Caption, Picture
from inspect3d.report.standing_out import region_table, resolved
from inspect3d.report.viewpoint import Viewpoint
from inspect3d.report.views import Views

ANCHOR = "comparison"
SEEN = 2
"""Pictures of a difference map."""
EXPLAINED = (
    "Two methods are compared node by node where both observed, after their maps were brought into one alignment. "
    "E_n = |a − b| / U(a − b) with U at k = 2: where both uncertainties are true its root mean square is 0.50 and it "
    "lies above 1 at 4.6 % of the nodes. Between the limits of agreement (Bland and Altman) lie about 95 % of the "
    "differences."
)


def agreement(record: Record) -> list[Block]:
    """Return how far the methods agree, for the first page: a row for each pair; nothing where there is no pair."""
    if not record.comparisons:
        return []
    head = ("Difference", "Mean, µm", "Limits of agreement, µm", "E_n rms", "E_n above 1", "Both measured", "Finding")
    columns: tuple[Column, ...] = ("name", "number", "number", "number", "number", "number", "text")
    return [Table(head, tuple(_row(each) for each in record.comparisons), columns)]


def draw_comparisons(record: Record, folder: Path, views: Views, layout: Layout) -> Chapter | None:
    """Draw the comparisons of the methods and return the chapter on them; None where there is no pair of maps.

    Parameters
    ----------
    record : the inspection
    folder : where the pictures go
    views : of the inspection mesh
    layout : of a sheet
    """
    if not record.comparisons:
        return None
    blocks: list[Block] = [Paragraph(EXPLAINED), *_coverage(record), *resolved(record.parts)]
    parts = [part for part in record.parts if part.status.has_map and part.deviation is not None]
    if len(parts) > 2:
        viewpoint = _seen(record, views, np.any([part.deviation.observed for part in parts if part.deviation], axis=0))[
            0
        ]
        draw_matrix(record, folder / "matrix.png", views, viewpoint, layout)
        words = "All methods: their deviation maps on the diagonal, their differences above it (row minus column), "
        blocks.append(Shown("matrix.png", words + "the figures of each pair below it"))
    for k, comparison in enumerate(record.comparisons, start=1):
        blocks += [
            Heading(f"{comparison.a} and {comparison.b}"),
            Bullets(comparison.words),
        ]
        if comparison.mean is not None:
            blocks += region_table(comparison.regions or ())
            blocks += _draw(record, comparison, k, folder, views, layout)
    return Chapter(ANCHOR, "Comparison of the methods", tuple(blocks))


def _row(comparison: Comparison) -> tuple[Cell, ...]:
    pair = Link(f"{comparison.a} − {comparison.b}", ANCHOR)
    if comparison.mean is None or comparison.limits_of_agreement is None:
        return (pair, "–", "–", "–", "–", _percent(comparison.coverage), "not comparable")
    limits = " to ".join(_micro(limit) for limit in comparison.limits_of_agreement)
    shares = ("–" if comparison.en_rms is None else number(comparison.en_rms, 2), _percent(comparison.en_above_1))
    return (pair, _micro(comparison.mean), limits, *shares, _percent(comparison.coverage), _finding(comparison))


def _finding(comparison: Comparison) -> str:
    if comparison.en_rms is None:
        return "E_n not known"
    if comparison.regions:
        places = "one place" if len(comparison.regions) == 1 else f"{len(comparison.regions)} places"
        return f"differ beyond doubt in {places}"
    return "differ by more than stated" if comparison.en_rms > LOOSE else "agree within U"


def _coverage(record: Record) -> list[Block]:
    mesh = record.nominal.mesh
    areas = np.where(mesh.crease, 0.0, mesh.areas)
    parts = [part for part in record.parts if part.status.has_map and part.deviation is not None]
    seen = np.array([part.deviation.observed for part in parts if part.deviation is not None])
    named = [(part.name, each) for part, each in zip(parts, seen, strict=True)]
    shares = [
        *named,
        ("all of them", seen.all(axis=0)),
        ("at least one", seen.any(axis=0)),
        ("none", ~seen.any(axis=0)),
    ]
    rows = tuple((name, _percent(float(areas[nodes].sum() / areas.sum()))) for name, nodes in shares)
    return [
        Heading("Coverage"),
        Table(("Measured by", "Share of the area, edges not counted"), rows, ("name", "number")),
    ]


def _figures(comparison: Comparison) -> str:
    """Return the figures below the title of a picture."""
    low, high = comparison.limits_of_agreement or (np.nan, np.nan)
    std = _micro(comparison.std, sign=False)
    limits = f"limits of agreement {_micro(low)} to {_micro(high)} µm"
    return f"mean {_micro(comparison.mean)} µm · standard deviation {std} µm · {limits}"


def _draw(record: Record, comparison: Comparison, k: int, folder: Path, views: Views, layout: Layout) -> list[Block]:
    mesh, title = record.nominal.mesh, record.recipe.part.name
    pair = f"{comparison.a} minus {comparison.b}"
    viewpoints = _seen(record, views, comparison.common)[:SEEN]
    caption = Caption(title, f"{pair}: difference of the deviations", _figures(comparison))
    common = comparison.common
    scale = deviation_scale(symmetric_limits(comparison.difference[common], mesh.areas[common]))
    scale = scale.renamed("Difference", "mm")
    shown: list[Block] = []

    def maps(name: str, words: str, values: Floats, scale: ColourScale, chosen: Sequence[Viewpoint]) -> None:
        picture = Picture(mesh, layout, Caption(caption.title, f"{pair}: {words}", caption.figures), scale)
        with views.window(values, scale, layout.window) as window:
            for position, viewpoint in enumerate(chosen, start=1):
                file = f"comparison_{k}_{name}_{position}.png"
                picture.taken(window, viewpoint).save(folder / file)
                shown.append(Shown(file, f"{pair}: {words}, seen from {viewpoint.words}"))

    maps("difference", "difference of the deviations", comparison.difference, scale, viewpoints)
    if comparison.en is not None:
        maps("en", "E_n", en_classes(comparison.en), en_scale(), viewpoints[:1])
    file = f"comparison_{k}_agreement.png"
    draw_agreement(folder / file, comparison, title, layout)
    shown.append(Shown(file, f"{pair}: differences over averages (Bland and Altman) with the limits of agreement"))
    return shown


def _seen(record: Record, views: Views, nodes: np.ndarray) -> tuple[Viewpoint, ...]:
    return views.showing(nodes, record.nominal.mesh.areas)


def _micro(length: float | None, sign: bool = True) -> str:
    return number(None if length is None else 1000 * length, 1, sign=sign)


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{number(100 * share, 1)} %"
