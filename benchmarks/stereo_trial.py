"""One virtual experiment in stereocorrelation after another, with the truth; what the benchmarks of it share."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.correlation.linear import gauge_of
from inspect3d.correlation.scene import Scene as SeenScene
from inspect3d.correlation.shape import Shape
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nominal import Nominal
from inspect3d.pose import Pose
from inspect3d.virtual.deviation_field import DeviationField
from inspect3d.virtual.milled import MilledSizes
from inspect3d.virtual.picture_dataset import PictureDataset
from inspect3d.virtual.scene import Scene
from inspect3d.virtual.stereo_datasets import milled_stereo, smooth_nurbs, smooth_stereo
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d.virtual.warp import Warp

SAME_SPECKLE = 3
HAIR = 1e-3  # mm, or of the way to the facets around a node


@dataclass(frozen=True)
class Case:
    """Standard errors of what is known of a lens: its focal length (share of it), its principal point (px of 1224)."""

    focal: float
    centre: float
    poses: str


CASES = {
    "known": Case(0.0, 0.0, "known"),
    "poses": Case(0.0, 0.0, "free"),
    "lenses": Case(0.5 / 4100, 0.5, "free"),
    "self": Case(0.05, 30.0, "free"),
}


@dataclass(frozen=True, eq=False)
class Trial:
    """Pictures of a part, what is believed of the cameras, and the truth."""

    dataset: PictureDataset
    nominal: Nominal
    grey: Sequence[Floats]
    views: tuple[View, ...]
    freedom: Freedom

    @property
    def truth(self) -> tuple[View, ...]:
        """Return the true cameras."""
        return tuple(camera.view for camera in self.dataset.cameras)

    def near_step(self, nodes: Floats, reach: float) -> Booleans:
        """Tell which nodes (n, 3) lie within `reach` mm of a place where the deviation of the milled block jumps."""
        if self.dataset.part.name != "milled":
            return np.zeros(len(nodes), dtype=bool)
        return (np.abs(nodes[:, :1] - self._jumps) < reach).any(axis=1)

    def on_side_of(self, feet: Floats, scene: SeenScene) -> Floats:
        """Return feet (n, 3) on the surface, those that have crossed a step from the facets around their node put back.

        The material at a node may be a hair beside it, and across a step from where the node is.
        """
        if self.dataset.part.name != "milled":
            return feet
        middles = scene.nodes[scene.triangles].mean(axis=1)
        around = scene.gathered(np.ones((len(middles), 3)))
        towards = scene.gathered(np.repeat(middles[:, None], 3, axis=1)) / around[:, None] - scene.nodes
        bounds = np.array([-np.inf, *self._jumps, np.inf])
        place = np.searchsorted(self._jumps, (scene.nodes + HAIR * towards)[:, 0])
        x = np.clip(feet[:, 0], bounds[place] + HAIR, bounds[place + 1] - HAIR)
        return np.column_stack([x, feet[:, 1:]])

    @property
    def _jumps(self) -> Floats:
        sizes = MilledSizes()
        return np.array([*sizes.facet_borders, sizes.section_start])


@dataclass(frozen=True)
class Setup:
    """The part, the rig and the mesh of a series of trials.

    Parameters
    ----------
    part : freeform, smooth or milled
    cameras : how many
    full : 5 megapixels in place of a quarter of that
    element : mm
    noise : share of full scale
    tau, length : px and mm on the part, of a smooth systematic shift of each picture; tau 0: none
    scallop : mm, height of the scallops of the milled part; by default none, since coarse meshes do not resolve them
    deviation : in place of the part's own
    """

    part: str = "freeform"
    cameras: int = 2
    full: bool = False
    element: float = 4.6
    noise: float = 0.01
    tau: float = 0.0
    length: float = 25.0
    scallop: float = 0.0
    deviation: DeviationField | None = None

    @property
    def rig(self) -> StereoRig:
        """Return the rig."""
        rig = StereoRig(cameras=self.cameras)
        return rig if self.full else rig.halved()

    def dataset(self, seed: int) -> PictureDataset:
        """Return the part before its cameras."""
        made = {
            "freeform": lambda: smooth_stereo(seed, self.rig),
            "smooth": lambda: smooth_nurbs(seed, self.rig),
            "milled": lambda: milled_stereo(seed, self.rig, self.scallop),
        }[self.part]()
        made = made if self.deviation is None else replace(made, deviation=self.deviation)
        if self.tau == 0.0:
            return made
        warps = [Warp(self.tau, self.length * self.rig.scale, 97 * seed + k) for k in range(len(made.cameras))]
        cameras = tuple(replace(c, warp=warp) for c, warp in zip(made.cameras, warps, strict=True))
        return replace(made, cameras=cameras)

    @cached_property
    def nominal(self) -> Nominal:
        """Return the part as designed and the inspection mesh, the same for every seed."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "part.step"
            self.dataset(0).part.write_step(path)
            return load_nominal(path, element_size=self.element)

    def trials(self, case: Case, seeds: range) -> Iterator[Trial]:
        """Yield one trial for each seed: noise, gain and beliefs are new in each, the speckle in every third.

        Where there is a systematic shift it is new in each, and so is the speckle.
        """
        drawn, same = -1, SAME_SPECKLE if self.tau == 0.0 else 1
        for seed in seeds:
            if seed - seed % same != drawn:
                drawn = seed - seed % same
                dataset = self.dataset(drawn)
                scene = Scene(dataset.part.surface(), dataset.deviation, dataset.speckle)
                light = [camera.light(scene) for camera in dataset.cameras]
            random = np.random.default_rng(1000 + seed)
            yield self._trial(case, dataset, light, random)

    def _trial(
        self, case: Case, dataset: PictureDataset, light: Sequence[Floats], random: np.random.Generator
    ) -> Trial:
        sensors = [
            replace(c.sensor, gain=random.uniform(0.8, 1.05) * 0.95, offset=0.03, noise=self.noise)
            for c in dataset.cameras
        ]
        grey = [sensor(picture, random).astype(np.float64) for sensor, picture in zip(sensors, light, strict=True)]
        views = tuple(camera.view for camera in dataset.cameras)
        lens = Lens(case.focal * self.rig.focal, case.centre * self.rig.size[0] / 1224)
        nodes = self.nominal.mesh.nodes
        if case.poses != "known":
            views = tuple(believed(view, lens, nodes, random) for view in views)
        freedom = Freedom(case.poses, (lens,) * len(views), views, nodes.mean(axis=0))
        return Trial(dataset, self.nominal, grey, views, freedom)


def believed(view: View, lens: Lens, nodes: Floats, random: np.random.Generator) -> View:
    """Return a view with a lens drawn from what is known of it, and the pose that a few picked points then give."""
    matrix = view.camera.matrix.copy()
    matrix[[0, 1], [0, 1]] += random.normal(0, lens.focal) if lens.focal else 0.0
    matrix[:2, 2] += random.normal(0, lens.centre, 2) if lens.centre else 0.0
    points = nodes[random.choice(len(nodes), 40, replace=False)]
    pixels = view.project(points) + random.normal(0, 0.5, (len(points), 2))
    return posed(view, matrix, points, pixels)


def picked(view: View, focal: float, points: Floats, pixels: Floats) -> View:
    """Return a view with a rough focal length (px), a centred principal point, and the pose that picks give."""
    width, height = view.camera.size
    matrix = np.array([[focal, 0.0, (width - 1) / 2], [0.0, focal, (height - 1) / 2], [0.0, 0.0, 1.0]])
    return posed(view, matrix, points, pixels)


def posed(view: View, matrix: Floats, points: Floats, pixels: Floats) -> View:
    """Return a view with another camera matrix and the pose that points (n, 3) seen at pixels (n, 2) give."""
    _, turn, shift = cv2.solvePnP(points, pixels, matrix, view.camera.distortion)
    return View(replace(view.camera, matrix=matrix), Pose(cv2.Rodrigues(turn)[0], shift.ravel()))


def error_of(shape: Shape, trial: Trial, values: Floats) -> Floats:
    """Return the error (n,) mm of nodal deviations, in the gauge of the solver but for motions of the part.

    Cameras that are not where they are believed to be carry the material a little along the surface as well. What a
    node shows then belongs to a place beside it, and is compared with the truth of that place: the pixels where the
    cameras as found see the node, seen through the true cameras, are the point Y in space that was measured. The error
    is the distance of Y from the true surface, and the motion from Y to the node along the normal.
    """
    found = shape.scene.nodes + values[:, None] * shape.scene.normals
    measured = _triangulated(trial.truth, [view.project(found) for view in shape.views], found)
    feet = trial.nominal.surface.closest(measured)
    away = ((measured - feet.points) * feet.normals).sum(axis=1) - trial.dataset.deviation(
        trial.on_side_of(feet.points, shape.scene)
    )
    return away + ((found - measured) * shape.scene.normals).sum(axis=1)


def _triangulated(views: Sequence[View], pixels: Sequence[Floats], start: Floats) -> Floats:
    """Return the points (n, 3) mm whose pictures are nearest to the pixels (n, 2) of all views."""
    points, step = start, 1e-3
    for _ in range(4):
        misses, slopes = [], []
        for view, pixel in zip(views, pixels, strict=True):
            here = view.project(points)
            misses.append(pixel - here)
            slopes.append(np.stack([(view.project(points + step * axis) - here) / step for axis in np.eye(3)], axis=2))
        inverse = np.linalg.pinv(np.concatenate(slopes, axis=1))
        points = points + np.einsum("nij,nj->ni", inverse, np.concatenate(misses, axis=1))
    return points


def modes_of(shape: Shape, trial: Trial) -> tuple[Floats, Floats]:
    """Return the motions of the part that its cameras allow (n, g), and those listed as hidden or weak (n, k).

    The former are all that move the surface by a thousandth of their size or more: none of them is an error of the map.
    """
    hidden = [motion.pattern for motion in shape.hidden if np.isfinite(motion.sigma)]
    weak = np.stack(hidden, axis=1) if hidden else np.zeros((len(shape.scene.nodes), 0))
    return gauge_of(shape.scene, trial.freedom, HAIR**2), weak


def remover(modes: Floats, sound: Booleans) -> Floats:
    """Return M (k, n), the least-squares size of each mode in the sound nodes' values."""
    inverse = np.zeros(modes.T.shape)
    inverse[:, sound] = np.linalg.pinv(modes[sound])
    return inverse


def rms(values: Floats) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("nan")


def cover(z: Floats) -> float:
    """Return the share within 1.96."""
    return float((np.abs(z) < 1.96).mean()) if len(z) else float("nan")
