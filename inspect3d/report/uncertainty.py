"""What the uncertainty of a map is made of, in words and figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.recipe import MeasurementTable
from inspect3d.record import MeasuredPart, Record
from inspect3d.register.alignment import Alignment
from inspect3d.report.digits import COVERAGE, significant

REFERENCE = 20.0
"""Temperature at which dimensions hold, degC (ISO 1)."""


@dataclass(frozen=True)
class Contribution:
    """A source of uncertainty.

    Parameters
    ----------
    source : what it is
    figure : how large, with its unit
    words : how it enters
    """

    source: str
    figure: str
    words: str


def contributions(record: Record, part: MeasuredPart) -> tuple[Contribution, ...]:
    """Return the sources of uncertainty of a map, and at the end their sum; nothing where there is no map."""
    if part.deviation is None or not part.deviation.observed.any():
        return ()
    found = list(_of_the_points(record, part)) + list(_of_the_surroundings(record, part))
    sigma = part.deviation.sigma[part.deviation.observed]
    low, middle, high = np.percentile(sigma, (5, 50, 95))
    spread = f"{_micro(low)} to {_micro(high)} at nine nodes of ten"
    found.append(Contribution("standard uncertainty of a node (k = 1)", _micro(middle), f"median; {spread}"))
    words = f"median; about 95 % of the nodes lie within ± U of the true deviation (k = {COVERAGE})"
    found.append(Contribution("expanded uncertainty of a node, U", _micro(COVERAGE * middle), words))
    return tuple(found)


def pose_sigma(mesh: InspectionMesh, alignment: Alignment) -> Floats:
    """Return what the uncertainty of the pose alone means at each node, (n,) mm: the root of diag J C J'.

    J holds the rigid motions along the normals: a small motion (r, t) about the origin o moves the measured surface
    by n.(t + r x (x - o)).
    """
    motions = np.hstack([np.cross(mesh.nodes - alignment.origin, mesh.normals), mesh.normals])
    variance = np.einsum("ij,jk,ik->i", motions, alignment.covariance, motions)
    return np.sqrt(np.maximum(variance, 0.0))


def _of_the_points(record: Record, part: MeasuredPart) -> list[Contribution]:
    found = [Contribution(*each) for each in part.contributions]
    if part.noise is not None:
        words = "standard noise of one point; a node averages the points around it, by their scatter and number"
        found.append(Contribution("noise of the points", _micro(part.noise), words))
    if part.alignments and part.deviation is not None:
        sigma = pose_sigma(record.nominal.mesh, part.alignments[0])[part.deviation.observed]
        words = "median of what the covariance of the pose means at a node; "
        words += (
            "for comparison: the map is known up to a best fit to the same points, and so are its uncertainties"
            if _table(record, part).alignment.refined
            else "shared by all nodes"
        )
        found.append(Contribution("alignment", _micro(float(np.median(sigma))), words))
    if record.nominal.chord > 0:
        chord = record.nominal.chord
        words = f"the triangles that stand for the CAD surface lie up to {_micro(chord)} off it, on one side"
        found.append(Contribution("CAD tessellation", _micro(chord / np.sqrt(3.0)), words))
    return found


def _of_the_surroundings(record: Record, part: MeasuredPart) -> list[Contribution]:
    found = []
    coating = _table(record, part).coating
    if coating is not None:
        words = f"of the thickness of the paint, {_micro(coating.thickness)}, which is subtracted; shared by all nodes"
        found.append(Contribution("coating", _micro(coating.sigma), words))
    budget = record.recipe.report.budget
    if budget.calibration > 0:
        words = "of the instrument; shared by all nodes"
        found.append(Contribution("calibration", _micro(budget.calibration), words))
    if budget.expansion != 0 and budget.temperature != REFERENCE:
        warmer = budget.temperature - REFERENCE
        size = float(np.linalg.norm(np.ptp(record.nominal.mesh.nodes, axis=0)))
        words = (
            f"corrected, and no uncertainty: what {budget.temperature:g} °C instead of 20 °C mean over the diagonal of "
            f"{size:.0f} mm, at {significant(1e6 * budget.expansion, 3)} µm per metre and kelvin"
        )
        found.append(Contribution("temperature", _micro(abs(budget.expansion * warmer) * size), words))
    return found


def _table(record: Record, part: MeasuredPart) -> MeasurementTable:
    return next(table for table in record.recipe.measurements if table.name == part.name)


def _micro(length: float) -> str:
    return f"{significant(1000 * length, 2)} µm" if length < 0.1 else f"{significant(length, 3)} mm"
