"""An inspection from the recipe to the report: every stage in its order."""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from inspect3d import __version__
from inspect3d.arrays import Booleans
from inspect3d.compare.tolerances import excluded, tolerances
from inspect3d.compare.verdict import verdict
from inspect3d.deviate.deviate import Deviate
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.nodes import DeviateNodes
from inspect3d.measure import Cloud, Measure, Measurement, NodalMeasurement
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import InputError, MeasurementError, Status
from inspect3d.pose import Pose
from inspect3d.progress import Progress
from inspect3d.recipe import Budget, Coating, MeasurementTable, Recipe, Start, load_recipe
from inspect3d.record import InputFile, MeasuredPart, Record
from inspect3d.register.alignment import Alignment, NoAlignmentError
from inspect3d.register.landmarks import landmark_covariance, pose_from_landmarks
from inspect3d.register.register import Register
from inspect3d.registry import build_for

REFERENCE = 20.0  # degC at which dimensions hold (ISO 1)
BARE = Coating(thickness=0.0)
LIBRARIES = ("numpy", "scipy", "numba", "open3d", "pyvista", "pymeshlab", "trimesh", "cadquery-ocp-novtk")


@dataclass(frozen=True, eq=False)
class Job:
    """A measurement of the recipe, its method built and its files open."""

    table: MeasurementTable
    method: Measure
    source: Any


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
    with _replaced(out) as folder:
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
    nominal = _nominal(recipe)
    lines = [
        f"{recipe.part.name}: {recipe.part.cad}, {len(nominal.mesh)} nodes {nominal.mesh.edge_length:.3g} mm apart"
    ]
    lines += nominal.remarks
    lines += [f"{job.table.name}: {job.source}; {job.method!r}" for job in _jobs(recipe)]
    return [*lines, *_warnings(recipe), "The recipe and its files are in order."]


def inspect(recipe: Recipe, progress: Progress) -> Record:
    """Return the finished inspection of a recipe; a measurement without an answer says so in its part of the record."""
    with progress.stage("reading the files"):
        jobs = _jobs(recipe)
        inputs = _inputs(recipe)
    with progress.stage("reading the CAD model"):
        nominal = _nominal(recipe)
    parts = tuple(_measured(job, recipe, nominal, progress) for job in jobs)
    return Record(recipe, nominal, parts, inputs, _versions(), _warnings(recipe))


def _jobs(recipe: Recipe) -> list[Job]:
    jobs = []
    for table in recipe.measurements:
        method = build_for(table)
        jobs.append(Job(table, method, method.open(recipe.files(table))))
    return jobs


def _nominal(recipe: Recipe) -> Nominal:
    part = recipe.part
    return load_nominal(recipe.cad, name=part.name, units=part.units, element_size=part.element_size, flip=part.flip)


def _measured(job: Job, recipe: Recipe, nominal: Nominal, progress: Progress) -> MeasuredPart:
    """Return how a measurement ended."""
    table = job.table
    ended = MeasuredPart(table.name, table.method, repr(job.method), Status.FAILED)
    try:
        with progress.stage("measuring", table.name):
            measurement = job.method(job.source, nominal)
        if isinstance(measurement, NodalMeasurement):
            ended = _of_nodes(ended, measurement, table, recipe, nominal, progress)
        else:
            ended = _of_clouds(ended, measurement, table, recipe, nominal, progress)
    except NoAlignmentError as error:
        ended = replace(ended, status=error.status, reason=str(error), candidates=error.candidates)
    except MeasurementError as error:
        ended = replace(ended, reason=str(error))
    return replace(ended, seconds=dict(progress.seconds[table.name]))


def _registered(measurement: Measurement, table: MeasurementTable, nominal: Nominal) -> tuple[Alignment, ...]:
    start = _start(table.alignment, measurement)
    register = Register(nominal, start, table.alignment.refine, table.reach)
    alignments = tuple(register(cloud) for cloud in measurement.clouds)
    if table.alignment.start == "landmarks" and not table.alignment.refine:
        cad = np.array([mark.cad for mark in table.alignment.landmarks])
        measured = np.array([mark.measured for mark in table.alignment.landmarks])
        return tuple(replace(a, covariance=landmark_covariance(measured, cad, a.origin)) for a in alignments)
    return alignments


def _start(alignment: Start, measurement: Measurement) -> Pose | None:
    """Return the pose the alignment begins with, or None to search for it."""
    if alignment.start == "landmarks":
        return pose_from_landmarks(
            np.array([mark.measured for mark in alignment.landmarks]),
            np.array([mark.cad for mark in alignment.landmarks]),
        )
    if alignment.matrix is not None:
        return Pose.from_matrix(np.array(alignment.matrix))
    if alignment.start == "identity" or measurement.frame == "cad":
        return Pose.identity()
    return None


def _of_clouds(
    ended: MeasuredPart,
    measurement: Measurement,
    table: MeasurementTable,
    recipe: Recipe,
    nominal: Nominal,
    progress: Progress,
) -> MeasuredPart:
    """Return how a measurement of points ended: they are registered, and the map is fitted to them."""
    measurement = _at_reference_temperature(measurement, recipe.report.budget)
    coating = table.coating or BARE
    with progress.stage("registering", table.name):
        alignments = _registered(measurement, table, nominal)
    with progress.stage("measuring deviations", table.name):
        deviate = Deviate(
            refine=table.alignment.refine,
            reach=table.reach,
            coating=coating.thickness,
            coating_sigma=coating.sigma,
            calibration=recipe.report.budget.calibration,
        )
        found = deviate(measurement.clouds, alignments, nominal, _counted(recipe, nominal))
    return replace(
        _judged(ended, found.deviation, found.alignments, recipe, nominal),
        points_cad=found.points_cad,
        point_deviation=found.distance,
        noise=found.noise,
        remarks=(*measurement.remarks, *found.remarks),
    )


def _of_nodes(
    ended: MeasuredPart,
    measurement: NodalMeasurement,
    table: MeasurementTable,
    recipe: Recipe,
    nominal: Nominal,
    progress: Progress,
) -> MeasuredPart:
    """Return how a measurement that moved the nodes ended: the map is there, and brought into the common alignment."""
    growth, coating = _growth(recipe.report.budget), table.coating or BARE
    with progress.stage("measuring deviations", table.name):
        deviate = DeviateNodes(
            refine=table.alignment.refine,
            reach=table.reach,
            coating=coating.thickness,
            coating_sigma=coating.sigma,
            calibration=recipe.report.budget.calibration,
            growth=growth,
        )
        found = deviate(measurement, nominal, _counted(recipe, nominal))
    remarks = measurement.remarks
    if growth:
        remarks = (*remarks, _growth_words("The shape was", growth, recipe.report.budget))
    return replace(
        _judged(ended, found.deviation, (found.alignment,), recipe, nominal),
        views=found.views,
        residual=measurement.residual,
        hidden=measurement.hidden,
        contributions=measurement.contributions,
        figures=measurement.figures,
        remarks=remarks,
    )


def _counted(recipe: Recipe, nominal: Nominal) -> Booleans:
    return ~excluded(recipe.part, nominal.mesh.nodes, nominal.mesh.face)


def _judged(
    ended: MeasuredPart,
    deviation: Deviation,
    alignments: tuple[Alignment, ...],
    recipe: Recipe,
    nominal: Nominal,
) -> MeasuredPart:
    limits = tolerances(recipe.part, nominal.mesh)
    order = list(Status)
    return replace(
        ended,
        status=max((alignment.status for alignment in alignments), key=order.index),
        alignments=alignments,
        deviation=deviation,
        verdict=None if limits is None else verdict(deviation, limits, recipe.part.probability),
    )


def _growth(budget: Budget) -> float:
    """Return by which share of its size the part was larger than at 20 degC."""
    return budget.expansion * (budget.temperature - REFERENCE)


def _growth_words(what: str, growth: float, budget: Budget) -> str:
    return (
        f"{what} scaled by {1 / (1 + growth):.7f} from {budget.temperature:g} °C to the reference temperature of "
        f"{REFERENCE:g} °C (expansion {budget.expansion:g} 1/K)."
    )


def _at_reference_temperature(measurement: Measurement, budget: Budget) -> Measurement:
    """Return the measurement as it would be at 20 degC: the points shrunk by the thermal expansion of the part."""
    growth = _growth(budget)
    if growth == 0:
        return measurement
    clouds = tuple(
        Cloud(cloud.name, cloud.points / (1 + growth), cloud.normals, cloud.noise) for cloud in measurement.clouds
    )
    words = _growth_words("The points were", growth, budget)
    return replace(measurement, clouds=clouds, remarks=(*measurement.remarks, words))


def _warnings(recipe: Recipe) -> tuple[str, ...]:
    report = recipe.report
    warnings = []
    if "pdf" in report.formats:
        warnings.append(
            "The recipe asks for a PDF: this version writes the report as HTML only; print it from a browser."
        )
    if report.sections:
        warnings.append("The recipe asks for sections: this version does not draw them.")
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


def _versions() -> dict[str, str]:
    libraries = {name: version(name) for name in LIBRARIES}
    return {"inspect3d": __version__, "python": platform.python_version(), **libraries}


@contextmanager
def _replaced(out: Path) -> Iterator[Path]:
    """Give a new folder beside `out` to write into, and put it in the place of `out` once the block has ended well."""
    out = Path(os.path.abspath(out))
    if out.exists() and not _may_be_replaced(out):
        raise InputError(f"{out} is not a folder of results: choose another one, or remove it yourself.")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror}. Choose another folder.") from error
    try:
        folder.chmod(0o755)
        yield folder
        if out.exists():
            former = folder.with_name(folder.name + "-former")
            out.rename(former)
            folder.rename(out)
            shutil.rmtree(former)
        else:
            folder.rename(out)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _may_be_replaced(out: Path) -> bool:
    """Tell whether `out` is a folder that is empty or holds the results of an earlier run."""
    return out.is_dir() and (not any(out.iterdir()) or (out / "results.json").is_file())
