"""Inspections that were run separately, brought together into one comparison and one report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from inspect3d.camera import Camera, View
from inspect3d.compare.feature_estimate import FeatureEstimate
from inspect3d.compare.segmentation import Segmentation
from inspect3d.compare.sensitivity import OtherAlignment, Sensitivity
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.errors_file import read_errors
from inspect3d.inspection import compared, versions
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.surface import Surface
from inspect3d.outcome import InputError, Status
from inspect3d.pose import Pose
from inspect3d.progress import Progress
from inspect3d.recipe import MeasurementTable, Recipe
from inspect3d.record import InputFile, MeasuredPart, Record
from inspect3d.register.alignment import Alignment, Candidate, FreeMotion
from inspect3d.report.finished import Finished, FinishedMap, open_results
from inspect3d.results_folder import replaced

JUDGED = {"tolerance", "probability", "regions", "exclude"}  # the keys of the part that decide the verdicts
SAME = 1e-6  # mm within which the nodes of two inspection meshes are the same


@dataclass(frozen=True, eq=False)
class _Run:
    """A finished inspection that takes part: its measurements by the names they have in the comparison."""

    finished: Finished
    recipe: Recipe
    parts: tuple[MeasuredPart, ...]
    tables: tuple[MeasurementTable, ...]
    mesh: InspectionMesh | None


def compare_runs(folders: Sequence[Path], out: Path, progress: Progress | None = None) -> Record:
    """Compare the maps of finished inspections and leave one report of all of them.

    The part, its tolerance and what the report shows are those of the first.

    Parameters
    ----------
    folders : what `inspect3d run` wrote, each with one measurement or more
    out : the folder of the results; one that is there is replaced
    progress : told what goes on

    Raises
    ------
    InputError
        A folder holds no inspection, no measurement in it has a map, or their inspection meshes differ.
    """
    progress = progress or Progress()
    with replaced(out) as folder:
        with progress.stage("reading the inspections"):
            record = joined(folders)
        if sum(part.deviation is not None for part in record.parts) < 2:
            raise InputError("These inspections hold 1 map: a comparison needs two.")
        from inspect3d.report.write import write_report

        with progress.stage("writing the report"):
            write_report(record, folder, progress)
    return record


def joined(folders: Sequence[Path]) -> Record:
    """Return finished inspections as one, their maps compared; see `compare_runs`.

    Raises
    ------
    InputError
        A folder holds no inspection, none has a map, or they are of different parts or meshes.
    """
    finished = [open_results(folder) for folder in folders]
    names = _names(finished)
    runs = [_run(each, own) for each, own in zip(finished, names, strict=True)]
    meshes = [(run, run.mesh) for run in runs if run.mesh is not None]
    if not meshes:
        raise InputError("No measurement of these inspections has a map: their reports say why.")
    first, mesh = meshes[0]
    for run, other in meshes[1:]:
        _require_same(first.finished.folder, mesh, run.finished.folder, other)
    parts = tuple(part for run in runs for part in run.parts)
    tables = tuple(table for run in runs for table in run.tables)
    recipe = first.recipe.model_copy(update={"measurements": tables})
    nominal = Nominal(recipe.part.name, Surface(mesh.nodes, mesh.triangles), mesh)
    inputs = tuple(
        InputFile(f"{run.finished.folder.name}: {file['path']}", file["sha256"])
        for run in runs
        for file in run.finished.values["inputs"]
    )
    return Record(recipe, nominal, parts, inputs, versions(), _warnings(first, runs), compared(parts, mesh))


def _names(finished: Sequence[Finished]) -> list[dict[str, str]]:
    """Return for each inspection what its measurements are called in the comparison: a name taken twice says where."""
    every = [name.casefold() for each in finished for name in each.values["measurements"]]
    found: list[dict[str, str]] = []
    taken: set[str] = set()
    for each in finished:
        own = {}
        for name in each.values["measurements"]:
            plain = name if every.count(name.casefold()) == 1 else f"{name} {each.folder.resolve().name}"
            called, k = plain, 2
            while called.casefold() in taken:
                called, k = f"{plain} {k}", k + 1
            taken.add(called.casefold())
            own[name] = called
        found.append(own)
    return found


def _run(finished: Finished, names: Mapping[str, str]) -> _Run:
    try:
        recipe = Recipe.model_validate(finished.values["recipe"])
        mesh, parts = None, []
        for name, values in finished.values["measurements"].items():
            part = _part(values, names[name])
            if name in finished.with_map:
                found = finished.map(name)
                errors = read_errors(finished.folder / f"{name}_errors.npz")
                mesh = replace(found.mesh, face=errors.face)
                part = replace(part, covariance=errors.covariance, sources=errors.sources, **_map(found))
                if values["sensitivity"] is not None:
                    part = replace(part, sensitivity=_sensitivity(values["sensitivity"], part.alignments[0], mesh))
                if part.deviation is not None:
                    part = replace(part, regions=Segmentation()(part.deviation, errors.covariance, mesh))
                part = replace(part, **_points(finished.folder / f"{name}_points.vtp"))
            parts.append(part)
    except (KeyError, TypeError, ValidationError, ValueError) as error:
        raise InputError(
            f"{finished.folder} holds an inspection of another version of inspect3d: run it again."
        ) from error
    tables = (table.model_copy(update={"name": names[table.name]}) for table in recipe.measurements)
    return _Run(finished, recipe, tuple(parts), tuple(tables), mesh)


def _part(values: Mapping[str, Any], name: str) -> MeasuredPart:
    """Return how a measurement ended, without its map."""
    alignment = values["alignment"] or {}
    placed = alignment.get("matrix") is not None
    return MeasuredPart(
        name=name,
        method=values["method"],
        provenance=values["provenance"],
        status=Status(values["status"]),
        reason=values["reason"],
        seconds=values["seconds"],
        alignments=tuple(map(_alignment, alignment.get("files", [alignment]))) if placed else (),
        candidates=() if placed else tuple(map(_candidate, alignment.get("candidates", ()))),
        noise=values["noise"],
        views=tuple(map(_view, values["cameras"])),
        hidden=tuple(values["hidden"]),
        features=tuple(map(_feature, values["features"])),
        contributions=tuple((source, size, words) for source, size, words in values["contributions"]),
        remarks=tuple(values["remarks"]),
    )


def _map(found: FinishedMap) -> dict[str, Any]:
    """Return what a saved map adds to how its measurement ended."""
    observed, verdict = found.field("observed") > 0, found.field("verdict").astype(np.int64)
    return {
        "deviation": Deviation(found.field("deviation"), found.field("sigma"), observed),
        "verdict": verdict if verdict.any() else None,
        "residual": found.fields.get("residual"),
    }


def _sensitivity(values: Mapping[str, Any], alignment: Alignment, mesh: InspectionMesh) -> Sensitivity:
    """Return how much a map depends on its alignment, from the small motions to the other choices."""
    others = tuple(
        OtherAlignment.of(other["alignment"], np.array(other["motion"]), np.array(other["origin"]), mesh)
        for other in values["others"]
    )
    return Sensitivity.of(values["chosen"], others, alignment, mesh, tuple(values["remarks"]))


def _points(file: Path) -> dict[str, Any]:
    """Return what the saved points of a cloud add; nothing for methods without."""
    if not file.is_file():
        return {}
    import pyvista

    polydata = pyvista.read(file)
    return {
        "points_cad": np.asarray(polydata.points, dtype=np.float64),
        "point_deviation": np.asarray(polydata.point_data["deviation"], dtype=np.float64),
    }


def _alignment(values: Mapping[str, Any]) -> Alignment:
    return Alignment(
        cad_from_measured=Pose.from_matrix(np.array(values["matrix"])),
        scale=values["scale"],
        residual=values["residual"],
        covariance=np.array(values["covariance"]),
        origin=np.array(values["covariance_origin"]),
        used=np.ones(values["used"], bool),
        free=tuple(FreeMotion(free["words"], np.array(free["direction"])) for free in values["free"]),
        candidates=tuple(map(_candidate, values["candidates"])),
    )


def _feature(values: Mapping[str, Any]) -> FeatureEstimate:
    return FeatureEstimate(**{key: value for key, value in values.items() if key != "resolved"})


def _candidate(values: Mapping[str, Any]) -> Candidate:
    return Candidate(Pose.from_matrix(np.array(values["matrix"])), values["scale"], values["residual"])


def _view(values: Mapping[str, Any]) -> View:
    width, height = values["size"]
    camera = Camera(np.array(values["matrix"]), np.array(values["distortion"]), (width, height))
    return View(camera, Pose.from_matrix(np.array(values["camera_from_cad"])))


def _require_same(first: Path, mesh: InspectionMesh, second: Path, other: InspectionMesh) -> None:
    same = mesh.nodes.shape == other.nodes.shape and np.array_equal(mesh.triangles, other.triangles)
    if not (same and np.abs(mesh.nodes - other.nodes).max() <= SAME):
        raise InputError(
            f"{first} and {second} have different inspection meshes ({len(mesh)} and {len(other)} nodes): run both "
            "with the same cad and the same element_size."
        )


def _warnings(first: _Run, runs: Sequence[_Run]) -> tuple[str, ...]:
    warnings = [warning for run in runs for warning in run.finished.values["warnings"]]
    for run in runs:
        if run.recipe.part.model_dump(include=JUDGED) != first.recipe.part.model_dump(include=JUDGED):
            warnings.append(
                f"{run.finished.folder.name} was judged by other tolerances than {first.finished.folder.name}; its "
                "verdicts are those of its own run, the words about them those of the first."
            )
    return tuple(dict.fromkeys(warnings))
