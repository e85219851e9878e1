"""The start without a click, from the pictures to the cameras before the part."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from os import cpu_count

import numpy as np
from scipy.spatial import cKDTree

from inspect3d.arrays import Floats, unit
from inspect3d.camera import Camera, View
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.measure import Cloud
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from inspect3d.progress import running
from inspect3d.register.field import Field
from inspect3d.register.similarity import Similarity
from inspect3d.register.smooth import Smooth
from inspect3d.register.thinned import thinned
from inspect3d.starting.agreement import agreement
from inspect3d.starting.answer import Answer, Trial, answer, explained
from inspect3d.starting.bundle import Bundle
from inspect3d.starting.candidates import Candidates
from inspect3d.starting.contour import Contours
from inspect3d.starting.features import Features, features
from inspect3d.starting.fitting import FINAL, Fitted, fitted
from inspect3d.starting.further import with_further
from inspect3d.starting.outlined import weak_motions
from inspect3d.starting.relative import FEWEST, joined, relative, triangulated
from inspect3d.starting.shown import Pictured, Shown
from inspect3d.starting.tracks import tracks

NOISE = 0.3  # px of the reduced pictures, of a feature's place
CLOUD = 900  # points that stand for all where the part is searched
TRIED = 4  # places that are fitted to the outline and compared
FLAT = 3  # weak motions, from which on points lie on one flat face only
STRIDE = 2  # of them, every so many-th is fitted


@dataclass(frozen=True, eq=False)
class FindStart:
    """Find the cameras before the part from the pictures alone.

    Features that the pictures have in common give the places of the cameras relative to each other and a cloud of
    points, both up to a scale where the cameras are no known rig. The cloud is searched on the CAD; the best places are
    refined, cameras, lenses and points together, and ranked by how well points and pictures agree with the CAD.

    Parameters
    ----------
    nominal : the part as designed
    """

    nominal: Nominal

    def __call__(
        self, pictured: Sequence[Pictured], rig: Sequence[View] = (), cad_from_first: Pose | None = None
    ) -> Answer:
        """Return what the pictures say about the places of the cameras.

        Parameters
        ----------
        rig : the cameras in the frame of their rig, where that is known
        cad_from_first : where somebody says the first camera is, CAD from its frame; the others follow

        Raises
        ------
        MeasurementError
            A picture shows hardly any features, or the pictures have too little in common, or the first camera does
            not see the part from where it is said to be.
        """
        progress = running()
        progress.update(0.0, "looking for features")
        found = self._features(pictured)
        _require_features(found)
        progress.update(0.3, "matching features")
        noise = NOISE * max(each.step for each in found)
        pixels = self._tracks(pictured, found)
        progress.update(0.45, "placing the cameras relative to each other")
        contours = Contours(self.nominal.surface)
        whole = Shown.of(pictured, found, contours)
        placed, shown = tuple(range(len(pictured))), whole
        if rig:
            bundles: tuple[Bundle, ...] = (triangulated(rig, pixels, noise),)
        else:
            placed = tuple(sorted(joined(pixels)))
            if len(placed) < len(pictured):
                shown = Shown.of([pictured[k] for k in placed], [found[k] for k in placed], contours)
            common = pixels[:, placed]
            common = common[np.isfinite(common[:, :, 0]).sum(axis=1) >= 2]
            bundles = tuple(self._resized(each) for each in relative(shown.cameras, shown.lenses, common, noise))
        answers = []
        for k, bundle in enumerate(bundles):
            progress.update(0.55 + 0.4 * k / len(bundles), "searching the part")
            answers.append(self._answer(bundle, shown, bool(rig), cad_from_first, noise))
        said = max(answers, key=lambda each: (bool(each.trials), each.best.count * each.best.agreement.share))
        if shown is not whole:
            progress.update(0.95, "placing further cameras")
            said = self._completed(said, placed, whole, noise)
        progress.update(1.0, "searching the part")
        return said

    @cached_property
    def _smooth(self) -> Smooth:
        return Smooth(self.nominal.surface)

    @cached_property
    def _field(self) -> Field:
        return Field.of(self.nominal.surface)

    @staticmethod
    def _features(pictured: Sequence[Pictured]) -> list[Features]:
        with ThreadPoolExecutor(cpu_count()) as pool:
            return list(pool.map(lambda each: features(each.grey, each.mask), pictured))

    @staticmethod
    def _tracks(pictured: Sequence[Pictured], found: Sequence[Features]) -> Floats:
        rays = [each.camera.undistorted(own.pixels) for each, own in zip(pictured, found, strict=True)]
        return tracks(found, rays, [float(each.camera.matrix[0, 0]) for each in pictured])

    def _resized(self, bundle: Bundle) -> Bundle:
        """Return the bundle at about the size of the CAD, still in the frame of the first camera."""
        away = bundle.points - np.median(bundle.points, axis=0)
        axes = np.linalg.svd(away, full_matrices=False)[2]
        low, high = np.percentile(away @ axes.T, [1, 99], axis=0)
        scale = self.nominal.diagonal / float(np.linalg.norm(high - low))
        return bundle.placed(Similarity(Pose.identity(), scale))

    def _answer(self, bundle: Bundle, shown: Shown, scaled: bool, cad_from_first: Pose | None, noise: float) -> Answer:
        toward = unit(np.mean([view.centre for view in bundle.views], axis=0) - bundle.points)
        cloud = thinned(Cloud("the pictures", bundle.points, toward), CLOUD)
        few = cloud.every(STRIDE)
        part = bundle.chosen(cKDTree(bundle.points).query(few.points)[1])
        if cad_from_first is not None:
            places = [self._scaled(bundle, cad_from_first)]
        else:
            places = Candidates(self.nominal.surface, self._field)(cloud, bundle.views, shown.texture, scaled)
        freedom = _Free(shown.cameras, shown.lenses, scaled)
        surface, outline = self.nominal.surface, shown.outline
        fits = [fitted(part.placed(each), each.turned(few.normals), surface, freedom, noise) for each in places]
        merits = [explained(fit, surface)[0] * (1 - outline.unlike(fit.bundle.views, surface)) for fit in fits]
        best = np.argsort(merits)[::-1][:TRIED]
        trials = [self._trial(fits[k], places[k].turned(few.normals), freedom, shown, noise) for k in best]
        first = max(trials, key=lambda trial: trial.merit)
        for turned in _turned_about(first.fit, scaled):
            fit = fitted(turned.bundle, turned.normals, surface, freedom, noise, FINAL)
            trials.append(self._trial(fit, turned.normals, freedom, shown, noise))
        return answer(trials, self._smooth, lambda views: outline.unlike(views, surface))

    def _trial(self, fit: Fitted, normals: Floats, freedom: _Free, shown: Shown, noise: float) -> Trial:
        surface = self.nominal.surface
        bundle, _ = shown.outline.fitted(fit, surface, freedom.rigid)
        fit = fitted(bundle, normals, surface, freedom, noise, FINAL, shown.outline.lines)
        return self._judged(fit, shown)

    def _judged(self, fit: Fitted, shown: Shown) -> Trial:
        surface, views = self.nominal.surface, fit.bundle.views
        share, count = explained(fit, surface)
        agreed = agreement(surface, views, shown.stack, shown.masks)
        return Trial(fit, agreed, shown.outline.unlike(views, surface), shown.outline.met(views), share, count)

    def _completed(self, said: Answer, placed: Sequence[int], whole: Shown, noise: float) -> Answer:
        """Return the answer with the cameras that had no place yet, as what they see of the CAD tells."""
        surface, freedom = self.nominal.surface, _Free(whole.cameras, whole.lenses, False)
        ends = {}
        for trial in {id(each): each for each in (*said.trials, said.best)}.values():
            lines = whole.outline.lines
            fit = with_further(trial.fit, placed, whole.cameras, whole.features, surface, freedom, noise, lines)
            ends[id(trial)] = self._judged(fit, whole)
        return Answer(tuple(ends[id(trial)] for trial in said.trials), said.symmetric, ends[id(said.best)])

    def _scaled(self, bundle: Bundle, cad_from_first: Pose) -> Similarity:
        """Return the place that a stated place of the first camera gives: its lines of sight tell the scale."""
        centre = cad_from_first.translation
        sights = cad_from_first.turned(bundle.points)
        hits = self.nominal.surface.first_hit(centre, sights)
        met = hits.triangle >= 0
        if np.count_nonzero(met) < max(0.3 * len(met), 10):
            raise MeasurementError(
                "The first camera does not see the part from the place it is said to have: check alignment.matrix, "
                "which is the CAD from the frame of the first camera, mm (x right, y down, z along its axis)."
            )
        scale = float(np.median(hits.distance[met] / np.linalg.norm(sights[met], axis=1)))
        return Similarity(cad_from_first, scale)


def _require_features(found: Sequence[Features]) -> None:
    """Refuse a picture that is blank, or almost."""
    for number, each in enumerate(found, start=1):
        if len(each) < FEWEST:
            raise MeasurementError(
                f"Picture {number} shows {len(each)} features, and {FEWEST} are needed: is it of this part, sharp and "
                "well exposed, and is the part speckled?"
            )


@dataclass(frozen=True, eq=False)
class _Turned:
    """A bundle on the CAD, and the normals of its points."""

    bundle: Bundle
    normals: Floats


def _turned_about(fit: Fitted, scaled: bool) -> list[_Turned]:
    """Return the same points turned by a quarter, a half and three quarters where they lie on one flat face only.

    There the outline alone tells which way round the part is, and a way that was not searched could not be told from.
    """
    weak, centre = weak_motions(fit, scaled)
    if weak.shape[1] < FLAT:
        return []
    axis = unit(np.median(fit.feet.normals, axis=0))
    found = []
    for quarter in (1, 2, 3):
        motion = Similarity(Pose.small(np.append(quarter * np.pi / 2 * axis, np.zeros(3)), centre))
        found.append(_Turned(fit.bundle.placed(motion), motion.turned(fit.feet.normals)))
    return found


@dataclass(frozen=True, eq=False)
class _Free:
    """What may change about cameras at given places: their lenses, and the place of each, or of the rig."""

    cameras: tuple[Camera, ...]
    lenses: tuple[Lens, ...]
    rigid: bool

    def __call__(self, views: tuple[View, ...]) -> Freedom:
        priors = tuple(View(camera, view.camera_from_cad) for camera, view in zip(self.cameras, views, strict=True))
        return Freedom("common" if self.rigid else "free", self.lenses, priors, np.zeros(3))
