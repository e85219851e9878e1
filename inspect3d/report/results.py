"""The inspection as numbers: what `results.json` holds."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from inspect3d.camera import View
from inspect3d.compare.comparison import Comparison
from inspect3d.compare.deviation_region import DeviationRegion
from inspect3d.compare.feature_estimate import FeatureEstimate
from inspect3d.compare.sensitivity import Sensitivity
from inspect3d.compare.tolerances import tolerances
from inspect3d.deviate.statistics import Statistics, percentiles
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.record import MeasuredPart, Record
from inspect3d.register.alignment import Alignment, Candidate
from inspect3d.report.reading import Reading, readings

SCHEMA = 1
FIGURES = ("mean", "std", "rms", "min", "max", "p05", "p50", "p95")
VERDICTS = ("conform", "undecided", "nonconform")


def results(record: Record) -> dict[str, Any]:
    """Return the inspection as plain lists, numbers and strings; lengths in mm, angles in rad, sigmas at k = 1.

    The figures are given in full; rounding belongs to the report. What is not known is None.
    """
    mesh = record.nominal.mesh
    return {
        "schema": SCHEMA,
        "part": _part(record),
        "versions": dict(record.versions),
        "inputs": [{"path": file.path, "sha256": file.sha256} for file in record.inputs],
        "warnings": list(record.warnings),
        "recipe": record.recipe.model_dump(mode="json", by_alias=True, exclude_defaults=True),
        "measurements": {part.name: _measurement(record, mesh, part) for part in record.parts},
        "comparisons": [_comparison(each) for each in record.comparisons],
    }


def as_json(values: Mapping[str, Any]) -> str:
    """Return readable JSON, the same text for the same values; NaN and infinity, which JSON lacks, become null.

    A list of numbers stays on one line, so that a matrix looks like one.
    """
    return _text(_plain(values), "") + "\n"


def verdict_shares(record: Record, part: MeasuredPart) -> dict[str, float] | None:
    """Return the shares of the area that conform, are undecided, do not conform or were not measured; their sum is 1.

    The area is that of the nodes for which there is a tolerance. Creases have no deviation and count as not measured.
    None where the measurement was not judged.
    """
    mesh, limits = record.nominal.mesh, tolerances(record.recipe.part, record.nominal.mesh)
    if part.deviation is None or part.verdict is None or limits is None:
        return None
    areas = np.where(np.isnan(limits).any(axis=1), 0.0, mesh.areas)
    if not areas.sum() > 0:
        return None
    verdict = np.where(part.deviation.observed, part.verdict, 0)
    kinds = (*VERDICTS, "unmeasured")
    return {name: float(areas[verdict == k % 4].sum() / areas.sum()) for k, name in enumerate(kinds, start=1)}


def _part(record: Record) -> dict[str, Any]:
    table, mesh = record.recipe.part, record.nominal.mesh
    return {
        "name": table.name,
        "cad": table.cad,
        "tolerance": list(table.tolerance) if table.tolerance else None,
        "probability": table.probability,
        "nodes": len(mesh),
        "triangles": len(mesh.triangles),
        "edge_length": mesh.edge_length,
        "area": float(mesh.areas.sum()),
        "bounds": [mesh.nodes.min(axis=0).tolist(), mesh.nodes.max(axis=0).tolist()],
        "remarks": list(record.nominal.remarks),
    }


def _measurement(record: Record, mesh: InspectionMesh, part: MeasuredPart) -> dict[str, Any]:
    has_map = part.status.has_map and part.deviation is not None
    return {
        "method": part.method,
        "provenance": part.provenance,
        "status": part.status.value,
        "reason": part.reason,
        "alignment": _alignment(part) if has_map else _no_alignment(part),
        "deviation": _deviation(mesh, part) if has_map else None,
        "verdict": verdict_shares(record, part) if has_map else None,
        "labels": [_label(reading) for reading in readings(mesh, part, record.recipe.report.labels)],
        "noise": part.noise,
        "regions": [_region(region) for region in part.regions],
        "features": [_feature(feature) for feature in part.features],
        "unresolved": _unresolved(mesh, part) if has_map else None,
        "sensitivity": _sensitivity(part.sensitivity) if part.sensitivity else None,
        "hidden": list(part.hidden),
        "contributions": [list(each) for each in part.contributions],
        "cameras": [_camera(view) for view in part.views],
        "remarks": list(part.remarks),
        "seconds": {stage: float(seconds) for stage, seconds in part.seconds.items()},
    }


def _camera(view: View) -> dict[str, Any]:
    return {
        "matrix": view.camera.matrix.tolist(),
        "distortion": view.camera.distortion.tolist(),
        "size": list(view.camera.size),
        "camera_from_cad": view.camera_from_cad.matrix.tolist(),
    }


def _alignment(part: MeasuredPart) -> dict[str, Any] | None:
    if not part.alignments:
        return None
    each = [_one_alignment(alignment) for alignment in part.alignments]
    return each[0] | ({"files": each} if len(each) > 1 else {})


def _one_alignment(alignment: Alignment) -> dict[str, Any]:
    return {
        "matrix": alignment.cad_from_measured.matrix.tolist(),
        "scale": float(alignment.scale),
        "residual": float(alignment.residual),
        "covariance": alignment.covariance.tolist(),
        "covariance_origin": alignment.origin.tolist(),
        "free": [{"words": free.words, "direction": np.asarray(free.direction).tolist()} for free in alignment.free],
        "candidates": [_candidate(candidate) for candidate in alignment.candidates],
        "used": alignment.count,
    }


def _no_alignment(part: MeasuredPart) -> dict[str, Any]:
    none = dict.fromkeys(("matrix", "scale", "residual", "covariance", "covariance_origin"))
    return none | {"free": [], "candidates": [_candidate(each) for each in candidates(part)], "used": None}


def candidates(part: MeasuredPart) -> tuple[Candidate, ...]:
    """Return the poses that were considered, best first."""
    if part.candidates:
        return part.candidates
    return part.alignments[0].candidates if part.alignments else ()


def _sensitivity(found: Sensitivity) -> dict[str, Any]:
    return {
        "chosen": found.chosen,
        "others": [
            {
                "alignment": other.words,
                "motion": other.motion.tolist(),
                "origin": other.origin.tolist(),
                "largest_shift": float(np.abs(other.shift).max()),
            }
            for other in found.others
        ],
        "remarks": list(found.remarks),
    }


def _candidate(candidate: Candidate) -> dict[str, Any]:
    return {
        "matrix": candidate.pose.matrix.tolist(),
        "scale": float(candidate.scale),
        "residual": float(candidate.residual),
    }


def _deviation(mesh: InspectionMesh, part: MeasuredPart) -> dict[str, Any] | None:
    if part.deviation is None:
        return None
    observed = part.deviation.observed
    areas = mesh.areas[observed]
    counts = {"nodes": len(mesh), "observed": int(observed.sum())}
    if not areas.sum() > 0:
        return counts | dict.fromkeys((*FIGURES, "sigma_p50", "sigma_p95")) | {"observed_area": 0.0}
    figures = asdict(Statistics.of(part.deviation.value[observed], areas))
    median, high = percentiles(part.deviation.sigma[observed], areas, (50.0, 95.0))
    return (
        counts
        | {name: figures[name] for name in FIGURES}
        | {"sigma_p50": float(median), "sigma_p95": float(high)}
        | {"observed_area": float(areas.sum() / mesh.areas.sum())}
    )


def _unresolved(mesh: InspectionMesh, part: MeasuredPart) -> dict[str, Any] | None:
    """Return where the method does not follow the shape of the part; None where it does not look for that."""
    if part.deviation is None or part.unresolved is None:
        return None
    observed = part.deviation.observed
    flagged = observed & part.unresolved
    area = mesh.areas[observed].sum()
    share = float(mesh.areas[flagged].sum() / area) if area > 0 else None
    return {"nodes": int(flagged.sum()), "share_of_observed_area": share}


def _comparison(comparison: Comparison) -> dict[str, Any]:
    limits = comparison.limits_of_agreement
    return {
        "a": comparison.a,
        "b": comparison.b,
        "nodes": comparison.nodes,
        "mean": comparison.mean,
        "std": comparison.std,
        "limits_of_agreement": list(limits) if limits else None,
        "en_rms": comparison.en_rms,
        "en_above_1": comparison.en_above_1,
        "reason": comparison.reason,
        "correlation": comparison.correlation,
        "coverage": {"a": comparison.coverage_a, "b": comparison.coverage_b, "both": comparison.coverage},
        "regions": None if comparison.regions is None else [_region(region) for region in comparison.regions],
        "gauge": comparison.gauge,
        "words": list(comparison.words),
    }


def _region(region: DeviationRegion) -> dict[str, Any]:
    return {
        "nodes": len(region.nodes),
        "area": region.area,
        "place": region.place.tolist(),
        "height": region.height,
        "mean": region.mean,
        "sigma": region.sigma,
        "p_value": region.p_value,
    }


def _feature(feature: FeatureEstimate) -> dict[str, Any]:
    return asdict(feature) | {"resolved": feature.resolved}


def _label(reading: Reading) -> dict[str, Any]:
    return {
        "name": reading.name,
        "point": reading.asked.tolist(),
        "node": reading.node,
        "deviation": reading.value,
        "sigma": reading.sigma,
    }


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _text(value: Any, indent: str) -> str:
    deeper = indent + "  "
    if isinstance(value, dict) and value:
        lines = [f"{deeper}{json.dumps(key, ensure_ascii=False)}: {_text(each, deeper)}" for key, each in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(each, dict | list | str) for each in value):
        return "[\n" + ",\n".join(deeper + _text(each, deeper) for each in value) + f"\n{indent}]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
