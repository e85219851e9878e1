"""Poses and their uncertainty as the report shows them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.outcome import Status
from inspect3d.record import MeasuredPart
from inspect3d.register.alignment import Alignment
from inspect3d.report.digits import decimals, grouped, number, significant
from inspect3d.report.results import candidates

MOTIONS = ("turn about x", "turn about y", "turn about z", "shift along x", "shift along y", "shift along z")
NEGLIGIBLE = 1e-3
"""Share of the largest standard uncertainty of its kind, turn or shift, below which a motion was held: what is left
comes from rounding and from axes that are not quite its own."""


@dataclass(frozen=True)
class PoseWords:
    """A pose to show: its title, and its matrix as a recipe takes it."""

    title: str
    matrix: str


def poses(part: MeasuredPart) -> tuple[PoseWords, ...]:
    """Return the poses of a measurement and, after them, the other candidates."""
    found = []
    if part.status.has_map:
        for k, alignment in enumerate(part.alignments, start=1):
            of_file = f" of file {k}" if len(part.alignments) > 1 else ""
            found.append(PoseWords(f"Pose{of_file}: CAD from measured", _matrix(alignment.cad_from_measured.matrix)))
    others = 1 if part.status.has_map else 0
    for k, candidate in enumerate(candidates(part)[others:], start=others + 1):
        residual = significant(candidate.residual, 3)
        scale = f", scale {candidate.scale:.6g}" if candidate.scale != 1 else ""
        title = f"Candidate {k}: robust residual {residual} mm{scale}"
        found.append(PoseWords(title, _matrix(candidate.pose.matrix)))
    return tuple(found)


def motions(alignment: Alignment) -> list[tuple[str, str]]:
    """Return the six standard uncertainties of the pose; a motion without any was held."""
    sigma = np.sqrt(np.maximum(np.diag(alignment.covariance), 0.0))
    rows = []
    for k, (name, size) in enumerate(zip(MOTIONS, sigma.tolist(), strict=True)):
        shown, unit = (np.degrees(size), "°") if k < 3 else (1000 * size, " µm")
        held = size <= NEGLIGIBLE * sigma[3 * (k // 3) : 3 * (k // 3) + 3].max()
        rows.append((name, "held" if held else f"{number(shown, decimals(shown))}{unit}"))
    return rows


def alignment_rows(part: MeasuredPart) -> list[tuple[str, str]]:
    """Return the figures of the alignment."""
    rows = []
    for k, alignment in enumerate(part.alignments, start=1):
        of_file = f", file {k}" if len(part.alignments) > 1 else ""
        rows.append((f"robust residual{of_file}", f"{significant(alignment.residual, 3)} mm"))
        rows.append((f"points used{of_file}", f"{grouped(alignment.count)} of {grouped(len(alignment.used))}"))
        pose = alignment.cad_from_measured
        rows.append((f"turned by{of_file}", f"{number(float(np.degrees(pose.angle)), 3)}°"))
        rows.append((f"moved by{of_file}", f"{number(float(np.linalg.norm(pose.translation)), 3)} mm"))
        if alignment.scale != 1:
            rows.append((f"scale{of_file}", f"{alignment.scale:.6f}"))
    return rows


def advice(part: MeasuredPart) -> str:
    """Return what to do about a measurement without a result."""
    if part.status is Status.AMBIGUOUS:
        return (
            "Choose the right candidate below and put its matrix into the recipe, as "
            'alignment = { start = "pose", matrix = ... }, or name three or more landmarks.'
        )
    if part.status is Status.FAILED:
        return (
            "Check that the CAD model and its units belong to this measurement; if they do, start the alignment from "
            "landmarks or from a pose."
        )
    return ""


def _matrix(matrix: np.ndarray) -> str:
    rows = [", ".join(f"{value + 0.0:.9f}" for value in row) for row in matrix]
    return "matrix = [\n" + "\n".join(f"    [{row}]," for row in rows) + "\n]"
