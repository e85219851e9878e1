"""Stage 3: bring a cloud into the CAD frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from inspect3d.measure import Cloud
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import Status
from inspect3d.pose import Pose
from inspect3d.register.alignment import Alignment, Candidate, NoAlignmentError
from inspect3d.register.blind import BlindStart
from inspect3d.register.choice import Choice, free_in
from inspect3d.register.field import Field
from inspect3d.register.gauge import Gauge
from inspect3d.register.icp import TUKEY, Fit, RobustIcp, fitted, median_and_scale, settled
from inspect3d.register.mobility import named, spread
from inspect3d.register.smooth import Smooth
from inspect3d.register.thinned import Thinned, thinned
from inspect3d.register.units import unit_hint

LEAST_POINTS = 20
NEAR = 0.03  # share of the cloud's extent within which a point is an inlier
REGISTERS = 0.8  # share of inliers above which a cloud registers, if it does so in one pose only
FITS = 0.5  # share of inliers below which a cloud is refused
ROUGH = 5.0  # noises; a fit rougher than this is refused unless the cloud registers beyond doubt
FEW, MANY = 1500, 20_000  # points of the search, and of the last refinement


@dataclass(frozen=True, eq=False)
class Register:
    """Align clouds to one nominal part.

    Parameters
    ----------
    nominal : the part as designed
    start : the pose cad_from_cloud to begin with; None searches all poses
    refine : False keeps the start as it is
    reach : mm, points farther than this from the CAD are not of the part; None: the scatter decides
    """

    nominal: Nominal
    start: Pose | None = None
    refine: bool = True
    reach: float | None = None

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
        centre = np.median(cloud.points, axis=0)
        near = Cloud(cloud.name, cloud.points - centre, cloud.normals, cloud.noise)
        to_centre = Pose(np.eye(3), -centre)
        if self.start is None:
            choice = self._search(near, to_centre)
            pose, status, candidates = (
                self._fine(near, choice.fit.pose),
                self._status(choice),
                _candidates(choice, to_centre),
            )
        else:
            start = self.start @ to_centre.inverse()
            pose, status, candidates = self._from(near, start), Status.OK, ()
        return self._alignment(near, pose, to_centre, status, candidates)

    @cached_property
    def _smooth(self) -> Smooth:
        return Smooth(self.nominal.surface)

    @cached_property
    def _field(self) -> Field:
        return Field.of(self.nominal.surface)

    def _search(self, cloud: Cloud, to_centre: Pose) -> Choice:
        """Return the pose that the cloud chooses among all, or refuse it."""
        few = thinned(cloud, FEW)
        choice = BlindStart()(few, self._smooth, self._field)
        registers, free = self._registers(choice, few)
        if few.oriented and not registers:  # the normals of the file may point into the material
            either = replace(few, oriented=False)
            other = BlindStart()(either, self._smooth, self._field)
            if self._registers(other, either)[0]:
                few, choice = either, other
                registers, free = self._registers(choice, few)
        candidates = _candidates(choice, to_centre)
        if not registers or free:
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
        return registers, len(free_in(choice.fit, self._smooth))

    def _near(self, few: Thinned) -> float:
        """Return the distance within which a point is an inlier, mm: it shrinks with the cloud, so that a cloud in
        far too small units does not fit for being small."""
        low, high = np.percentile(few.points, [1, 99], axis=0)
        return NEAR * min(float(np.linalg.norm(high - low)), self.nominal.diagonal)

    def _share(self, fit: Fit, few: Thinned) -> float:
        """Return the share of inliers among the points within reach."""
        distance = np.abs(fit.feet.distance)
        within = distance < (self.reach or np.inf)
        near = fit.agrees & within & (distance < self._near(few))
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

    def _from(self, cloud: Cloud, start: Pose) -> Pose:
        """Return the pose the alignment from a given start ends in, or the start itself."""
        if not self.refine:
            return start
        many = thinned(cloud, MANY, even=False)
        width = min(0.05 * self.nominal.diagonal, self.reach or np.inf)
        rough = RobustIcp(first_width=width)(many.every(max(len(many.points) // FEW, 1)), self.nominal.surface, start)
        fit = settled(many, self.nominal.surface, rough.pose)
        self._require_fit(cloud, fit, many, ())
        return fit.pose

    def _fine(self, cloud: Cloud, start: Pose) -> Pose:
        return settled(thinned(cloud, MANY, even=False), self.nominal.surface, start).pose

    @staticmethod
    def _status(choice: Choice) -> Status:
        return Status.SYMMETRIC if choice.by_symmetry else Status.OK

    def _alignment(
        self, cloud: Cloud, pose: Pose, to_centre: Pose, status: Status, candidates: tuple[Candidate, ...]
    ) -> Alignment:
        """Return the alignment in a pose cad_from_centred, with what the points say about it."""
        sample = Thinned(cloud.points, np.zeros_like(cloud.points), oriented=False)
        fit = fitted(sample, self.nominal.surface, pose)
        distance = fit.feet.distance
        used = ~fit.feet.on_rim & (np.abs(distance) < min(TUKEY * fit.scale, self.reach or np.inf))
        if np.count_nonzero(used) < LEAST_POINTS:
            raise NoAlignmentError(
                f"{cloud.name} has no points near the CAD in the pose it was given: check `start` and `reach`.",
                candidates=candidates,
            )
        part = np.flatnonzero(used)[:: max(np.count_nonzero(used) // MANY, 1)]
        feet = fit.feet.points[part]
        normals = self._smooth.normals(feet, fit.feet.triangle[part])
        gauge = Gauge(feet, normals, np.clip(1 - (distance[part] / (TUKEY * fit.scale)) ** 2, 1e-3, None) ** 2)
        free = named(gauge.free, gauge.origin, gauge.length)
        block = spread(feet, np.ones(len(feet)), gauge.origin) / 3
        return Alignment(
            cad_from_measured=pose @ to_centre,
            scale=1.0,
            residual=median_and_scale(distance[used])[1],
            covariance=gauge.covariance(gauge(distance[part]), block) if self.refine else np.zeros((6, 6)),
            origin=gauge.origin,
            used=used,
            status=Status.FREE_MOTIONS if free else status,
            free=free,
            candidates=candidates,
        )


def _candidates(choice: Choice, to_centre: Pose) -> tuple[Candidate, ...]:
    """Return the poses of a choice, best first; those that a symmetry makes equal count as one."""
    fits = (choice.fit, *choice.rivals, *choice.others)
    return tuple(Candidate(fit.pose @ to_centre, 1.0, fit.scale) for fit in fits[:8])
