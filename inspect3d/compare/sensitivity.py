"""How much a map depends on the alignment: on the choice of it, and on how well the chosen one is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from inspect3d.arrays import Floats, floats
from inspect3d.deviate.deviation import Deviation
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.outcome import InputError, MeasurementError
from inspect3d.pose import Pose
from inspect3d.register.alignment import Alignment
from inspect3d.register.fit import Fit
from inspect3d.register.landmarks import similarity_from_landmarks
from inspect3d.register.mobility import jacobian


@dataclass(frozen=True, eq=False)
class OtherAlignment:
    """What another choice of the alignment would change.

    Parameters
    ----------
    words : which one it is
    motion : (6,) rx, ry, rz, tx, ty, tz; rad, mm; about `origin`: the part would move by it
    origin : (3,) mm, CAD frame
    shift : (n,) mm, by which the deviation at every node would grow
    """

    words: str
    motion: Floats
    origin: Floats
    shift: Floats

    @classmethod
    def of(cls, words: str, motion: Floats, origin: Floats, mesh: InspectionMesh) -> OtherAlignment:
        """Return it from the small motion that leads from the chosen alignment to the other."""
        shift = jacobian(mesh.nodes, mesh.normals, origin) @ motion[:6]
        return cls(words, floats(motion[:6], "motion", 6), floats(origin, "origin", 3), floats(shift, "shift", None))


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """How much each node moves between the choices of the alignment, and within the uncertainty of the chosen one.

    Parameters
    ----------
    chosen : the alignment of the map, in words
    others : what other choices would change
    within : (n,) mm, standard uncertainty of the deviation from that of the pose alone
    remarks : which other choices cannot be made and why, a sentence each
    """

    chosen: str
    others: tuple[OtherAlignment, ...]
    within: Floats
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        chosen: str,
        others: tuple[OtherAlignment, ...],
        alignment: Alignment,
        mesh: InspectionMesh,
        remarks: tuple[str, ...] = (),
    ) -> Sensitivity:
        """Return it, with what the covariance of the chosen alignment alone makes uncertain."""
        rows = jacobian(mesh.nodes, mesh.normals, alignment.origin)
        variance = np.einsum("ij,jk,ik->i", rows, alignment.covariance, rows)
        return cls(chosen, others, np.sqrt(np.maximum(variance, 0.0)), remarks)

    @property
    def spread(self) -> Floats:
        """Return the largest less the smallest deviation of each node between the choices, (n,) mm."""
        shifts = np.array([np.zeros(len(self.within)), *(other.shift for other in self.others)])
        return shifts.max(axis=0) - shifts.min(axis=0)


def sensitivity(
    chosen: str,
    others: tuple[Fit, ...],
    landmarks: tuple[Floats, Floats] | None,
    deviation: Deviation,
    alignment: Alignment,
    mesh: InspectionMesh,
    scale_known: bool = True,
) -> Sensitivity:
    """Return how much a map depends on its alignment.

    Parameters
    ----------
    chosen : how the alignment was found, in words
    others : what else it may be fitted to
    landmarks : measured and CAD points (k, 3) mm of one more choice, if there are any
    deviation : the map, in the chosen alignment
    alignment : the chosen one
    """
    seen = np.flatnonzero(deviation.observed)
    found, remarks = [], []
    for other in others:
        try:
            gauge = other(mesh, seen, deviation.value[seen], not scale_known)
            found.append(OtherAlignment.of(other.words, gauge.motion(deviation.value[seen]), gauge.origin, mesh))
        except MeasurementError as error:
            remarks.append(f"An alignment by {other.words} cannot be shown: {error}")
    if landmarks is not None:
        try:
            placed = similarity_from_landmarks(*landmarks, grows=not scale_known).pose
            motion = _small(placed @ alignment.cad_from_measured.inverse(), alignment.origin)
            found.append(OtherAlignment.of(f"{len(landmarks[0])} landmarks", motion, alignment.origin, mesh))
        except InputError as error:
            remarks.append(f"An alignment by landmarks cannot be shown: {error}")
    return Sensitivity.of(chosen, tuple(found), alignment, mesh, tuple(remarks))


def _small(motion: Pose, origin: Floats) -> Floats:
    """Return a pose near the identity as a small motion (6,) about an origin."""
    return np.concatenate([Rotation.from_matrix(motion.rotation).as_rotvec(), motion(origin[None])[0] - origin])
