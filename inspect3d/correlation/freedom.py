"""What the solver may change about the cameras, and how well it is known beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from inspect3d.arrays import Floats, Integers, floats
from inspect3d.camera import View
from inspect3d.pose import Pose

POSE, LENS = 6, 10
EXACT = 1e-9  # rad or mm
FY = 7
COLUMNS = ((6, FY), (8,), (9,), (10,), (11,), (12,), (13,), (14,), (FY,), (15,))
"""The kernel's numbers of the parameters that change with each of focal, cx, cy, k1, k2, p1, p2, k3, aspect, skew."""
DISTORTION = ("k1", "k2", "p1", "p2", "k3")
LENS_PARTS = (
    "focal length",
    "principal point x",
    "principal point y",
    *(f"distortion {c}" for c in DISTORTION),
    "aspect",
    "skew",
)
Poses = Literal["known", "common", "free"]


@dataclass(frozen=True, eq=False)
class Lens:
    """Standard uncertainties of a lens: 0 is exact, infinity unknown.

    Parameters
    ----------
    focal : px, of fx and fy together, their ratio kept
    centre : px, of each coordinate of the principal point
    distortion : (5,), of k1, k2, p1, p2, k3
    aspect : px, of fy beyond what its ratio to fx makes it
    skew : px, of how far the rows lean

    Notes
    -----
    With focal, centre, aspect and skew unknown and no distortion, a view is a free 3 x 4 matrix (paper, eqs. 4 to 6).
    """

    focal: float = 0.0
    centre: float = 0.0
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    aspect: float = 0.0
    skew: float = 0.0

    @property
    def sigmas(self) -> Floats:
        """Return the uncertainties of (focal, cx, cy, k1, k2, p1, p2, k3, aspect, skew), (10,)."""
        return np.array([self.focal, self.centre, self.centre, *self.distortion, self.aspect, self.skew])


@dataclass(frozen=True)
class Stand:
    """How well the place of a camera is known: standard uncertainties, 0 is exact.

    Parameters
    ----------
    turn : rad, of each component of a small turn about the origin of the frame that the place is stated in
    shift : mm, of each component of a shift
    """

    turn: float = 0.0
    shift: float = 0.0

    @property
    def sigmas(self) -> Floats:
        """Return the uncertainties of three turns and three shifts, (6,)."""
        return np.array([self.turn] * 3 + [self.shift] * 3)


@dataclass(frozen=True, eq=False)
class Freedom:
    """The unknowns of the cameras, and the priors of their lenses and places.

    A pose is changed by a small motion of the part in the CAD frame, about `origin`, before it is photographed: turns
    and shifts (rad, mm). A lens is changed by (focal, cx, cy, k1, k2, p1, p2, k3, aspect, skew).

    Parameters
    ----------
    poses : "known"; "common", the cameras are a known rig but the part's place in it is not; "free", each by itself
    lenses : of each view
    priors : the views as they were believed to be beforehand; their poses count where there are `stands`
    origin : (3,) mm
    stands : of each view, where its place in the rig or before the part is not exact; none: all are
    datum : (3,) mm, the origin of the frame in which the stands are stated
    """

    poses: Poses
    lenses: tuple[Lens, ...]
    priors: tuple[View, ...]
    origin: Floats
    stands: tuple[Stand, ...] = ()
    datum: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "origin", floats(self.origin, "origin", 3))
        if self.stands and (len(self.stands) != len(self.priors) or self.poses == "free"):
            raise ValueError("stands belong to views whose places are known, one to each")
        if len(self.lenses) != len(self.priors):
            raise ValueError(f"{len(self.lenses)} lenses are given for {len(self.priors)} views")

    @property
    def columns(self) -> Integers:
        """Return the parameters of a view that the kernel must differentiate by, in its numbering."""
        open_lens = np.any([lens.sigmas > 0 for lens in self.lenses], axis=0)
        lens = np.unique([column for k in np.flatnonzero(open_lens) for column in COLUMNS[k]])
        moving = self.poses != "known" or any(stand.sigmas.any() for stand in self.stands)
        return np.array([*(range(POSE) if moving else ()), *lens], dtype=np.int64)

    @property
    def unknowns(self) -> int:
        """Return m, the number of unknowns."""
        return len(self.spread(self.columns)[1])

    def spread(self, columns: Integers) -> tuple[Floats, Floats]:
        """Return Q (v c, m) and the sigmas (m,): the parameters `columns` of all views are Q times the unknowns."""
        views, c = len(self.lenses), len(columns)
        at = {int(column): k for k, column in enumerate(columns)}
        rows: list[Floats] = []
        sigmas: list[float] = []
        if self.poses != "known":
            bodies = [range(views)] if self.poses == "common" else [[k] for k in range(views)]
            for body in bodies:
                for motion in range(POSE):
                    row = np.zeros((views, c))
                    row[list(body), at[motion]] = 1.0
                    rows.append(row)
                    sigmas.append(np.inf)
        for k, motion, sigma in self._loose:
            row = np.zeros((views, c))
            row[k, at[motion]] = 1.0
            if motion < 3:  # a turn about the datum shifts the origin
                row[k, [at[3], at[4], at[5]]] = np.cross(np.eye(3)[motion], self.origin - np.array(self.datum))
            rows.append(row)
            sigmas.append(sigma)
        for k, lens in enumerate(self.lenses):
            matrix = self.priors[k].camera.matrix
            for number, sigma in enumerate(lens.sigmas):
                if sigma > 0:
                    row = np.zeros((views, c))
                    sigmas.append(float(sigma))
                    rows.append(row)
                    chosen = [column for column in COLUMNS[number] if column in at]
                    for column in chosen:
                        row[k, at[column]] = matrix[1, 1] / matrix[0, 0] if number == 0 and column == FY else 1.0
        return np.array(rows).reshape(len(rows), views * c).T, np.array(sigmas)

    @property
    def names(self) -> tuple[str, ...]:
        """Return what each unknown is called, (m,)."""
        motions = [f"{kind} {axis}" for kind in ("turn about", "shift along") for axis in "xyz"]
        bodies = {"known": (), "common": ("the part",), "free": tuple(f"view {k + 1}" for k in range(len(self.lenses)))}
        names = [f"{motion} of {body}" for body in bodies[self.poses] for motion in motions]
        names += [f"{motions[motion]} of view {k + 1}" for k, motion, _ in self._loose]
        for k, lens in enumerate(self.lenses):
            names += [f"{p} of view {k + 1}" for p, sigma in zip(LENS_PARTS, lens.sigmas, strict=True) if sigma > 0]
        return tuple(names)

    def scale(self, views: Sequence[View], points: Floats) -> Floats:
        """Return the change of each unknown that moves the pictures of points (n, 3) mm by one pixel rms, (m,)."""
        places = np.concatenate([view.project(points) for view in views])
        found = np.empty(self.unknowns)
        for k, size in enumerate(self._trials):
            step = np.zeros(len(found))
            step[k] = size
            moved = np.concatenate([view.project(points) for view in self.moved(views, step)])
            found[k] = size / np.sqrt(((moved - places) ** 2).sum(axis=1).mean())
        return found

    @property
    def _trials(self) -> list[float]:
        """Small changes of the unknowns."""
        return [1e-6 if name.startswith(("turn", "distortion")) else 1e-3 for name in self.names]

    def moved(self, views: Sequence[View], step: Floats) -> tuple[View, ...]:
        """Return the views after a step (m,) of the unknowns."""
        columns = np.arange(POSE + LENS)
        spread, _ = self.spread(columns)
        changes = (spread @ step).reshape(len(views), -1)
        return tuple(self._moved(view, change) for view, change in zip(views, changes, strict=True))

    @property
    def _loose(self) -> list[tuple[int, int, float]]:
        """View, motion and standard uncertainty of every motion that a stand leaves a little freedom."""
        return [
            (k, motion, float(sigma))
            for k, stand in enumerate(self.stands)
            for motion, sigma in enumerate(stand.sigmas)
            if sigma > 0
        ]

    @property
    def redundant(self) -> Floats:
        """Return changes (m, r) that say nothing new: the stands of a rig moving together, which moves the part.

        They are weighted as the priors would share them out.
        """
        if self.poses != "common":
            return np.zeros((self.unknowns, 0))
        found = np.zeros((self.unknowns, POSE))
        together = np.zeros(POSE, dtype=np.int64)
        for row, (_, motion, sigma) in enumerate(self._loose, start=POSE):
            found[row, motion] = 1 / sigma**2
            together[motion] += 1
        found = found[:, together == len(self.priors)]
        return found / np.linalg.norm(found, axis=0)

    def _moved_stands(self, views: Sequence[View]) -> Floats:
        """Return how far each view has moved from its prior, (v, 6), about the datum.

        Of a rig whose place before the part is unknown, the motion of all views together does not count: the one that
        suits the priors best is taken out.
        """
        datum = np.array(self.datum)
        moved = np.empty((len(views), POSE))
        for row, view, prior in zip(moved, views, self.priors, strict=True):
            motion = prior.camera_from_cad.inverse() @ view.camera_from_cad
            row[:3], row[3:] = motion.rotation_vector, motion(datum[None])[0] - datum
        if self.poses == "common":
            weights = 1 / np.maximum([stand.sigmas for stand in self.stands], EXACT) ** 2
            moved -= (weights * moved).sum(axis=0) / weights.sum(axis=0)
        return moved

    def _moved(self, view: View, change: Floats) -> View:
        matrix = view.camera.matrix + np.array(
            [[change[6], change[15], change[8]], [0.0, change[7], change[9]], [0.0, 0.0, 0.0]]
        )
        camera = replace(view.camera, matrix=matrix, distortion=view.camera.distortion + change[10:15])
        return View(camera, view.camera_from_cad @ Pose.small(change[:6], self.origin))

    def offset(self, views: Sequence[View]) -> Floats:
        """Return how far the unknowns (m,) lie from their priors; zero for poses that have none."""
        found: list[float] = []
        if self.poses != "known":
            found += [0.0] * (POSE * (1 if self.poses == "common" else len(views)))
        if self.stands:
            moved = self._moved_stands(views)
            found += [float(moved[k, motion]) for k, motion, _ in self._loose]
        for lens, view, prior in zip(self.lenses, views, self.priors, strict=True):
            change = view.camera.matrix - prior.camera.matrix
            bent = view.camera.distortion - prior.camera.distortion
            ratio = prior.camera.matrix[1, 1] / prior.camera.matrix[0, 0]
            aspect = change[1, 1] - ratio * change[0, 0]
            offsets = np.array([change[0, 0], change[0, 2], change[1, 2], *bent, aspect, change[0, 1]])
            found += list(offsets[lens.sigmas > 0])
        return np.array(found)
