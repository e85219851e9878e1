"""The decision where the part is: found, one of several, or not at all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.nominal.surface import Surface
from inspect3d.pose import Pose
from inspect3d.register.choice import choose
from inspect3d.register.icp import Fit, RobustIcp
from inspect3d.register.landmarks import pose_from_landmarks
from inspect3d.register.similarity import Similarity
from inspect3d.register.smooth import Smooth
from inspect3d.register.symmetry import is_symmetry, surface_points
from inspect3d.register.thinned import Thinned
from inspect3d.starting.agreement import Agreement
from inspect3d.starting.fitting import Fitted

ON = 2e-3  # share of the CAD's diagonal within which a point lies on it
BELIEVED = 0.7  # least share of the points before the CAD that lie on it, and of its surface on which pictures agree
WORSE = 0.15  # share by which agreement or outline must fall behind to rule a start out
MISSING = 0.06  # and share by which the points on the CAD must
SLIGHT = 0.01  # share of the points, below which a place is no worse, however sure it is that it is
TIED = 0.03  # of the outline, below which two places are alike
OVERLAP = 1000  # points of the CAD that are laid on it again
SLID, ALIKE = 0.01, 0.8  # share of the diagonal within which, and share of them that then lie on it
NEAR = 0.05  # share of the diagonal by which a place may be off a symmetry
APART = 0.03  # share of the diagonal below which two starts are the same


@dataclass(frozen=True, eq=False)
class Trial:
    """A start that was refined, and what speaks for it.

    Parameters
    ----------
    fit : cameras and points on the CAD
    agreement : of the pictures on the nominal surface
    unlike : share of the part that would appear beside the texture, and of the features beside the part
    outlined : share of the part's outline that the pictures show where it should be
    explained : share of the points before the CAD that lie on it
    count : of the points that lie on it
    """

    fit: Fitted
    agreement: Agreement
    unlike: float
    outlined: float
    explained: float
    count: int

    @property
    def views(self) -> tuple[View, ...]:
        """Return the cameras before the part."""
        return self.fit.bundle.views

    @property
    def believed(self) -> bool:
        """Tell whether points and pictures both lie on the CAD."""
        return min(self.explained, self.agreement.share) >= BELIEVED

    @property
    def merit(self) -> float:
        """Return what speaks for the start as one number, 0 to 1."""
        return self.explained * self.agreement.share * max(1 - self.unlike, 0.0) * (1 + self.outlined) / 2


@dataclass(frozen=True, eq=False)
class Answer:
    """What the trials say.

    Parameters
    ----------
    trials : those that the data cannot tell apart, best first; of equivalent ones only the best
    symmetric : whether the part looks the same in other places
    best : what came nearest, where there is none
    """

    trials: tuple[Trial, ...]
    symmetric: bool
    best: Trial


def answer(trials: Sequence[Trial], smooth: Smooth, unlike: Callable[[Sequence[View]], float]) -> Answer:
    """Return which of the trials, all of the same points, the data choose.

    A trial that the pictures contradict is ruled out by their agreement on the nominal surface, or by its outline; the
    rest are compared point by point, see `choose`. Those that a symmetry of the CAD or a free motion makes equal are
    one, the best of them. Places between which no way leads along which the outline fits are several.

    Parameters
    ----------
    unlike : how badly the outline fits with cameras in given places
    """
    ranked = sorted(trials, key=lambda trial: -trial.merit)
    best = ranked[0]
    if not best.believed:
        return Answer((), False, best)
    kept: list[Trial] = []
    for trial in ranked:
        behind = (
            best.agreement.share - trial.agreement.share,
            trial.unlike - best.unlike,
            best.outlined - trial.outlined,
        )
        unexplained = best.explained - trial.explained
        if max(behind) < WORSE and unexplained < MISSING and all(_apart(trial, other, smooth) for other in kept):
            kept.append(trial)
    fits = [_as_fit(trial, kept[0], smooth) for trial in kept]
    choice = choose(fits, smooth, kept[0].fit.bundle.points)
    of = {id(fit): trial for fit, trial in zip(fits, kept, strict=True)}
    least = min(_cost(fit, smooth) for fit in fits)
    close = [fit for fit in choice.others if _cost(fit, smooth) < least + SLIGHT]
    equal = sorted((of[id(fit)] for fit in (*choice.equivalent, *close)), key=lambda trial: -trial.merit)
    rivals = [of[id(fit)] for fit in choice.rivals if of[id(fit)].believed]
    rivals += [trial for trial in equal[1:] if _barred(equal[0], trial, smooth.surface, unlike)]
    twins = [trial for trial in rivals if _twin(equal[0], trial, smooth.surface)]
    rivals = [trial for trial in rivals if trial not in twins]
    symmetric = choice.by_symmetry or bool(twins)
    return Answer((max((equal[0], *twins), key=lambda trial: trial.merit), *rivals), symmetric, best)


def _cost(fit: Fit, smooth: Smooth) -> float:
    """Return the share of the points off the CAD, those near it counting in part."""
    return float(fit.cost(ON * smooth.surface.diagonal).mean())


def _twin(one: Trial, other: Trial, surface: Surface) -> bool:
    """Tell whether a symmetry of the CAD makes two places one, but for what the points leave free."""
    motion = pose_from_landmarks(one.fit.bundle.points, other.fit.bundle.points)
    whole = Thinned(*surface_points(surface, OVERLAP), oriented=True)
    brought = RobustIcp(steps=30, still=0.01, first_width=NEAR * surface.diagonal)(whole, surface, Similarity(motion))
    return is_symmetry(surface, brought.pose.pose)


def _barred(one: Trial, other: Trial, surface: Surface, unlike: Callable[[Sequence[View]], float]) -> bool:
    """Tell whether the outline fits in both places as well, but not half-way: then no free motion joins them.

    A symmetry of the CAD may, as one that swaps the ends of a piece of a cylinder, which has slid a little besides.
    """
    if other.unlike > one.unlike + TIED or not other.believed:
        return False
    points = one.fit.bundle.points
    motion = pose_from_landmarks(points, other.fit.bundle.points)
    if all(_overlap(surface, there) > ALIKE for there in (motion, motion.inverse())):
        return False
    centre = points.mean(axis=0)
    shift = motion(centre[None])[0] - centre
    half = Pose.small(np.concatenate([motion.rotation_vector / 2, shift / 2]), centre).inverse()
    views = [replace(view, camera_from_cad=view.camera_from_cad @ half) for view in one.views]
    return unlike(views) > other.unlike + TIED


def _overlap(surface: Surface, motion: Pose) -> float:
    """Return the share of the CAD that lies on it after a motion."""
    points, normals = surface_points(surface, OVERLAP)
    feet = surface.closest(motion(points))
    cosine = np.einsum("ni,ni->n", motion.turned(normals), feet.normals)
    return float(((np.abs(feet.distance) < SLID * surface.diagonal) & (cosine > 0.5)).mean())


def _apart(one: Trial, other: Trial, smooth: Smooth) -> bool:
    away = one.fit.bundle.points - other.fit.bundle.points
    return bool(np.sqrt((away**2).sum(axis=1).mean()) > APART * smooth.surface.diagonal)


def _as_fit(trial: Trial, first: Trial, smooth: Smooth) -> Fit:
    """Return a trial as a fit of the points as the first trial has them."""
    points, agrees = trial.fit.bundle.points, trial.fit.agrees
    pose = pose_from_landmarks(first.fit.bundle.points, points)
    part = agrees & ~trial.fit.feet.on_rim
    scale = float(np.median(np.abs(trial.fit.feet.distance[part]))) if part.any() else smooth.surface.diagonal
    return Fit(Similarity(pose), trial.fit.feet, agrees, 1.4826 * scale)


def explained(fit: Fitted, surface: Surface) -> tuple[float, int]:
    """Return the share of the points before the CAD that lie on it, and their count.

    A point is before or behind the CAD if the line of sight of a camera through it meets the CAD anywhere; others are
    background.
    """
    points = fit.bundle.points
    on = fit.distance < ON * surface.diagonal
    meets = np.zeros(len(points), bool)
    for k, view in enumerate(fit.bundle.views):
        seen = np.flatnonzero(fit.bundle.seen[:, k])
        sights: Floats = points[seen] - view.centre
        meets[seen] |= surface.first_hit(view.centre, sights).triangle >= 0
    count = int(np.count_nonzero(on))
    return count / max(int(np.count_nonzero(meets | on)), 1), count
