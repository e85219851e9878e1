"""What a recipe's table of the alignment asks for, and what the other choices in it would change."""

from __future__ import annotations

import numpy as np

from inspect3d.compare.sensitivity import Sensitivity, sensitivity
from inspect3d.compare.tolerances import inside
from inspect3d.deviate.deviation import Deviation
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.recipe_alignment import Start
from inspect3d.register.alignment import Alignment
from inspect3d.register.fit import Datum, Fit, ReferencePoint


def fitted_to(alignment: Start, mesh: InspectionMesh) -> Fit:
    """Return what the common alignment is fitted to; the best fit where landmarks alone give the pose."""
    if alignment.fit in ("datum", "rps"):
        return choices(alignment, mesh)[alignment.fit]
    return Fit(locked=alignment.locked)


def choices(alignment: Start, mesh: InspectionMesh) -> dict[str, Fit]:
    """Return all the fits that a table tells enough for, by kind."""
    found = {"best": Fit()}
    if alignment.datum:
        datums = tuple(
            Datum(region.name or "ABCDEFGHIJKLMNOPQRSTUVWXYZ"[k % 26], inside(region, mesh.nodes, mesh.face))
            for k, region in enumerate(alignment.datum)
        )
        found["datum"] = Fit("datum", datums=datums, locked=alignment.locked)
    if alignment.rps:
        points = tuple(ReferencePoint(each.point, each.direction) for each in alignment.rps)
        found["rps"] = Fit("rps", points=points, locked=alignment.locked)
    return found


def sensitivity_of(
    alignment: Start, deviation: Deviation, placed: Alignment, mesh: InspectionMesh, scale_known: bool
) -> Sensitivity:
    """Return how much a map depends on the choice of its alignment, by all the choices that the table tells."""
    marks = alignment.landmarks
    landmarks = None
    if len(marks) >= 3 and alignment.fit != "landmarks":
        landmarks = np.array([mark.measured for mark in marks]), np.array([mark.cad for mark in marks])
    chosen = _words(alignment, mesh)
    others = tuple(fit for fit in choices(alignment, mesh).values() if fit.words != chosen)
    return sensitivity(chosen, others, landmarks, deviation, placed, mesh, scale_known)


def _words(alignment: Start, mesh: InspectionMesh) -> str:
    if alignment.refined:
        return fitted_to(alignment, mesh).words
    if "landmarks" in (alignment.start, alignment.fit):
        return f"{len(alignment.landmarks)} landmarks"
    return "the pose that the recipe gives"
