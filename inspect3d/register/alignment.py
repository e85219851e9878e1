"""Where the measured points lie in the CAD frame, and how well that is known."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from inspect3d.arrays import Booleans, Floats, booleans, floats
from inspect3d.camera import View
from inspect3d.figure import Figure
from inspect3d.outcome import MeasurementError, Status
from inspect3d.pose import Pose


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """A motion of the part that the measured points leave undetermined.

    Parameters
    ----------
    words : such as "turn about the axis along (0, 1, 0) through (0, 12.5, 0) mm"
    direction : (6,) rx, ry, rz, tx, ty, tz; rad, mm; about the alignment's `origin`
    """

    words: str
    direction: Floats


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pose that was considered: X_cad = pose(scale x)."""

    pose: Pose
    scale: float
    residual: float


@dataclass(frozen=True, eq=False)
class Alignment:
    """The pose of measured points in the CAD frame: X_cad = cad_from_measured(scale x), x in mm.

    Parameters
    ----------
    cad_from_measured : the rigid motion
    scale : 1 unless the method cannot see it
    residual : mm, 1.4826 times the median absolute deviation of the point-to-surface distances about their median
    covariance : (6, 6) of a small motion (rx, ry, rz, tx, ty, tz; rad, mm) applied after the pose, about `origin`
    origin : (3,) mm, CAD frame
    used : (n,), the points that took part in the fit
    status : OK, SYMMETRIC or FREE_MOTIONS; AMBIGUOUS where `candidates` tie
    free : the undetermined motions, held at the start, with zero covariance
    candidates : the poses considered, best first; the poses a symmetry makes equal count as one
    """

    cad_from_measured: Pose
    scale: float
    residual: float
    covariance: Floats
    origin: Floats
    used: Booleans
    status: Status = Status.OK
    free: tuple[FreeMotion, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    remarks: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", floats(self.covariance, "covariance", 6, 6))
        object.__setattr__(self, "origin", floats(self.origin, "origin", 3))
        object.__setattr__(self, "used", booleans(self.used, "used", None))

    def __call__(self, points: Floats) -> Floats:
        """Return measured points (n, 3) mm in the CAD frame."""
        return self.cad_from_measured(self.scale * points)

    def views(self, views: tuple[View, ...]) -> tuple[View, ...]:
        """Return cameras that stand in the frame and scale of the measured points in the CAD frame."""
        back = self.cad_from_measured.inverse()
        return tuple(
            replace(
                view,
                camera_from_cad=Pose(view.camera_from_cad.rotation, self.scale * view.camera_from_cad.translation)
                @ back,
            )
            for view in views
        )

    @property
    def count(self) -> int:
        """Return how many points took part in the fit."""
        return int(np.count_nonzero(self.used))


class NoAlignmentError(MeasurementError):
    """The measured points have no single pose in the CAD frame.

    Parameters
    ----------
    sentence : what is wrong and what to do
    status : FAILED or AMBIGUOUS
    candidates : the poses considered, best first
    figures : what the report shows of them
    """

    def __init__(
        self,
        sentence: str,
        status: Status = Status.FAILED,
        candidates: tuple[Candidate, ...] = (),
        figures: tuple[Figure, ...] = (),
    ) -> None:
        super().__init__(sentence)
        self.status = status
        self.candidates = candidates
        self.figures = figures
