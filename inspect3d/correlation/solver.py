"""Gauss-Newton for shape and cameras, coarse to fine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats, Integers
from inspect3d.camera import View
from inspect3d.correlation.bounded_step import bounded, bounded_step, reach
from inspect3d.correlation.conjugate import conjugate
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.correlation.linear import noise_of, robust, slides_of, system_of
from inspect3d.correlation.normal import Facets, facets
from inspect3d.correlation.picture import Pictures, Stack
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.shift import Shift, needed_columns, shift_blocks, shift_of
from inspect3d.correlation.space import Factored
from inspect3d.correlation.state import ON_NOMINAL, Level, State, Step
from inspect3d.correlation.still import across_in_pictures, slides_in_pictures, still_in_pictures, stilled
from inspect3d.correlation.systematic import Systematic
from inspect3d.outcome import MeasurementError
from inspect3d.register.gauge import FREE

SHORTER, LONGER, LEAST, PATIENCE = 0.5, 1.2, 0.02, 4
WORSE = 1.02  # times the variance of the residuals before it: a step that leads to more went too far
FINE, COARSE = 1e-5, 5e-4  # mm
FINE_FEW, COARSE_FEW = 1e-4, 3e-3  # mm, for unknowns fewer than the nodes, whose steps shrink many times each
SETTLED = 0.005  # share of what the cameras leave open about the shape: a shorter step changes nothing of note
RUNAWAY = 0.3  # of the extent of what is seen: a step that large leads nowhere
FARTHEST = 1.0  # px, or the blur: a step of the cameras moves the pictures no farther, of shape and cameras apart
MOST, MOST_PLAIN = 6, 30  # steps of conjugate gradients, with the factor of a similar matrix and with the diagonal


@dataclass(frozen=True)
class Solver:
    """The way from coarse to fine, and when to stop.

    Parameters
    ----------
    levels : in their order
    systematic : a smooth shift of the pictures, which unknown cameras share out between themselves and it where the
        pictures are not blurred and cameras and shape move: cameras that took it all would run far off their priors
    tolerance : mm; the last level ends when no node moves farther in a step, or by more than half a per cent of the
        uncertainty that unknown cameras give the shape; the others at half a micrometre, times the pixels of the blur.
        Where the nodes do not move by themselves it takes a tenth of a micrometre, and three
    slides : share of the stiffest motion's stiffness below which a motion of the part, while the poses alone move, is
        taken for a slide of the surface in itself, and held
    ends : the last level is the end of the way; else it stops where the others do

    After four steps of a level, one that turns back is halved, and so are the next until they go on: where the
    pictures show a motion weakly, a full step goes too far and the next comes back. A step after which the residuals
    are larger is taken back and halved. The robust weights of the facets settle in the first steps of a level and then
    only fall, lest they take turns: a facet over which the outline of the part has come counts no more as it did.
    Blurred pictures show less, and are compared at fewer points: one of 1 + 1.5 blur².
    """

    levels: tuple[Level, ...]
    tolerance: float = FINE
    systematic: Systematic | None = None
    slides: float = FREE
    ends: bool = True

    def __call__(
        self,
        scene: Scene,
        pictures: Pictures,
        views: Sequence[View],
        freedom: Freedom,
        start: Floats | None = None,
        told: Callable[[Step], None] = lambda step: None,
    ) -> State:
        """Return the shape and the cameras that agree best with the pictures.

        Parameters
        ----------
        views : the start
        freedom : what may change about the cameras
        start : (n,) mm, deviation to start from; none: the nominal shape
        told : called after each step

        Raises
        ------
        MeasurementError
            The pictures say nothing about the part.
        """
        space = scene.space
        motion = space.motion(scene, np.zeros(len(scene.nodes)) if start is None else start)
        state = State(motion, space.rows(scene) @ motion, tuple(views), np.ones(len(scene.triangles)))
        stacks: dict[float, Stack] = {}
        for number, level in enumerate(self.levels):
            if level.blur not in stacks:
                stacks = {level.blur: pictures.blurred(level.blur) if level.blur > 0 else pictures.sharp}
            state = self._descended(scene, stacks[level.blur], state, freedom, number, told)
        return state

    def _descended(
        self, scene: Scene, stack: Stack, state: State, freedom: Freedom, number: int, told: Callable[[Step], None]
    ) -> State:
        level = self.levels[number]
        if level.moves in ("shape", "poses", "placed"):
            freedom = held(freedom, poses=level.moves == "shape")
        points = scene.points.thinned(1 + int(1.5 * level.blur**2)) if level.blur >= 1 else scene.points
        final = self.ends and number == len(self.levels) - 1
        fine, coarse = (FINE_FEW, COARSE_FEW) if scene.space.confined else (0.0, COARSE)
        tolerance = max(self.tolerance, fine if final else coarse * max(1.0, level.blur))
        last, factor = np.zeros(len(state.motion)), 1.0
        rows = scene.space.rows(scene)
        shared = self.systematic if final and freedom.unknowns and level.moves == "both" else None
        columns = needed_columns(freedom, shared)
        known = None if shared is None else shift_of(scene, state.views, shared)
        similar: Factored | None = None
        before: _Stride | None = None
        for count in range(level.steps):
            found = facets(
                scene,
                stack,
                state.views,
                state.motion,
                state.weights,
                columns,
                whole=known is not None,
                points=points,
                origin=freedom.origin,
            )
            if not np.isfinite(found.noise).any():
                raise MeasurementError(
                    "The pictures show no grey levels that vary where the part should be: check that they are of this "
                    "part, exposed right, and that the cameras stand where they are said to."
                )
            noise = noise_of(found, state.weights, len(state.motion))
            if before is not None and noise > WORSE * before.noise and factor > LEAST:
                factor = max(factor * SHORTER, LEAST)
                state = replace(before(freedom, factor), weights=before.state.weights)
                continue
            sure = 0.0
            if freedom.unknowns or level.moves in ON_NOMINAL:
                shape, cameras, shift, sure = _step(
                    scene, found, noise, state, freedom, level, columns, known, self.slides
                )
            else:
                cameras, shift = np.zeros((2, 0))
                shape, similar = _step_of_shape(scene, found, noise, state, level, similar)
            if freedom.unknowns and level.moves not in ON_NOMINAL:
                shape, cameras = bounded(scene, state, freedom, shape, cameras, max(level.blur, FARTHEST))
            change = max(
                float(np.abs(rows @ shape)[~scene.slivers].max(initial=0.0)),
                reach(scene, cameras, freedom) if level.moves in ON_NOMINAL else 0,
            )
            if count >= PATIENCE:
                factor = max(factor * SHORTER, LEAST) if shape @ last < 0 else min(factor * LONGER, 1.0)
            if not change < RUNAWAY * scene.extent:
                raise MeasurementError(
                    "The solution runs away from the nominal shape: check that the pictures show this part with its "
                    "speckle, in the order of the cameras, and that these start within half a speckle of where they "
                    "belong."
                )
            step = Step(level, change, float(np.sqrt(noise)))
            told(step)
            weights = robust(found) if count < PATIENCE else np.minimum(state.weights, robust(found))
            settled = change < max(tolerance, SETTLED * sure)
            state = replace(state, steps=(*state.steps, step), settled=settled, shift=shift)
            stride = _Stride(state, rows, shape, cameras, noise)
            state = replace(stride(freedom, factor), weights=weights)
            if state.settled:
                break
            last = shape
            before = stride if freedom.unknowns else None
        return state


@dataclass(frozen=True, eq=False)
class _Stride:
    """A step from a state, which it is told of already, and the variance of the residuals there."""

    state: State
    rows: sparse.csr_matrix
    shape: Floats
    cameras: Floats
    noise: float

    def __call__(self, freedom: Freedom, factor: float) -> State:
        """Return the state after a share of the step."""
        motion = self.state.motion + factor * self.shape
        views = freedom.moved(self.state.views, factor * self.cameras)
        return replace(self.state, motion=motion, deviation=self.rows @ motion, views=views)


def held(freedom: Freedom, poses: bool = True) -> Freedom:
    """Return the freedom of cameras whose lenses may not change, nor their poses."""
    exact = tuple(Lens() for _ in freedom.lenses)
    return replace(freedom, poses="known" if poses else freedom.poses, lenses=exact, stands=())


def _step(
    scene: Scene,
    found: Facets,
    noise: float,
    state: State,
    freedom: Freedom,
    level: Level,
    columns: Integers,
    known: Shift | None,
    share: float,
) -> tuple[Floats, Floats, Floats, float]:
    """Return the step of shape and cameras, the shift, and the rms uncertainty (mm) that the cameras give the shape.

    Parameters
    ----------
    columns : camera parameters of each view in `found`
    known : of a smooth shift of the pictures, which is found along with the cameras and anew in each step
    share : below which motions are slides while poses move, see `Solver`
    """
    mixing, sigmas = freedom.spread(columns)
    scale = freedom.scale(state.views, scene.sample)
    slides = slides_of(scene, freedom, state.views, share if level.moves == "poses" else FREE)
    camera_right = mixing.T @ found.camera_right / noise - freedom.offset(state.views) / sigmas**2
    if level.moves in ON_NOMINAL:
        matrix = mixing.T @ found.camera @ mixing / noise + np.diag(1 / sigmas**2)
        across = slides / scale[:, None] ** 2
        if freedom.poses == "free":
            across = across_in_pictures(scene, freedom, state.views, slides)
        firm = np.linalg.svd(across * scale[:, None])[0][:, slides.shape[1] :] * scale[:, None]
        cameras = bounded_step(
            scene, state.views, freedom, firm, firm.T @ matrix @ firm, camera_right, max(level.blur, FARTHEST)
        )
        return np.zeros(len(state.motion)), cameras, np.zeros(0), 0.0
    factors, blocks = state.weights * found.clean, None
    if known is not None:
        blocks = shift_blocks(scene, found, columns, mixing, known, factors / noise, state.weights / noise)
        camera_right = np.concatenate([camera_right, blocks.right])
    placing = freedom.poses == "free" or (freedom.poses == "common" and level.blur == 0)
    still = slides_in_pictures(scene, freedom, state.views, slides)
    if placing and still is None:
        still = still_in_pictures(scene, freedom, state.views)
    system = system_of(
        scene, found, factors, noise, freedom, columns, scale, slides, level.stiffness, blocks, still=still
    )
    shape, together = system.solve(_right(scene, found, noise, state, level), camera_right)
    cameras, shift = np.split(together, [len(sigmas)])
    if placing and scene.space.confined:
        shape, cameras = stilled(scene, freedom, state.views, state.deviation, shape, cameras)
    by_cameras = (scene.space.rows(scene) @ system.following @ system.factor_by_cameras)[scene.whole]
    return shape, cameras, shift, float(np.sqrt((by_cameras**2).sum() / max(len(by_cameras), 1)))


def _step_of_shape(
    scene: Scene, found: Facets, noise: float, state: State, level: Level, similar: Factored | None
) -> tuple[Floats, Factored | None]:
    """Return the step with the cameras held, and a factor that may serve the next step as one of before may this.

    Without a plate that is stiffer than the pictures the diagonal comes so near to the matrix that it takes none.
    """
    right = _right(scene, found, noise, state, level)
    matrix, shape = scene.space.matrix(scene, _blocks(found, noise, state), level.stiffness), None
    if level.stiffness <= 1 and not scene.space.confined:
        diagonal = matrix.diagonal()
        shape = conjugate(matrix, right, lambda rest: rest / diagonal, MOST_PLAIN)
    if shape is None and similar is not None:
        shape = conjugate(matrix, right, similar.solve, MOST)
    if shape is None:
        similar = scene.space.factored(scene, matrix)
        shape = similar.solve(right)
    return shape, similar


def _right(scene: Scene, found: Facets, noise: float, state: State, level: Level) -> Floats:
    """Return the right-hand side (k,) of the shape, with the plate of the level."""
    plate = scene.space.plate(scene, _blocks(found, noise, state), level.stiffness)
    return scene.space.gathered(scene, found.right * (state.weights / noise)[:, None]) - plate @ state.motion


def _blocks(found: Facets, noise: float, state: State) -> Floats:
    """Return the normal matrices (f, 3, 3) 1/mm² of the facets' corners."""
    return found.node * (state.weights * found.clean / noise)[:, None, None]
