"""One measurement of an inspection: from the open files of a recipe's table to the map in the common alignment."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from inspect3d.alignment_choice import fitted_to, sensitivity_of
from inspect3d.arrays import Booleans
from inspect3d.compare.features import features_of_nodes, features_of_points
from inspect3d.compare.segmentation import Segmentation
from inspect3d.compare.tolerances import excluded, tolerances
from inspect3d.compare.verdict import verdict
from inspect3d.deviate.deviate import Deviate
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.nodes import DeviateNodes
from inspect3d.measure import Measure, Measurement, NodalMeasurement
from inspect3d.nominal.nominal import Nominal
from inspect3d.nominal.nurbs import Nurbs
from inspect3d.outcome import MeasurementError, Status
from inspect3d.pose import Pose
from inspect3d.progress import Progress
from inspect3d.recipe import Budget, Coating, MeasurementTable, Recipe
from inspect3d.recipe_alignment import Start
from inspect3d.record import MeasuredPart
from inspect3d.register.alignment import Alignment, NoAlignmentError
from inspect3d.register.landmarks import landmark_covariance, similarity_from_landmarks
from inspect3d.register.register import EXACT, Register
from inspect3d.register.similarity import Similarity

REFERENCE = 20.0  # degC at which dimensions hold (ISO 1)
BARE = Coating(thickness=0.0)


@dataclass(frozen=True, eq=False)
class Job:
    """A measurement of the recipe, its method built and its files open."""

    table: MeasurementTable
    method: Measure
    source: Any


def measured(job: Job, recipe: Recipe, nominal: Nominal, progress: Progress) -> MeasuredPart:
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
        ended = replace(
            ended, status=error.status, reason=str(error), candidates=error.candidates, figures=error.figures
        )
    except MeasurementError as error:
        ended = replace(ended, reason=str(error))
    return replace(ended, seconds=dict(progress.seconds[table.name]))


def _registered(measurement: Measurement, table: MeasurementTable, nominal: Nominal) -> tuple[Alignment, ...]:
    start = _start(table.alignment, measurement)
    refine = table.alignment.refined and not table.alignment.locked
    register = Register(nominal, start, refine, table.reach, measurement.scale_known)
    alignments = tuple(register(cloud) for cloud in measurement.clouds)
    if "landmarks" in (table.alignment.start, table.alignment.fit) and not table.alignment.refined:
        cad = np.array([mark.cad for mark in table.alignment.landmarks])
        measured = np.array([mark.measured for mark in table.alignment.landmarks])
        grows = not measurement.scale_known
        return tuple(replace(a, covariance=landmark_covariance(measured, cad, a.origin, grows)) for a in alignments)
    return alignments


def _start(alignment: Start, measurement: Measurement) -> Similarity | None:
    """Return the pose the alignment begins with, or None to search for it."""
    if "landmarks" in (alignment.start, alignment.fit):
        return similarity_from_landmarks(
            np.array([mark.measured for mark in alignment.landmarks]),
            np.array([mark.cad for mark in alignment.landmarks]),
            grows=not measurement.scale_known,
        )
    if alignment.start in ("identity", "pose") and not measurement.scale_known:
        raise MeasurementError(
            f'The points have no scale, and start = "{alignment.start}" gives them none: use "auto" or "landmarks".'
        )
    if alignment.matrix is not None:
        return Similarity(Pose.from_matrix(np.array(alignment.matrix)))
    if alignment.start == "identity" or measurement.frame == "cad":
        return Similarity.identity()
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
    with progress.stage("registering", table.name):
        alignments = _registered(measurement, table, nominal)
    with progress.stage("measuring deviations", table.name):
        deviate = Deviate(
            **_settings(table, recipe, nominal),
            scale_known=measurement.scale_known,
            scale_sigma=measurement.scale_sigma,
        )
        found = deviate(measurement.clouds, alignments, nominal, _counted(recipe, nominal))
    if not found.noise > EXACT * nominal.diagonal:
        raise MeasurementError(
            "The points have no scatter at all, as points of a CAD model have none: nothing tells how sure they are. "
            "State their `noise`."
        )
    return replace(
        _judged(ended, found.deviation, found.alignments, table, recipe, nominal, measurement.scale_known),
        covariance=found.covariance,
        regions=Segmentation()(found.deviation, found.covariance, nominal.mesh),
        features=features_of_points(
            recipe.part.features, nominal.mesh, found.points_cad, found.distance, found.noise, found.alignments[0]
        ),
        points_cad=found.points_cad,
        point_deviation=found.distance,
        noise=found.noise,
        views=found.alignments[0].views(measurement.views),
        remarks=(*measurement.remarks, *found.remarks),
    )


def _settings(table: MeasurementTable, recipe: Recipe, nominal: Nominal) -> dict[str, Any]:
    """Return what a recipe says about the map, whichever way it was measured."""
    coating = table.coating or BARE
    return {
        "refine": table.alignment.refined,
        "fit": fitted_to(table.alignment, nominal.mesh),
        "reach": table.reach,
        "coating": coating.thickness,
        "coating_sigma": coating.sigma,
        "calibration": recipe.report.budget.calibration,
    }


def _of_nodes(
    ended: MeasuredPart,
    measurement: NodalMeasurement,
    table: MeasurementTable,
    recipe: Recipe,
    nominal: Nominal,
    progress: Progress,
) -> MeasuredPart:
    """Return how a measurement that moved the nodes ended: the map is there, and brought into the common alignment."""
    growth = _growth(recipe.report.budget)
    with progress.stage("measuring deviations", table.name):
        deviate = DeviateNodes(
            **_settings(table, recipe, nominal),
            growth=growth,
        )
        found = deviate(measurement, nominal, _counted(recipe, nominal))
    remarks = measurement.remarks
    if growth:
        remarks = (*remarks, _growth_words("The shape was", growth, recipe.report.budget))
    return replace(
        _judged(ended, found.deviation, (found.alignment,), table, recipe, nominal, measurement.scale_known),
        covariance=found.covariance,
        regions=Segmentation()(found.deviation, found.covariance, nominal.mesh),
        features=features_of_nodes(
            recipe.part.features, nominal.mesh, found.deviation, found.covariance, found.alignment
        ),
        views=found.views,
        residual=measurement.residual,
        unresolved=measurement.unresolved,
        hidden=measurement.hidden,
        contributions=measurement.contributions,
        figures=measurement.figures,
        surfaces=_aligned(measurement, found.alignment),
        remarks=remarks,
    )


def _aligned(measurement: NodalMeasurement, alignment: Alignment) -> tuple[Nurbs, ...]:
    """Return the measured surfaces in the common alignment, as the instrument saw them, paint and warmth included."""
    back = measurement.cad_from_measured.inverse()
    return tuple(
        surface.posed(back).posed(alignment.cad_from_measured, alignment.scale) for surface in measurement.surfaces
    )


def _counted(recipe: Recipe, nominal: Nominal) -> Booleans:
    return ~excluded(recipe.part, nominal.mesh.nodes, nominal.mesh.face)


def _judged(
    ended: MeasuredPart,
    deviation: Deviation,
    alignments: tuple[Alignment, ...],
    table: MeasurementTable,
    recipe: Recipe,
    nominal: Nominal,
    scale_known: bool,
) -> MeasuredPart:
    limits = tolerances(recipe.part, nominal.mesh)
    order = list(Status)
    return replace(
        ended,
        status=max((alignment.status for alignment in alignments), key=order.index),
        alignments=alignments,
        deviation=deviation,
        sensitivity=sensitivity_of(table.alignment, deviation, alignments[0], nominal.mesh, scale_known),
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
    clouds = tuple(replace(cloud, points=cloud.points / (1 + growth)) for cloud in measurement.clouds)
    words = _growth_words("The points were", growth, budget)
    return replace(measurement, clouds=clouds, remarks=(*measurement.remarks, words))
