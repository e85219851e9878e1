"""The start that the pictures give by themselves, in words and figures; or why they give none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import Camera, View
from inspect3d.correlation.freedom import Lens
from inspect3d.correlation.overlay import overlay, reduced
from inspect3d.figure import Figure
from inspect3d.files.photograph import Photograph
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import Status
from inspect3d.pose import Pose
from inspect3d.register.alignment import Candidate, NoAlignmentError
from inspect3d.starting.answer import Answer, Trial
from inspect3d.starting.finder import FindStart
from inspect3d.starting.shown import Pictured

UNMARKED = np.zeros((0, 2))
MAD = 1.4826


@dataclass(frozen=True, eq=False)
class Scenery:
    """The part and its photographs.

    Parameters
    ----------
    nominal : the part as designed
    photographs : of it
    masks : of each, True where it may be used, or None
    """

    nominal: Nominal
    photographs: Sequence[Photograph]
    masks: Sequence[Booleans | None]


@dataclass(frozen=True, eq=False)
class Automatic:
    """A start that was found.

    Parameters
    ----------
    views : the cameras before the part
    symmetric : whether the part would look the same in another place
    remarks : what speaks for the start, a sentence each
    figures : the outline of the CAD over each photograph
    """

    views: tuple[View, ...]
    symmetric: bool
    remarks: tuple[str, ...]
    figures: tuple[Figure, ...]


def automatic(
    scenery: Scenery,
    cameras: Sequence[Camera],
    lenses: Sequence[Lens],
    rig: Sequence[View],
    cad_from_first: Pose | None,
) -> Automatic:
    """Return the start that the pictures give.

    Parameters
    ----------
    cameras, lenses : of each photograph the lens, perhaps a rough one, and how well it is known
    rig : the cameras in the frame of a known rig; else empty
    cad_from_first : the place of the first camera before the part, where the recipe states it and there is no rig

    Raises
    ------
    NoAlignmentError
        The part was not found in the pictures, or may be in several places, all of which are shown.
    """
    pictured = [
        Pictured(photograph.grey, mask, camera, lens)
        for photograph, mask, camera, lens in zip(scenery.photographs, scenery.masks, cameras, lenses, strict=True)
    ]
    said = FindStart(scenery.nominal)(pictured, rig, cad_from_first)
    small = [reduced(photograph.grey) for photograph in scenery.photographs]
    if not said.trials:
        raise NoAlignmentError(
            f"The part was not found in the pictures: in the best place, {100 * said.best.explained:.0f} % of the "
            f"points that they have in common lie on the CAD, and they agree on {100 * said.best.agreement.share:.0f} "
            "% of its surface. Check the CAD, its units and `focal`, or give four or more `landmarks`.",
            candidates=_candidates((said.best,), rig),
            figures=_figures(scenery, small, (said.best,)),
        )
    if len(said.trials) > 1:
        frame = "rig" if rig else "first camera (x right, y down, z along its axis)"
        raise NoAlignmentError(
            f"The part may be in {len(said.trials)} places before the cameras, and the pictures do not tell which: "
            'choose one by alignment = { start = "pose", matrix = ... } with the matrix of its candidate, the CAD from '
            f"the frame of the {frame}, mm; or give four or more `landmarks`.",
            Status.AMBIGUOUS,
            _candidates(said.trials, rig),
            _figures(scenery, small, said.trials),
        )
    best = said.trials[0]
    return Automatic(best.views, said.symmetric, (_words(said),), _figures(scenery, small, said.trials))


def _candidates(trials: Sequence[Trial], rig: Sequence[View]) -> tuple[Candidate, ...]:
    """Return where the trials put the part: the CAD from the rig, or from the first camera."""
    found = []
    for trial in trials:
        pose = trial.views[0].camera_from_cad.inverse()
        if rig:
            pose = pose @ rig[0].camera_from_cad
        distance = trial.fit.distance
        near: Floats = distance[np.isfinite(distance)]
        found.append(Candidate(pose, 1.0, float(MAD * np.median(near)) if len(near) else float("inf")))
    return tuple(found)


def _figures(scenery: Scenery, small: Sequence, trials: Sequence[Trial]) -> tuple[Figure, ...]:
    figures = []
    for number, trial in enumerate(trials, start=1):
        which = f"candidate {number}" if len(trials) > 1 else "start"
        for k, (view, picture) in enumerate(zip(trial.views, small, strict=True), start=1):
            words = f"The CAD model in the place of {which if len(trials) > 1 else 'the start'}, over picture {k}"
            name = f"{which.replace(' ', '_')}_picture_{k}"
            figures.append(overlay(name, words, scenery.nominal, view, picture, UNMARKED))
    return tuple(figures)


def _words(said: Answer) -> str:
    best = said.trials[0]
    words = (
        f"The start was found from the pictures alone: {100 * best.explained:.0f} % of the points that they have in "
        f"common and that lie before the CAD lie on it, and they agree on {100 * best.agreement.share:.0f} % of its "
        "visible surface."
    )
    if said.symmetric:
        words += " The CAD is symmetric; of the equal places the one that fits best was taken."
    return words
