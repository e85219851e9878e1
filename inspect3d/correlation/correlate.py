"""Mesh-based stereocorrelation from pictures to the shape at every node."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import View
from inspect3d.correlation.disagreement import disagreement
from inspect3d.correlation.finer import quartered
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.correlation.hidden import hidden_motions
from inspect3d.correlation.normal import Facets, facets
from inspect3d.correlation.picture import Interpolation, Pictures
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.seen import scene
from inspect3d.correlation.shape import Shape
from inspect3d.correlation.shift import needed_columns
from inspect3d.correlation.solver import COARSE, Solver, held
from inspect3d.correlation.splines import Splines
from inspect3d.correlation.state import ON_NOMINAL, Level, State, Step
from inspect3d.correlation.still import SOFT, in_gauge, slid
from inspect3d.correlation.systematic import Systematic
from inspect3d.correlation.texture import speckle_size
from inspect3d.correlation.uncertainty import Uncertainty, uncertainty
from inspect3d.correlation.ways import JOINT, PLACED, SHAPE, SPLINES
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import MeasurementError
from inspect3d.register.gauge import FREE
from inspect3d.threads import blas_of_one_thread

NOISY = 25.0
STEEPEST_TILT = 0.2
ENOUGH = 0.3
DOTS = 3.0  # of the speckle along an edge
UNFIT = 0.08  # of the facets; real pictures have up to 0.06 where elements fit
ALIKE = 4.0  # times what independent residuals add up to; real pictures have 2 to 3 where elements fit
BETTER = 0.8  # of what was missed before: else a finer mesh is of no use
FRAYED, CLEAR = 3.0, 0.999
ROUNDS = 5
FARTHEST = 12.0  # px, twice the first blur: no start that leads anywhere is off by so much


@dataclass(frozen=True, eq=False)
class _Fit:
    """What the pictures show of a scene: shape and cameras, the facets there, what may change, and how sure it is."""

    seen: Scene
    state: State
    found: Facets
    freedom: Freedom
    sure: Uncertainty
    systematic: Systematic | None


@dataclass(frozen=True)
class Correlate:
    """Settings of stereocorrelation.

    Parameters
    ----------
    levels : the way from coarse to fine; none: `SHAPE` or `SPLINES` where the cameras are known, else `JOINT`
        or `PLACED`
    pixels : px of the largest picture that one evaluation point stands for
    per_edge : evaluation points along the edge of every facet, in place of `pixels`; the paper has 6
    interpolation : of the pictures between their pixels; the paper has "linear"
    lifted : evaluation points on the nominal surface; else on flat facets as in the paper, wrong by the chord
    steepest : degrees, largest angle between a normal and the line of sight
    poorest : least correlation coefficient of a facet that counts
    systematic : a smooth systematic shift of the pictures, carried into the uncertainty; where the pictures disagree by
        more than a shift of that size may by chance, by as much as they do
    smoothing : stiffness of a plate that smooths the map when it has been found, in medians of the nodes' own; 0: none
    splines : nodes move as the control points of the CAD's own NURBS faces have it; none: each by itself

    Where the elements do not follow the part they are cut in four for the measurement, again and again while that helps
    and leaves them three dots of the speckle wide: what they miss would pull at unknown cameras. The map is that of the
    nodes of the inspection mesh.
    """

    levels: tuple[Level, ...] | None = None
    pixels: float = 2.5
    per_edge: int | None = None
    interpolation: Interpolation = "cubic"
    lifted: bool = True
    steepest: float = 65.0
    poorest: float = 0.7
    systematic: Systematic | None = None
    smoothing: float = 0.0
    splines: Splines | None = None

    @blas_of_one_thread
    def __call__(
        self,
        nominal: Nominal,
        grey: Sequence[Floats],
        views: Sequence[View],
        freedom: Freedom | None = None,
        masks: Sequence[Booleans | None] | None = None,
        told: Callable[[Step], None] = lambda step: None,
    ) -> Shape:
        """Return the shape that the pictures show.

        Parameters
        ----------
        grey : of each view its picture (rows, columns), grey levels
        views : the cameras, or where to start them
        freedom : what is not known about the cameras; none: they are known
        masks : of each view, True where its picture may be used, or None
        told : called after each step

        Raises
        ------
        MeasurementError
            The pictures do not show the part, or not twice, or disagree all over.
        """
        pictures = Pictures(grey, self.interpolation)
        _require_sizes(pictures, views)
        _require_different(pictures)
        loose = freedom is not None and freedom.unknowns > 0
        seen = self._scene(nominal, views, masks, loose)
        _require_coarse(seen, pictures, views)
        known = Freedom("known", tuple(Lens() for _ in views), tuple(views), seen.centre)
        freedom = freedom or known
        alone, joint = (SHAPE, PLACED) if self.splines is None else (SPLINES, JOINT)
        joint = joint if freedom.poses == "free" else JOINT
        levels = self.levels or (joint if freedom.unknowns else alone)
        coarse = levels[:-1]
        calibrating = tuple(takewhile(lambda level: level.moves in ON_NOMINAL, coarse))
        slides = SOFT if freedom.poses == "free" else FREE
        state = Solver(calibrating, COARSE, slides=slides)(seen, pictures, views, freedom, told=told)
        if slides < SOFT and slid(seen, views, state.views) > FARTHEST:
            state = Solver(calibrating, COARSE, slides=SOFT)(seen, pictures, views, freedom, told=told)
        calibrated = state.views if calibrating else None
        to_end = self.splines is None or freedom.unknowns > 0
        state = Solver(coarse[len(calibrating) :], ends=to_end)(seen, pictures, state.views, freedom, told=told)
        start = state.deviation
        if freedom.unknowns:  # the cameras have moved, and with them the outline of the part in the pictures
            before, seen = seen, self._scene(nominal, state.views, masks, loose)
            start = seen.carried(before, start, np.repeat(np.arange(len(nominal.mesh)), 2).reshape(-1, 2))
        fit = self._fitted(seen, pictures, state.views, freedom, start, levels[-1], told)
        finer, owner, quarterings = nominal, np.arange(len(nominal.mesh)), 0
        while _missed(fit.sure) > 1 and self._divisible(fit, pictures):
            finer, ends = quartered(finer)
            seen = self._scene(finer, fit.state.views, masks, loose)
            start = seen.carried(fit.seen, fit.state.deviation, ends)
            try:
                other = self._fitted(seen, pictures, fit.state.views, freedom, start, levels[-1], told)
            except MeasurementError:  # the pictures do not bear a finer mesh; the map of this one stands
                break
            if _missed(other.sure) > BETTER * _missed(fit.sure):
                break
            fit, owner, quarterings = other, owner[ends[:, 0]], quarterings + 1
        seen, state, sure, last = fit.seen.of_nodes(owner), fit.state, fit.sure, fit.freedom
        local = float(np.sqrt(np.median(sure.system.motion.quadratic(seen.space.rows(seen)))))
        motions = hidden_motions(seen, sure.system, last, local)
        if last.poses != "known" and not seen.space.confined:
            found_views, deviation = in_gauge(seen, last, state.views, state.deviation)
            state = replace(state, views=found_views, motion=deviation, deviation=deviation)
        if self.smoothing > 0:
            sure = sure.smoothed(seen, fit.found, state.weights, state.motion, self.smoothing)
        return Shape(nominal.mesh, seen, state, sure, motions, fit.found, calibrated, fit.systematic, quarterings)

    def _fitted(
        self,
        seen: Scene,
        pictures: Pictures,
        views: Sequence[View],
        freedom: Freedom,
        start: Floats,
        level: Level,
        told: Callable[[Step], None],
    ) -> _Fit:
        """Return what the pictures show without blur, from cameras and a deviation (n,) that are near it."""
        fine = Solver((level,), systematic=self.systematic)
        ended = freedom.unknowns > 0 or self.splines is not None
        hasty = fine if ended else replace(fine, tolerance=COARSE)
        last = freedom if level.moves == "both" else held(freedom)
        state = hasty(seen, pictures, views, freedom, start, told)
        found = self._found(seen, pictures, state, last)
        for _ in range(ROUNDS):
            good = self._good(seen, found) & (seen.tilt(state.deviation) <= STEEPEST_TILT)
            if good.all() and ended:
                break
            _require_some(good, found)
            node = np.arange(len(seen.nodes))
            if not good.all():
                seen, node = seen.restricted(good)
            state = fine(seen, pictures, state.views, freedom, state.deviation[node], told)
            found, ended = self._found(seen, pictures, state, last), True
        size, systematic = 0.0, self.systematic
        if systematic is not None:
            systematic = systematic.at_least(disagreement(seen, pictures.sharp, state.views, state.motion), seen)
            size = systematic.size
        sure = uncertainty(
            seen, found, state.views, state.weights, last, self.systematic, size, state.shift, state.motion
        )
        return _Fit(seen, state, found, last, sure, systematic)

    def _divisible(self, fit: _Fit, pictures: Pictures) -> bool:
        """Tell whether the facets, cut in four, are still three dots of the speckle wide."""
        dot, edge = _dot_and_edge(fit.seen, pictures, fit.state.views)
        return self.splines is None and edge >= 2 * DOTS * dot

    def _scene(
        self, nominal: Nominal, views: Sequence[View], masks: Sequence[Booleans | None] | None, loose: bool
    ) -> Scene:
        masks = masks or [None] * len(views)
        seen = scene(
            nominal,
            views,
            self.pixels,
            np.radians(self.steepest),
            masks,
            self.per_edge,
            self.lifted,
            self.splines is None,
        )
        seen = replace(seen, loose=loose)
        return seen if self.splines is None else self.splines(nominal, seen)

    def _found(self, seen: Scene, pictures: Pictures, state: State, freedom: Freedom) -> Facets:
        """Return what the pictures say about the facets in the end, as `uncertainty` needs it."""
        return facets(
            seen,
            pictures.sharp,
            state.views,
            state.motion,
            state.weights,
            needed_columns(freedom, self.systematic),
            power=2,
            whole=self.systematic is not None and freedom.unknowns > 0,
            origin=freedom.origin,
        )

    def _good(self, seen: Scene, found: Facets) -> Booleans:
        """Tell which facets agree between the pictures, (f,).

        At the edge of what is seen it takes more. What only priors tell about the cameras lets the pictures agree and
        slip over the part together: its outline is then not where they say, and the background shines in.
        """
        median = np.median(found.noise)
        frayed = seen.rim & (found.noise > FRAYED * median) & (found.correlation < CLEAR)
        return (found.correlation >= self.poorest) & (found.noise <= NOISY * median) & ~frayed


def _require_coarse(seen: Scene, pictures: Pictures, views: Sequence[View]) -> None:
    """Refuse facets that are smaller than the dots of the speckle: they show nothing to compare."""
    dot, edge = _dot_and_edge(seen, pictures, views)
    sides = seen.triangles[:, :2]
    if edge < dot:
        size = float(np.median(np.linalg.norm(seen.nodes[sides[:, 1]] - seen.nodes[sides[:, 0]], axis=1)))
        raise MeasurementError(
            f"The mesh is too fine for the speckle: its elements are {edge:.1f} px wide in the pictures, and the dots "
            f"{dot:.1f} px. Choose an element_size of {size * DOTS * dot / edge:.2g} mm or more (it is {size:.2g} mm), "
            "or paint a finer speckle."
        )


def _missed(sure: Uncertainty) -> float:
    """Return how much elements miss of a part, over what is little: some facets, or residuals that add up all over."""
    return max((1 - sure.fitting) / UNFIT, sure.correlated / ALIKE)


def _dot_and_edge(seen: Scene, pictures: Pictures, views: Sequence[View]) -> tuple[float, float]:
    """Return the size of the speckle's dots and the length of the facets' edges, px, where these are nearest."""
    dots, edges = [], []
    sides = seen.triangles[:, :2]
    for grey, view in zip(pictures.grey, views, strict=True):
        places = view.project(seen.nodes)
        dots.append(speckle_size(np.asarray(grey, dtype=np.float64), places))
        edges.append(float(np.median(np.linalg.norm(places[sides[:, 1]] - places[sides[:, 0]], axis=1))))
    return max(dots), min(edges)


def _require_sizes(pictures: Pictures, views: Sequence[View]) -> None:
    if len(pictures.grey) != len(views):
        raise MeasurementError(
            f"There are {len(pictures.grey)} pictures and {len(views)} cameras: each needs the other."
        )
    for number, (grey, view) in enumerate(zip(pictures.grey, views, strict=True), start=1):
        if grey.shape[::-1] != view.camera.size:
            raise MeasurementError(
                f"Picture {number} has {grey.shape[1]} x {grey.shape[0]} pixels, its camera "
                f"{view.camera.size[0]} x {view.camera.size[1]}: calibrate with pictures of the same size."
            )


def _require_different(pictures: Pictures) -> None:
    for k, one in enumerate(pictures.grey):
        for other in range(k):
            if np.array_equal(one, pictures.grey[other]):
                raise MeasurementError(
                    f"The pictures of cameras {other + 1} and {k + 1} are the same: each camera needs its own picture."
                )


def _require_some(good: Booleans, found: Facets) -> None:
    if good.mean() < ENOUGH:
        raise MeasurementError(
            f"The pictures agree on a shape near the nominal one on {100 * good.mean():.0f} % of the surface only "
            f"(median correlation {np.median(found.correlation):.2f}): check that they show this part with its "
            "speckle, in the order of the cameras, and that these start within half a speckle of where they belong."
        )
