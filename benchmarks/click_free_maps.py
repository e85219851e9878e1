"""The map from a start that was found against the map from picks, as `inspect3d run` makes both from these starts.

Two starts put the part some pixels apart along its own surface, where the pictures hardly tell it: its motions and its
growth, all cameras going along, change no picture. The nodes then stand on other places of the part and see other noise
of the pictures, and a tenth of an element is enough for half a sigma. Where the maps differ as they are, they are
compared once more in one place: the cameras from picks are moved along these seven motions to where its nodes appear as
near as can be to those from the start, and both shapes are found again, the cameras from each start held.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from click_free_scenes import RandomScene, nominal

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.linear import gauge_of, motions_of, moving_cameras
from inspect3d.correlation.seen import scene as scene_of
from inspect3d.correlation.shape import Shape
from inspect3d.correlation.start import Begin
from inspect3d.correlation.stereo import PickedPoint, Stereo
from inspect3d.correlation.ways import SHAPE
from inspect3d.files.photograph import Photograph
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import MeasurementError

CLICK = 1.5  # px, standard error of a pick
PICKS = 8
ROUNDS, SMALL = 3, 1e-4  # of steps to one place, and a step by which slopes are taken
STEEPEST = 65.0  # degrees, as the recipe has it unless told
RMS, FAR, SHARE = 0.5, 1.0, 0.99
"""Two maps of the same pictures are the same if their difference, in the standard uncertainty of a node, has an rms of
at most 0.5 and is below 1 at 99 % of the nodes. Both have the same noise, so that they should differ by far less."""


@dataclass(frozen=True)
class Compared:
    """How two maps differ.

    Parameters
    ----------
    words : for people
    same, apart : whether there are two maps, and they are the same, or not; neither: one of them is missing
    settled : whether both ended at their tolerance
    moved : the maps are compared in one place, in which they were not at first
    """

    words: str
    same: bool = False
    apart: bool = False
    settled: bool = False
    moved: bool = False


def compared(scene: RandomScene, found: tuple[View, ...]) -> Compared:
    """Return how the map from a start that was found differs from that from picks."""
    part = nominal(scene.part, scene.element)
    landmarks = tuple(PickedPoint(tuple(cad), tuple(map(tuple, pixels))) for cad, pixels in picks(scene, part))
    stereo = Stereo(scene.focal, landmarks, False, "cubic", STEEPEST, 0.01, None, None, True)
    photographs = tuple(Photograph(f"view {k}", grey, 255.0) for k, grey in enumerate(scene.grey, start=1))
    shapes: list[Shape | str] = []
    try:
        begin = start(stereo, photographs, part)
    except MeasurementError as error:
        return Compared(f"the picks are refused: {error}")
    for views in (found, begin.views):
        try:
            shapes.append(stereo.correlate(part)(part, scene.grey, views, begin.freedom))
        except MeasurementError as error:
            shapes.append(str(error))
    refused = [shape for shape in shapes if isinstance(shape, str)]
    if refused:
        which = "from both" if len(refused) == 2 else f"from the {'start' if shapes[0] in refused else 'picks'}"
        return Compared(f"no map {which}: {refused[0]}")
    one, other = (shape for shape in shapes if isinstance(shape, Shape))
    as_they_are = difference(part, (one, other), (one, other), begin)
    if as_they_are.same:
        return as_they_are
    found_again = replace(stereo.correlate(part), levels=SHAPE[-1:])
    views = (one.views, beside(one, other, begin.freedom))
    try:
        again = tuple(found_again(part, scene.grey, cameras) for cameras in views)
    except MeasurementError as error:
        return replace(as_they_are, words=f"{as_they_are.words}; not found again in one place: {error}")
    said = difference(part, (one, other), again, begin)
    words = f"{as_they_are.words}; in one place {said.words}"
    return replace(said, words=words, settled=as_they_are.settled, moved=True)


def beside(one: Shape, other: Shape, freedom: Freedom) -> tuple[View, ...]:
    """Return the cameras of `other` moved together to where its nodes appear nearest to those of `one`."""
    _, at, here = np.intersect1d(one.scene.node[one.sound], other.scene.node[other.sound], return_indices=True)
    places, now = (
        (shape.scene.nodes + shape.values[:, None] * shape.scene.normals)[shape.sound][chosen]
        for shape, chosen in ((one, at), (other, here))
    )
    aim = pixels(one.views, places)
    views = other.views
    changes = moving_cameras(other.scene, freedom, views, motions_of(other.scene, freedom)[2])
    for _ in range(ROUNDS):
        start = pixels(views, now)
        slopes = [(pixels(freedom.moved(views, SMALL * each), now) - start) / SMALL for each in changes.T]
        views = freedom.moved(views, changes @ np.linalg.lstsq(np.stack(slopes, axis=1), aim - start, rcond=None)[0])
    return views


def pixels(views: tuple[View, ...], points: Floats) -> Floats:
    """Return where the views see points (n, 3) mm, all in one row, px."""
    return np.concatenate([view.project(points) for view in views]).ravel()


def start(stereo: Stereo, photographs: tuple[Photograph, ...], part: Nominal) -> Begin:
    """Return where the landmarks of a recipe start the correlation."""
    from inspect3d.correlation.picks import Picks
    from inspect3d.correlation.start import StereoStart

    cad, pixels = [p.cad for p in stereo.landmarks], [p.pixels for p in stereo.landmarks]
    begun = StereoStart(Picks(np.array(cad), np.array(pixels)), None, True)
    return begun(photographs, (None,) * len(photographs), None, (stereo.focal,) * len(photographs), part)


def picks(scene: RandomScene, part: Nominal) -> list[tuple[Floats, Floats]]:
    """Return points (3,) mm that all cameras see, far from each other, each with its pixels (v, 2) as clicked on."""
    seen = scene_of(part, scene.views, 2.5, np.radians(STEEPEST), [None] * len(scene.views))
    places = seen.nodes[seen.whole & seen.upright]
    places = places[np.argsort(-np.linalg.norm(places - places.mean(axis=0), axis=1))]
    chosen = [0]
    for _ in range(PICKS - 1):
        away = np.linalg.norm(places[:, None] - places[chosen][None], axis=2).min(axis=1)
        chosen.append(int(np.argmax(away)))
    random = np.random.default_rng(9)
    pixels = np.stack([view.project(places[chosen]) for view in scene.views], axis=1)
    pixels += random.normal(0, CLICK, pixels.shape)
    return list(zip(places[chosen], pixels, strict=True))


def difference(part: Nominal, measured: tuple[Shape, Shape], shown: tuple[Shape, Shape], begin: Begin) -> Compared:
    """Return how two maps differ once motions and growth of the part, and motions named as weak, are out of both.

    Parameters
    ----------
    measured : which state their uncertainty and their weak motions
    shown : the same, or found again in one place; what is compared
    """
    values, variances, modes = [], [], []
    for shape, found in zip(measured, shown, strict=True):
        node, n = shape.scene.node, len(part.mesh)
        value, variance = np.full((2, n), np.nan)
        value[found.scene.node] = np.where(found.sound, found.values, np.nan)
        variance[node] = np.where(shape.sound, shape.uncertainty.variances, np.nan)
        patterns = [motion.pattern for motion in shape.hidden if motion.pattern.any()]
        fields = np.column_stack([gauge_of(shape.scene, begin.freedom), *patterns])
        spread = np.zeros((n, fields.shape[1]))
        spread[node] = fields
        values.append(value)
        variances.append(variance)
        modes.append(spread)
    both = np.isfinite(np.sum([*values, *variances], axis=0))
    if np.count_nonzero(both) <= 2 * modes[0].shape[1] + 2 * modes[1].shape[1]:
        return Compared(f"{np.count_nonzero(both)} nodes in both maps, too few to compare", apart=True)
    fields, apart = np.concatenate(modes, axis=1)[both], (values[0] - values[1])[both]
    sigma = np.sqrt((variances[0] + variances[1])[both] / 2)
    apart = (apart - fields @ np.linalg.lstsq(fields, apart, rcond=None)[0]) / sigma
    rms, share = float(np.sqrt((apart**2).mean())), float((np.abs(apart) < FAR).mean())
    seen = [
        shape.mesh.nodes[both] + value[both, None] * shape.mesh.normals[both]
        for shape, value in zip(shown, values, strict=True)
    ]
    slide = pixels(shown[0].views, seen[0]) - pixels(shown[1].views, seen[1])
    counts = [np.count_nonzero(shape.sound) for shape in shown]
    loose = [name for name, shape in zip(("start", "picks"), shown, strict=True) if not shape.settled]
    open_ends = f"; not settled from {' and '.join(loose)}" if loose else ""
    words = (
        f"{counts[0]} and {counts[1]} nodes, {np.count_nonzero(both)} in both, apart by {rms:.2f} sigma rms, "
        f"{np.abs(apart).max():.1f} at the most, {100 * share:.1f} % within 1, sigma {1e3 * np.median(sigma):.1f} um; "
        f"the nodes appear {np.sqrt(2 * (slide**2).mean()):.1f} px apart"
        f"{open_ends}"
    )
    same = rms <= RMS and share >= SHARE
    return Compared(words, same, not same, not loose)
