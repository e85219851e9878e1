"""A finished inspection in a few lines, for the terminal."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from inspect3d.compare.comparison import Comparison
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.statistics import Statistics
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.record import Record
from inspect3d.report.digits import number


def summary(record: Record, out: Path) -> Iterator[str]:
    """Yield how each measurement ended, its figures, how they agree, the warnings, and where the report lies."""
    for part in record.parts:
        yield f"{part.name} ({part.method}): {part.reason or part.status.words}"
        if part.deviation is not None:
            yield f"    {_figures(part.deviation, record.nominal.mesh)}"
    for comparison in record.comparisons:
        yield f"{comparison.a} − {comparison.b}: {_agreement(comparison)}"
    yield from (f"warning: {warning}" for warning in record.warnings)
    yield f"report: {out / 'report.html'}"


def _figures(deviation: Deviation, mesh: InspectionMesh) -> str:
    observed = deviation.observed
    if not observed.any():
        return f"none of {len(mesh)} nodes was observed"
    figures = Statistics.of(deviation.value[observed], mesh.areas[observed])
    sigma = np.median(deviation.sigma[observed])
    nodes = f"{np.count_nonzero(observed)} of {len(mesh)} nodes observed"
    return f"mean {_signed(figures.mean)} mm, std {figures.std:.4f} mm, median sigma {sigma:.4f} mm; {nodes}"


def _agreement(comparison: Comparison) -> str:
    if comparison.mean is None or comparison.std is None:
        return comparison.reason
    figures = f"mean {_signed(comparison.mean)} mm, std {comparison.std:.4f} mm at {comparison.nodes} common nodes"
    if comparison.en_rms is None or comparison.en_above_1 is None:
        return f"{figures}; {comparison.reason}"
    return f"{figures}; E_n rms {comparison.en_rms:.2f}, above 1 at {100 * comparison.en_above_1:.1f} % of them"


def _signed(length: float) -> str:
    return number(length, 4, sign=True)
