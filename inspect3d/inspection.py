"""An inspection from the recipe to the report: every stage in its order."""

from __future__ import annotations

import hashlib
import os
import platform
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from inspect3d import __version__
from inspect3d.compare.compare import Compare
from inspect3d.compare.comparison import Comparison
from inspect3d.compare.measured_map import MeasuredMap
from inspect3d.compare.tolerances import inside
from inspect3d.job import Job, measured
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.outcome import InputError
from inspect3d.progress import Progress
from inspect3d.recipe import MeasurementTable, Recipe, load_recipe
from inspect3d.record import InputFile, MeasuredPart, Record
from inspect3d.registry import build_for
from inspect3d.results_folder import replaced

LIBRARIES = ("numpy", "scipy", "numba", "open3d", "pyvista", "pymeshlab", "trimesh", "cadquery-ocp-novtk")


def run(recipe_path: Path, out: Path, progress: Progress | None = None) -> Record:
    """Inspect a part and leave the results in a folder.

    The folder is written beside its place and renamed at the end: whatever goes wrong, an earlier one is untouched.

    Parameters
    ----------
    recipe_path : the recipe, a TOML file
    out : the folder of the results; one that is there is replaced
    progress : told what goes on

    Raises
    ------
    InputError
        The recipe or one of its files is wrong, or the folder cannot be written; nothing was measured.
    """
    progress = progress or Progress()
    recipe = load_recipe(recipe_path)
    with replaced(out) as folder:
        record = inspect(recipe, progress)
        from inspect3d.report.write import write_report

        with progress.stage("writing the report"):
            write_report(record, folder, progress)
    return record


def check(recipe_path: Path) -> list[str]:
    """Return what a recipe asks for, a line for each file read, without measuring.

    Raises
    ------
    InputError
        The recipe or one of its files is wrong.
    """
    recipe = load_recipe(recipe_path)
    nominal = nominal_of(recipe)
    lines = [
        f"{recipe.part.name}: {recipe.part.cad}, {len(nominal.mesh)} nodes {nominal.mesh.edge_length:.3g} mm apart"
    ]
    lines += nominal.remarks
    lines += [f"{job.table.name}: {job.source}; {job.method!r}" for job in _jobs(recipe)]
    return [*lines, *_warnings(recipe, nominal), "The recipe and its files are in order."]


def inspect(recipe: Recipe, progress: Progress) -> Record:
    """Return the finished inspection of a recipe; a measurement without an answer says so in its part of the record."""
    with progress.stage("reading the files"):
        jobs = _jobs(recipe)
        inputs = _inputs(recipe)
    with progress.stage("reading the CAD model"):
        nominal = nominal_of(recipe)
    parts = tuple(
        replace(measured(job, recipe, nominal, progress), sources=_sources(recipe, job.table)) for job in jobs
    )
    with progress.stage("comparing the methods"):
        comparisons = compared(parts, nominal.mesh)
    warnings = (*_warnings(recipe, nominal), *_unmeasured(recipe, nominal.mesh, parts))
    return Record(recipe, nominal, parts, inputs, versions(), warnings, comparisons)


def compared(parts: tuple[MeasuredPart, ...], mesh: InspectionMesh) -> tuple[Comparison, ...]:
    """Return the comparisons of every two measurements that have a map."""
    maps = (
        MeasuredMap(part.name, part.deviation, part.covariance, part.sources)
        for part in parts
        if part.deviation is not None and part.covariance is not None
    )
    return Compare()(tuple(maps), mesh)


def _sources(recipe: Recipe, table: MeasurementTable) -> dict[str, str]:
    """Return the names of the files a measurement rests on, by their SHA-256."""
    paths = recipe.files(table).paths
    return {_sha256(path): path.name for key in ("files", "images", "cameras") for path in paths.get(key, ())}


def _jobs(recipe: Recipe) -> list[Job]:
    jobs = []
    for table in recipe.measurements:
        method = build_for(table)
        jobs.append(Job(table, method, method.open(recipe.files(table))))
    return jobs


def nominal_of(recipe: Recipe) -> Nominal:
    """Return the part of a recipe, its surface and its inspection mesh."""
    part = recipe.part
    nominal = load_nominal(recipe.cad, name=part.name, units=part.units, element_size=part.element_size, flip=part.flip)
    _require_faces(recipe, nominal)
    return nominal


def _require_faces(recipe: Recipe, nominal: Nominal) -> None:
    """Refuse numbers of faces that the CAD model does not have."""
    there = set(np.unique(nominal.mesh.face if nominal.surface_face is None else nominal.surface_face).tolist()) - {-1}
    named = [("part.regions", recipe.part.regions), ("part.exclude", recipe.part.exclude)]
    named.append(("part.features", tuple(feature.place for feature in recipe.part.features)))
    named += [(f"measurements[{table.name!r}].alignment.datum", table.alignment.datum) for table in recipe.measurements]
    for key, regions in named:
        missing = sorted({face for region in regions for face in region.faces or ()} - there)
        if missing:
            have = f"its faces are 0 to {max(there)}" if there else "it has no faces by number, use boxes"
            raise InputError(f"{recipe.source.name}: {key}: {recipe.part.cad} has no face {missing[0]}; {have}.")


def _warnings(recipe: Recipe, nominal: Nominal) -> tuple[str, ...]:
    warnings = []
    for k, plane in enumerate(recipe.report.sections):
        height = (nominal.mesh.nodes - plane.point) @ np.array(plane.normal)
        if not height.min() <= 0 <= height.max():
            warnings.append(f"The plane of report.sections[{k}] does not meet the part, so there is no profile of it.")
    for feature in recipe.part.features:
        if not inside(feature.place, nominal.mesh.nodes, nominal.mesh.face).any():
            warnings.append(
                f"No node of the part lies in the place marked for the feature {feature.name!r}: it may lie beside it."
            )
    return tuple(warnings)


def _unmeasured(recipe: Recipe, mesh: InspectionMesh, parts: tuple[MeasuredPart, ...]) -> tuple[str, ...]:
    """Return which methods observed nothing where a feature is marked on the part, a sentence for each feature."""
    warnings = []
    for feature in recipe.part.features:
        marked = inside(feature.place, mesh.nodes, mesh.face)
        blind = [part.name for part in parts if part.deviation and not part.deviation.observed[marked].any()]
        if blind and marked.any():
            warnings.append(
                f"{' and '.join(blind)} observed no node in the place marked for the feature {feature.name!r}."
            )
    return tuple(warnings)


def _inputs(recipe: Recipe) -> tuple[InputFile, ...]:
    files = [recipe.source, recipe.cad]
    for table in recipe.measurements:
        files += [path for paths in recipe.files(table).paths.values() for path in paths]
    unique = dict.fromkeys(path.resolve() for path in files)
    folder = recipe.folder.resolve()
    return tuple(InputFile(Path(os.path.relpath(path, folder)).as_posix(), _sha256(path)) for path in unique)


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def versions() -> dict[str, str]:
    """Return the versions of inspect3d, of Python and of the libraries that compute the results."""
    libraries = {name: version(name) for name in LIBRARIES}
    return {"inspect3d": __version__, "python": platform.python_version(), **libraries}
