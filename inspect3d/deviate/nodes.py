"""Stage 4 for methods that move the nodes: their deviations in the common alignment."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.camera import View
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.map_covariance import MapCovariance, Selected, variances_without
from inspect3d.measure import NodalMeasurement
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import MeasurementError, Status
from inspect3d.pose import Pose
from inspect3d.register.alignment import Alignment
from inspect3d.register.fit import Fit
from inspect3d.register.gauge import Gauge
from inspect3d.register.icp import TUKEY, median_and_scale
from inspect3d.register.mobility import named

LEAST_NODES = 12
BLOCKS = 3.0  # blocks of the pose covariance along the spread of the nodes


@dataclass(frozen=True, eq=False)
class NodalDeviation:
    """What moved nodes say about a part.

    Parameters
    ----------
    deviation : the map on the inspection mesh
    covariance : how its errors hang together
    alignment : cad_from_measured, with the motion and the scale of the common alignment in it
    views : the cameras in the CAD frame, moved along
    """

    deviation: Deviation
    covariance: MapCovariance
    alignment: Alignment
    views: tuple[View, ...]


@dataclass(frozen=True)
class DeviateNodes:
    """Bring the deviations of moved nodes into the common alignment.

    That is the robust best fit of the map, G v, with the growth of the part taken out where the method cannot tell the
    scale; the covariance becomes G S G'. What all nodes share is added.

    Parameters
    ----------
    fit : what the common alignment is fitted to
    refine : False leaves the method's own frame, which must then be the CAD's
    reach : mm, a node that moved farther is not observed
    coating : mm, thickness of paint, subtracted
    coating_sigma, calibration : mm, standard uncertainties that all nodes share
    growth : relative, by which the part was larger when it was measured than at the reference temperature
    """

    fit: Fit = field(default_factory=Fit)
    refine: bool = True
    reach: float | None = None
    coating: float = 0.0
    coating_sigma: float = 0.0
    calibration: float = 0.0
    growth: float = 0.0

    def __call__(self, measured: NodalMeasurement, nominal: Nominal, counted: Booleans) -> NodalDeviation:
        """Return the deviation of the nodes.

        Parameters
        ----------
        counted : (n,), the nodes that the recipe does not exclude

        Raises
        ------
        MeasurementError
            Too few nodes were observed, or the frame of the CAD is asked for and was never known.
        """
        if not (self.refine or measured.placed):
            raise MeasurementError(
                "With refine = false the place of the part must be known, and here the pictures themselves gave it: "
                "name `cameras` with their camera_from_cad, or leave refine away."
            )
        mesh = nominal.mesh
        seen = measured.sound & counted[measured.node] & ~mesh.crease[measured.node]
        value = measured.value - self.coating
        if self.growth and measured.scale_known:
            places = mesh.nodes[measured.node] + measured.value[:, None] * mesh.normals[measured.node]
            value = value - self.growth / (1 + self.growth) * (places * mesh.normals[measured.node]).sum(axis=1)
        if self.reach:
            seen &= np.abs(value) <= self.reach
        if np.count_nonzero(seen) < LEAST_NODES:
            raise MeasurementError(
                f"Only {np.count_nonzero(seen)} of {len(mesh)} nodes could be observed: the cameras see too little of "
                "the part, or its speckle is too poor for this element_size."
            )
        node = measured.node[seen]
        gauge = self.fit(mesh, node, value[seen], not measured.scale_known)
        modes = gauge.jacobian if self.refine else np.zeros((len(node), 0))
        solver = gauge.solver if self.refine else np.zeros((0, len(node)))
        motion = gauge.motion(value[seen]) if self.refine else np.zeros(gauge.jacobian.shape[1])
        shared = np.full(len(node), self.coating_sigma)
        shared = shared - modes @ (solver @ shared)
        covariance = MapCovariance(
            node=node,
            own=Selected(measured.uncertainty, np.flatnonzero(seen)),
            pose=np.zeros((len(node), 0)),
            coating=(self.coating, self.coating_sigma),
            calibration=self.calibration,
            refined=self.refine,
            scale_known=measured.scale_known,
            weak=measured.weak[seen],
        )
        variance = variances_without(covariance.own, modes, solver) + shared**2
        variance = variance + self.calibration**2 + nominal.chord**2 / 3
        found = value[seen] + gauge.jacobian @ motion
        deviation = _spread(found, np.sqrt(variance), node, len(mesh))
        placed = _alignment(measured, gauge, motion, found, self.refine)
        return NodalDeviation(deviation, covariance, placed, _moved(measured.views, gauge, motion))


def _spread(value: Floats, sigma: Floats, node: Integers, n: int) -> Deviation:
    values, sigmas, observed = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, bool)
    values[node], sigmas[node], observed[node] = value, sigma, True
    return Deviation(values, sigmas, observed)


def _alignment(measured: NodalMeasurement, gauge: Gauge, motion: Floats, found: Floats, refine: bool) -> Alignment:
    middle, scale = median_and_scale(found)
    growth = float(motion[6]) if gauge.growth else 0.0
    before = measured.cad_from_measured
    moved = Pose.small(motion[:6], gauge.origin)
    shift = moved(((1 + growth) * (before.translation - gauge.origin) + gauge.origin)[None])[0]
    free = named(gauge.free, gauge.origin, gauge.length) if refine else ()
    whole = Status.SYMMETRIC if measured.symmetric else Status.OK
    covariance = np.zeros((6, 6))
    if refine:
        covariance = gauge.covariance(found, gauge.length / BLOCKS)[:6, :6]
    return Alignment(
        cad_from_measured=Pose(moved.rotation @ before.rotation, shift),
        scale=1 + growth,
        residual=scale,
        covariance=covariance,
        origin=gauge.origin,
        used=np.abs(found - middle) < TUKEY * max(scale, 1e-12),
        status=Status.FREE_MOTIONS if free else whole,
        free=free,
    )


def _moved(views: tuple[View, ...], gauge: Gauge, motion: Floats) -> tuple[View, ...]:
    """Return the cameras in the CAD frame after the part, and they with it, has moved and grown about the origin."""
    growth = float(motion[6]) if gauge.growth else 0.0
    back = Pose.small(motion[:6], gauge.origin).inverse()
    moved = []
    for view in views:
        pose = view.camera_from_cad
        centred = pose.translation + pose.rotation @ gauge.origin  # the origin before the camera grows with the part
        shift = (1 + growth) * centred - pose.rotation @ gauge.origin
        moved.append(replace(view, camera_from_cad=Pose(pose.rotation, shift) @ back))
    return tuple(moved)
