"""Stage 4: the deviation of clouds that lie near their place in the CAD frame, in the common alignment."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.deviate.alike import with_alike_noise
from inspect3d.deviate.cloud_to_node import CloudToNode, NodeFit
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.map_covariance import Independent, MapCovariance, pose_errors, variances_without
from inspect3d.measure import Cloud, FieldCovariance
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.surface import Feet
from inspect3d.outcome import MeasurementError, Status
from inspect3d.register.alignment import Alignment
from inspect3d.register.fit import Fit
from inspect3d.register.gauge import ROUNDED, Gauge
from inspect3d.register.icp import TUKEY, median_and_scale
from inspect3d.register.mobility import jacobian, named
from inspect3d.register.register import EXACT
from inspect3d.register.similarity import Similarity

FOREIGN = 0.02  # share of the CAD's diagonal beyond which a point is foreign, unless the recipe gives a reach
SETTLED = 0.02  # share of the usual uncertainty below which the last motion of a node ends the alignment
LEAST_NODES = 12
BLOCKS = 3.0  # blocks of the pose covariance along the spread of the nodes


@dataclass(frozen=True, eq=False)
class CloudDeviation:
    """What clouds say about a part.

    Parameters
    ----------
    deviation : the map on the inspection mesh
    covariance : how its errors hang together
    alignments : of the clouds, with the last step of the common alignment in them
    points_cad : (k, 3) mm, all points in the CAD frame, in order
    distance : (k,) mm, signed distance of each point; NaN where its foot lies on a rim or is out of reach
    noise : mm, standard uncertainty of a point, given or found
    remarks : what was decided on the way, a sentence each
    """

    deviation: Deviation
    covariance: MapCovariance
    alignments: tuple[Alignment, ...]
    points_cad: Floats
    distance: Floats
    noise: float
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Deviate:
    """Measure the deviation of clouds at the nodes, and bring it into the common alignment.

    The common alignment is the robust best fit of the map itself, weighted by area (`Gauge`): the rigid motion found
    in the map, and the growth where the method cannot see the scale, moves the points, until none is left. The map's
    uncertainty is that of the local fits through the same linear map, G S G'; what all nodes share (coating,
    calibration, chord of the tessellation) is added.

    Parameters
    ----------
    to_node : how points become nodes
    fit : what the common alignment is fitted to
    refine : False keeps the given alignment; its covariance then adds to the map's, S + J C J'
    reach : mm, points farther than this from the CAD are foreign; None: 2 % of the CAD's diagonal
    coating : mm, thickness of paint, subtracted
    coating_sigma, calibration : mm, standard uncertainties that all nodes share
    scale_known : False takes the growth of the part out of the map as well
    scale_sigma : relative standard uncertainty of the scale of the clouds, where it is known
    steps : of the alignment at the most
    """

    to_node: CloudToNode = field(default_factory=CloudToNode)
    fit: Fit = field(default_factory=Fit)
    refine: bool = True
    reach: float | None = None
    coating: float = 0.0
    coating_sigma: float = 0.0
    calibration: float = 0.0
    scale_known: bool = True
    scale_sigma: float = 0.0
    steps: int = 6

    def __call__(
        self, clouds: tuple[Cloud, ...], alignments: tuple[Alignment, ...], nominal: Nominal, counted: Booleans
    ) -> CloudDeviation:
        """Return the deviation of clouds.

        Parameters
        ----------
        clouds, alignments : one alignment for each cloud
        nominal : the part as designed
        counted : (n,), the nodes that the recipe does not exclude

        Raises
        ------
        MeasurementError
            The points are too few or too far off for any node to be observed.
        """
        mesh = nominal.mesh
        points = np.concatenate([place(cloud.points) for cloud, place in zip(clouds, alignments, strict=True)])
        normals = _normals(clouds, alignments)
        noise = _common_noise(clouds, alignments)
        shares = _shares(clouds)
        moved, rounded = Similarity.identity(), False
        for _ in range(self.steps):
            feet = nominal.surface.closest(moved(points))
            fit = self._observe(nominal, feet, moved.turned(normals), noise, shares, counted)
            if not fit.noise > EXACT * nominal.diagonal:
                noise, rounded = self._spread(nominal, feet), True
                fit = self._observe(nominal, feet, moved.turned(normals), noise, shares, counted)
            seen = np.flatnonzero(fit.observed)
            value = fit.value[seen] - self.coating
            gauge = self.fit(mesh, seen, value, not self.scale_known)
            if not self.refine:
                break
            motion = gauge.motion(value)
            if np.abs(gauge.jacobian @ motion).max() < SETTLED * np.sqrt(np.median(fit.variance[seen])):
                break
            moved = Similarity.small(motion, gauge.origin) @ moved
        own = _own(fit, mesh, max(c.noise_length * a.scale for c, a in zip(clouds, alignments, strict=True)))
        deviation = self._map(fit, own, value, gauge, alignments, nominal)
        covariance = self._covariance(fit, own, gauge, alignments)
        distance = np.where(feet.on_rim, np.nan, feet.distance - self.coating)
        distance[np.abs(feet.distance) > (self.reach or np.inf)] = np.nan
        placed = self._aligned(alignments, moved, clouds, distance)
        if self.fit.kind != "best" or self.fit.locked:
            placed = tuple(_by_features(each, gauge, value) for each in placed)
        remarks = self._remarks(nominal, feet)
        if rounded:
            remarks += (
                "Neighbouring points lie on exact planes, as where a sensor rounds its distances: their scatter does "
                f"not tell how sure they are. Their spread about the CAD, {fit.noise:.2g} mm, is taken for their "
                "noise; state `noise` where it is known.",
            )
        return CloudDeviation(deviation, covariance, placed, moved(points), distance, fit.noise, remarks)

    def _spread(self, nominal: Nominal, feet: Feet) -> float:
        """Return the robust spread of the points of the part about the CAD, mm."""
        distance = feet.distance[np.abs(feet.distance - self.coating) < (self.reach or FOREIGN * nominal.diagonal)]
        return median_and_scale(distance)[1]

    def _remarks(self, nominal: Nominal, feet: Feet) -> tuple[str, ...]:
        reach = self.reach or FOREIGN * nominal.diagonal
        far = np.count_nonzero(np.abs(feet.distance - self.coating) >= reach)
        if not far:
            return ()
        rule = "the reach of the recipe" if self.reach else "2 % of the CAD's diagonal, since the recipe gives no reach"
        return (
            f"{far} of {len(feet.distance)} points lie over {reach:.3g} mm from the CAD ({rule}) and were left out.",
        )

    def _observe(
        self,
        nominal: Nominal,
        feet: Feet,
        normals: Floats,
        noise: float | None,
        shares: Floats | None,
        counted: Booleans,
    ) -> NodeFit:
        reach = self.reach or FOREIGN * nominal.diagonal
        cosine = np.einsum("ni,ni->n", normals, feet.normals)
        near = np.abs(feet.distance - self.coating) < reach
        told = np.linalg.norm(normals, axis=1) > 0.5
        turned_in = np.count_nonzero(cosine[near & told] < 0) > 0.7 * np.count_nonzero(near & told)
        part = near if turned_in else near & (~told | (cosine > 0))
        fit = self.to_node(nominal.mesh, feet, part, noise, shares)
        observed = fit.observed & counted
        if np.count_nonzero(observed) < LEAST_NODES:
            raise MeasurementError(
                f"Only {np.count_nonzero(observed)} of {len(nominal.mesh)} nodes have enough measured points around: "
                f"choose a larger element_size (it is {nominal.mesh.edge_length:.3g} mm), or scan more densely."
            )
        hidden = ~observed
        return replace(
            fit,
            observed=observed,
            value=np.where(hidden, np.nan, fit.value),
            variance=np.where(hidden, np.nan, fit.variance),
            missed=np.where(hidden, np.nan, fit.missed),
        )

    def _map(
        self,
        fit: NodeFit,
        own: FieldCovariance,
        value: Floats,
        gauge: Gauge,
        alignments: tuple[Alignment, ...],
        nominal: Nominal,
    ) -> Deviation:
        """Return the map: the values in the gauge, and the variance of all that enters them."""
        seen = np.flatnonzero(fit.observed)
        coating = np.full(len(seen), self.coating_sigma)
        growth = self.scale_sigma * ((gauge.nodes - gauge.origin) * gauge.normals).sum(axis=1)
        if self.refine:
            value = value + gauge.jacobian @ gauge.motion(value)
            left = np.maximum(variances_without(own, gauge.jacobian, gauge.solver), ROUNDED * own.variances)
            variance = left + gauge(coating) ** 2 + gauge(growth) ** 2
        else:
            rows = jacobian(gauge.nodes, gauge.normals, alignments[0].origin)
            variance = (
                own.variances + np.einsum("ij,jk,ik->i", rows, alignments[0].covariance, rows) + coating**2 + growth**2
            )
        variance = variance + self.calibration**2 + nominal.chord**2 / 3
        full_value, full_sigma = np.full(len(fit.value), np.nan), np.full(len(fit.value), np.nan)
        full_value[seen], full_sigma[seen] = value, np.sqrt(variance)
        return Deviation(full_value, full_sigma, fit.observed)

    def _covariance(
        self, fit: NodeFit, own: FieldCovariance, gauge: Gauge, alignments: tuple[Alignment, ...]
    ) -> MapCovariance:
        seen = np.flatnonzero(fit.observed)
        rows = jacobian(gauge.nodes, gauge.normals, alignments[0].origin)
        return MapCovariance(
            node=seen,
            own=own,
            pose=np.zeros((len(seen), 0)) if self.refine else pose_errors(rows, alignments[0].covariance),
            coating=(self.coating, self.coating_sigma),
            calibration=self.calibration,
            refined=self.refine,
            scale_known=self.scale_known,
        )

    def _aligned(
        self, alignments: tuple[Alignment, ...], moved: Similarity, clouds: tuple[Cloud, ...], distance: Floats
    ) -> tuple[Alignment, ...]:
        """Return the alignments with the last motion in them, and what the points say about it."""
        ends = np.cumsum([len(cloud) for cloud in clouds])
        result = []
        for alignment, cloud, end in zip(alignments, clouds, ends, strict=True):
            own = distance[end - len(cloud) : end]
            middle, scale = median_and_scale(own[np.isfinite(own)])
            used = np.isfinite(own) & (np.abs(own - middle) < TUKEY * max(scale, 1e-12))
            _, residual = median_and_scale(own[used])
            placed = moved @ Similarity(alignment.cad_from_measured, alignment.scale)
            result.append(
                replace(alignment, cad_from_measured=placed.pose, scale=placed.scale, residual=residual, used=used)
            )
        return tuple(result)


def _by_features(alignment: Alignment, gauge: Gauge, value: Floats) -> Alignment:
    """Return an alignment with the covariance and the free motions of what it was fitted to, for a map (k,) mm."""
    free = named(gauge.free, gauge.origin, gauge.length)
    covariance = gauge.covariance(gauge(value), gauge.length / BLOCKS)[:6, :6]
    status = Status.FREE_MOTIONS if free else alignment.status
    return replace(alignment, covariance=covariance, origin=gauge.origin, status=status, free=free)


def _normals(clouds: tuple[Cloud, ...], alignments: tuple[Alignment, ...]) -> Floats:
    """Return the measured normals in the CAD frame, zero where there are none, (k, 3)."""
    return np.concatenate(
        [
            np.zeros_like(cloud.points) if cloud.normals is None else place.cad_from_measured.turned(cloud.normals)
            for cloud, place in zip(clouds, alignments, strict=True)
        ]
    )


def _shares(clouds: tuple[Cloud, ...]) -> Floats | None:
    """Return the uncertainty of each point of all clouds as a share of the usual one; None where none tells it."""
    if all(cloud.shares is None for cloud in clouds):
        return None
    return np.concatenate([np.ones(len(cloud)) if cloud.shares is None else cloud.shares for cloud in clouds])


def _own(fit: NodeFit, mesh: InspectionMesh, alike: float) -> FieldCovariance:
    """Return the covariance of the local fits, their noise `alike` over so many mm.

    What the fits miss is added as independent between nodes. Shared noise bends the fits as a missed shape does and
    is in the covariance already, so that where it is stated nothing is added.
    """
    seen = np.flatnonzero(fit.observed)
    if not alike:
        return Independent(fit.variance[seen] + fit.missed[seen])
    return with_alike_noise(fit.variance[seen], mesh.nodes[seen], fit.noise, alike, fit.radius)


def _common_noise(clouds: tuple[Cloud, ...], alignments: tuple[Alignment, ...]) -> float | None:
    """Return the noise of a point in the CAD frame, mm, the largest of the clouds; None where one does not tell it."""
    told = [
        cloud.noise * place.scale for cloud, place in zip(clouds, alignments, strict=True) if cloud.noise is not None
    ]
    return max(told) if len(told) == len(clouds) else None
