"""What cameras see of a part."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inspect3d.arrays import Booleans
from inspect3d.camera import View
from inspect3d.correlation.cells import SMALLEST, cut_facets, whole_facets
from inspect3d.correlation.evaluation import EvaluationPoints, evaluation_points, points_per_edge
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.visibility import visibility
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import MeasurementError

FEWEST = 6


def scene(
    nominal: Nominal,
    views: Sequence[View],
    pixels: float,
    steepest: float,
    masks: Sequence[Booleans | None],
    per_edge: int | None = None,
    lifted: bool = True,
    cut: bool = True,
) -> Scene:
    """Return what the views see of a part.

    Parameters
    ----------
    pixels : px of the largest picture that one evaluation point stands for
    steepest : rad, largest angle between normal and line of sight
    masks : of each view, True where its picture may be used, or None
    per_edge : evaluation points along the edge of every facet, in place of `pixels`
    lifted : points on the nominal surface; else on the flat facets
    cut : facets cut where sheets of the CAD end

    Raises
    ------
    MeasurementError
        No facet is seen by two cameras.
    """
    mesh = nominal.mesh
    count = points_per_edge(mesh, views, pixels) if per_edge is None else np.full(len(mesh.triangles), per_edge)
    points, feet = evaluation_points(nominal, count, lifted)
    cells = cut_facets(nominal, points, feet) if cut else whole_facets(mesh, points)
    see = visibility(nominal, cells, views, steepest, masks)
    points, n = cells.points, len(cells.node)
    there = np.where(cells.part >= SMALLEST, np.diff(points.starts), 0)
    counts = np.bincount(points.facet[see.used], minlength=len(there))
    good = (there > 0) & (counts >= FEWEST)
    kept = np.flatnonzero(good)
    if not len(kept):
        raise MeasurementError(_unseen(views, see.seen))
    chosen = see.used & good[points.facet]
    node, triangles = np.unique(cells.triangles[kept], return_inverse=True)
    seen = EvaluationPoints(
        points.places[chosen], points.shapes[chosen], np.concatenate([[0], np.cumsum(counts[kept])]), points.chord
    )
    around = np.bincount(cells.triangles.ravel(), np.repeat(there, 3), minlength=n)
    taken = np.bincount(cells.triangles[kept].ravel(), np.repeat(counts[kept], 3), minlength=n)
    return Scene(
        mesh.nodes[cells.node[node]],
        cells.normals[node],
        triangles.reshape(-1, 3),
        seen,
        see.taking[kept],
        cells.node[node],
        cells.sheet[node],
        cells.own[node],
        cells.facet[kept],
        (taken / np.maximum(around, 1))[node],
    )


def _unseen(views: Sequence[View], seen: Booleans) -> str:
    shares = ", ".join(f"{100 * row.mean():.0f} %" for row in seen)
    return (
        f"No part of the surface is seen by two of the {len(views)} cameras (they see {shares} of it): check the "
        "poses, and that the normals of the part point out of the material."
    )
