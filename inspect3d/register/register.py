"""Stage 3: bring a cloud into the CAD frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.measure import Cloud
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import Status
from inspect3d.pose import Pose
from inspect3d.register.alignment import Alignment, Candidate, NoAlignmentError
from inspect3d.register.blind import BlindStart
from inspect3d.register.choice import Choice, freedom
from inspect3d.register.field import Field
from inspect3d.register.gauge import Gauge
from inspect3d.register.icp import TUKEY, Fit, RobustIcp, fitted, median_and_scale, settled
from inspect3d.register.mobility import named, spread
from inspect3d.register.similarity import Similarity
from inspect3d.register.smooth import Smooth
from inspect3d.register.thinned import Thinned, thinned
from inspect3d.register.units import unit_hint

LEAST_POINTS = 20
NEAR = 0.03  # share of the cloud's extent within which a point is an inlier
REGISTERS = 0.8  # share of inliers above which a cloud registers, if it does so in one pose only
FITS = 0.5  # share of inliers below which a cloud is refused
ROUGH = 5.0  # noises; a fit rougher than this is refused unless the cloud registers beyond doubt
OUTWARD = 0.5  # share of the points whose normals must agree with the CAD's for their sign to be believed
EXACT = 1e-9  # share of the diagonal below which distances are rounding: points of the CAD itself have no scatter
FEW, MANY = 1500, 20_000  # points of the search, and of the last refinement


@dataclass(frozen=True, eq=False)
class Register:
    """Align clouds to one nominal part.

    A cloud whose scale is unknown may come in any unit: it is brought to the size of the CAD by its extent, the search
    tries scales from a fifth to twice that (`BlindStart.of_unknown_scale`), and every refinement fits the scale with
    the pose. The alignment's `scale` tells the result: X_cad = cad_from_measured(scale x). A scale that was taken from
    the CAD hides a scale error of the part.

    Parameters
    ----------
    nominal : the part as designed
    start : cad_from_cloud to begin with, with a scale where that is unknown; None searches all poses
    refine : False keeps the start as it is
    reach : mm, points farther than this from the CAD are not of the part; None: the scatter decides
    scale_known : False fits the scale as well
    """

    nominal: Nominal
    start: Pose | Similarity | None = None
    refine: bool = True
    reach: float | None = None
    scale_known: bool = True

    def __call__(self, cloud: Cloud) -> Alignment:
        """Return where the cloud lies in the CAD frame.

        Raises
        ------
        NoAlignmentError
            The cloud does not fit the CAD, fits it in several ways, or fits it in other units.
        """
        if len(cloud) < LEAST_POINTS:
            raise NoAlignmentError(
                f"{cloud.name} holds {len(cloud)} points, too few to find the part in: {LEAST_POINTS} are needed."
            )
        start = Similarity(self.start) if isinstance(self.start, Pose) else self.start
        centre, size = np.median(cloud.points, axis=0), self._size(cloud, start)
        near = Cloud(cloud.name, size * (cloud.points - centre), cloud.normals)
        near_from_cloud = Similarity(Pose(np.eye(3), -size * centre), size)
        if start is None:
            choice = self._search(near, near_from_cloud)
            pose, status, candidates = (
                self._fine(near, choice.fit.pose),
                self._status(choice),
                _candidates(choice, near_from_cloud),
            )
        else:
            near_start = start @ near_from_cloud.inverse()
            pose, status, candidates = self._from(near, near_start), Status.OK, ()
        return self._alignment(near, pose, near_from_cloud, status, candidates)

    def _size(self, cloud: Cloud, start: Similarity | None) -> float:
        """Return what brings the cloud to the size of the CAD; 1 where its scale is known."""
        if self.scale_known:
            return 1.0
        if start is not None:
            return start.scale
        extent = _extent(cloud.points)
        if not extent > 0:
            raise NoAlignmentError(f"{cloud.name} has all its points in one place.")
        return self.nominal.diagonal / extent

    @cached_property
    def _smooth(self) -> Smooth:
        return Smooth(self.nominal.surface)

    @cached_property
    def _field(self) -> Field:
        return Field.of(self.nominal.surface)

    def _search(self, cloud: Cloud, to_centre: Similarity) -> Choice:
        """Return the pose that the cloud chooses among all, or refuse it."""
        few = thinned(cloud, FEW)
        blind = BlindStart() if self.scale_known else BlindStart.of_unknown_scale()
        choice = blind(few, self._smooth, self._field)
        registers, free = self._registers(choice, few)
        if few.oriented and not registers:  # the normals of the file may point into the material
            either = replace(few, oriented=False)
            other = blind(either, self._smooth, self._field)
            if self._registers(other, either)[0]:
                few, choice = either, other
                registers, free = self._registers(choice, few)
        candidates = _candidates(choice, to_centre)
        if self.scale_known and (not registers or free):
            hint = unit_hint(few.points, self.nominal.diagonal, registers, free, lambda factor: self._at(few, factor))
            if hint:
                raise NoAlignmentError(
                    f"{cloud.name} does not fit the CAD in the declared units. {hint}", candidates=candidates
                )
        self._require_fit(cloud, choice.fit, few, candidates)
        if choice.rivals:
            raise NoAlignmentError(
                f"{cloud.name} fits the CAD equally well in {len(choice.rivals) + 1} different poses: put one of the "
                'candidates into the recipe (alignment.start = "pose"), or give landmarks.',
                Status.AMBIGUOUS,
                candidates,
            )
        return choice

    def _at(self, few: Thinned, factor: float) -> tuple[bool, int]:
        """Tell whether the cloud times a factor registers, and how many motions that leaves free."""
        scaled = few.scaled(factor)
        return self._registers(BlindStart()(scaled, self._smooth, self._field), scaled)

    def _registers(self, choice: Choice, few: Thinned) -> tuple[bool, int]:
        """Tell whether the cloud lies on the CAD in one pose only, and how many motions that leaves free."""
        registers = self._share(choice.fit, few) > REGISTERS and not choice.rivals
        return registers, freedom(choice.fit, self._smooth, not self.scale_known)

    def _near(self, few: Thinned) -> float:
        """Return the distance within which a point is an inlier, mm: it shrinks with the cloud, so that a cloud in
        far too small units does not fit for being small."""
        return NEAR * min(_extent(few.points), self.nominal.diagonal)

    def _share(self, fit: Fit, few: Thinned) -> float:
        """Return the share of inliers among the points within reach."""
        within = np.abs(fit.feet.distance) < (self.reach or np.inf)
        near = fit.agrees & within & (np.abs(fit.distance) < self._near(few))
        return float(np.count_nonzero(near) / max(int(np.count_nonzero(within)), 1))

    def _require_fit(self, cloud: Cloud, fit: Fit, few: Thinned, candidates: tuple[Candidate, ...]) -> None:
        share = self._share(fit, few)
        if share >= (FITS if fit.scale < ROUGH * few.noise else REGISTERS):
            return
        raise NoAlignmentError(
            f"{cloud.name} does not fit the CAD: in the best pose found {100 * share:.0f} % of its points lie within "
            f"{self._near(few):.2g} mm of it. Check that scan and CAD are of the same part; if much of the scan is not "
            "of the part, cut it off or give `reach`.",
            candidates=candidates,
        )

    def _from(self, cloud: Cloud, start: Similarity) -> Similarity:
        """Return the pose the alignment from a given start ends in, or the start itself."""
        if not self.refine:
            return start
        many = self._many(cloud, start)
        width = min(0.05 * self.nominal.diagonal, self.reach or np.inf)
        icp = RobustIcp(first_width=width, grows=not self.scale_known)
        rough = icp(many.every(max(len(many.points) // FEW, 1)), self.nominal.surface, start)
        fit = settled(many, self.nominal.surface, rough.pose, not self.scale_known)
        self._require_fit(cloud, fit, many, ())
        return fit.pose

    def _fine(self, cloud: Cloud, start: Similarity) -> Similarity:
        return settled(self._many(cloud, start), self.nominal.surface, start, not self.scale_known).pose

    def _many(self, cloud: Cloud, start: Similarity) -> Thinned:
        """Return many points of the cloud; normals that point into the material in the start count without a sign."""
        many = thinned(cloud, MANY, even=False)
        outward = fitted(many, self.nominal.surface, start).agrees.mean() > OUTWARD
        return many if outward else replace(many, oriented=False)

    @staticmethod
    def _status(choice: Choice) -> Status:
        return Status.SYMMETRIC if choice.by_symmetry else Status.OK

    def _alignment(
        self, cloud: Cloud, pose: Similarity, to_centre: Similarity, status: Status, candidates: tuple[Candidate, ...]
    ) -> Alignment:
        """Return the alignment in a pose cad_from_centred, with what the points say about it."""
        sample = Thinned(cloud.points, np.zeros_like(cloud.points), oriented=False)
        fit = fitted(sample, self.nominal.surface, pose)
        distance = fit.feet.distance
        width = max(TUKEY * fit.scale * pose.scale, EXACT * self.nominal.diagonal)
        used = ~fit.feet.on_rim & (np.abs(distance) < min(width, self.reach or np.inf))
        if np.count_nonzero(used) < LEAST_POINTS:
            raise NoAlignmentError(
                f"{cloud.name} has no points near the CAD in the pose it was given: check `start` and `reach`.",
                candidates=candidates,
            )
        part = np.flatnonzero(used)[:: max(np.count_nonzero(used) // MANY, 1)]
        feet = fit.feet.points[part]
        normals = self._smooth.normals(feet, fit.feet.triangle[part])
        weights = np.clip(1 - (distance[part] / width) ** 2, 1e-3, None) ** 2
        gauge = Gauge(feet, normals, weights, growth=not self.scale_known)
        if gauge.growth_is_free:
            raise NoAlignmentError(
                f"{cloud.name} shows only faces that fit the CAD at any size, as a plane does, so nothing tells its "
                "scale: give the cameras with their places, or a known distance.",
                candidates=candidates,
            )
        free = named(gauge.free, gauge.origin, gauge.length)
        block = spread(feet, np.ones(len(feet)), gauge.origin) / 3
        covariance = gauge.covariance(gauge(distance[part]), block)[:6, :6] if self.refine else np.zeros((6, 6))
        placed = pose @ to_centre
        return Alignment(
            cad_from_measured=placed.pose,
            scale=placed.scale,
            residual=median_and_scale(distance[used])[1],
            covariance=covariance,
            origin=gauge.origin,
            used=used,
            status=Status.FREE_MOTIONS if free else status,
            free=free,
            candidates=candidates,
        )


def _candidates(choice: Choice, to_centre: Similarity) -> tuple[Candidate, ...]:
    """Return the poses of a choice, best first; those that a symmetry makes equal count as one."""
    fits = (choice.fit, *choice.rivals, *choice.others)
    placed = ((fit, fit.pose @ to_centre) for fit in fits[:8])
    return tuple(Candidate(place.pose, place.scale, fit.scale * fit.pose.scale) for fit, place in placed)


def _extent(points: Floats) -> float:
    """Return the diagonal of the box of points (n, 3) mm, a hundredth of them left out at each side."""
    low, high = np.percentile(points, [1, 99], axis=0)
    return float(np.linalg.norm(high - low))
