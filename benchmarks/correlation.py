"""Is the stated uncertainty of stereocorrelation true? Errors against the truth of the virtual rig, claimed and actual.

    python benchmarks/correlation.py known lenses self --runs 8
    python benchmarks/correlation.py known --full --runs 1

Each run draws noise, gain and offset, and what is believed of the cameras, around the truth; every third one draws the
speckle too. z is (found - true) / sigma at the observed nodes, in the common gauge; `rest` is the same once the motions
listed as hidden or weak are projected out of error and covariance, and `weak` their squared Mahalanobis distance.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.correlation.correlate import TWO_STEPS, Correlate
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.correlation.linear import gauge_of
from inspect3d.correlation.shape import Shape
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nominal import Nominal
from inspect3d.pose import Pose
from inspect3d.virtual.picture_dataset import PictureDataset
from inspect3d.virtual.scene import Scene
from inspect3d.virtual.stereo_datasets import milled_stereo, smooth_stereo
from inspect3d.virtual.stereo_rig import StereoRig


@dataclass(frozen=True)
class Case:
    """What is known about the cameras: standard errors of focal length (share of it) and principal point (px)."""

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
class Score:
    """Errors of one run, mm, and their ratio to the claim."""

    error: Floats
    z: Floats
    rest: Floats
    rest_z: Floats
    weak: float
    modes: int
    sigma: float
    observed: float
    seconds: float
    steps: int
    settled: bool
    correlated: float

    def __str__(self) -> str:
        return (
            f"e {_um(self.error)} (max {1e3 * np.abs(self.error).max():5.1f}) sigma {1e3 * self.sigma:5.2f} "
            f"z {_rms(self.z):5.3f} cover {_cover(self.z):.3f} | rest {_um(self.rest)} "
            f"(max {1e3 * np.abs(self.rest).max():5.1f}) z {_rms(self.rest_z):5.3f} cover {_cover(self.rest_z):.3f} "
            f"weak {self.weak:5.1f}/{self.modes} | observed {self.observed:.3f} kappa {self.correlated:.2f} "
            f"{self.steps} steps{'' if self.settled else ', not settled'} {self.seconds:.2f} s"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"{', '.join(CASES)}; default: known")
    parser.add_argument("--runs", type=int, default=6)
    parser.add_argument("--full", action="store_true", help="5 megapixels in place of a quarter of that")
    parser.add_argument("--cameras", type=int, default=2)
    parser.add_argument("--element", type=float, help="mm; default: the dataset's")
    parser.add_argument("--part", choices=("freeform", "milled"), default="freeform")
    parser.add_argument("--steps", action="store_true", help="the paper's two steps in place of the joint solve")
    parser.add_argument("--flat", action="store_true", help="flat facets in place of lifted points")
    chosen = parser.parse_args()
    for name in chosen.cases or ["known"]:
        scores = _runs(CASES[name], chosen)
        z, rest = (np.concatenate([getattr(s, field) for s in scores]) for field in ("z", "rest_z"))
        weak = sum(s.weak for s in scores) / max(sum(s.modes for s in scores), 1)
        print(
            f"{name}: {len(scores)} runs, z {_rms(z):.3f} cover {_cover(z):.3f}, rest z {_rms(rest):.3f} "
            f"cover {_cover(rest):.3f}, weak {weak:.2f} of its mean",
            flush=True,
        )


def _runs(case: Case, chosen: argparse.Namespace) -> Sequence[Score]:
    rig = StereoRig(cameras=chosen.cameras)
    rig = rig if chosen.full else rig.halved()
    element = chosen.element or (2.7 if chosen.full else 4.6)
    settings = Correlate(levels=TWO_STEPS if chosen.steps else None, lifted=not chosen.flat)
    scores: list[Score] = []
    for run in range(chosen.runs):
        if run % 3 == 0:
            dataset = smooth_stereo(run, rig) if chosen.part == "freeform" else milled_stereo(run)
            scene = Scene(dataset.part.surface(), dataset.deviation, dataset.speckle)
            light = [camera.light(scene) for camera in dataset.cameras]
            nominal = _nominal(dataset, element)
        scores.append(_score(case, dataset, light, nominal, settings, np.random.default_rng(1000 + run)))
        print(scores[-1], flush=True)
    return scores


def _nominal(dataset: PictureDataset, element: float) -> Nominal:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.step"
        dataset.part.write_step(path)
        return load_nominal(path, element_size=element)


def _score(
    case: Case,
    dataset: PictureDataset,
    light: Sequence[Floats],
    nominal: Nominal,
    settings: Correlate,
    random: np.random.Generator,
) -> Score:
    sensors = [replace(c.sensor, gain=random.uniform(0.8, 1.05) * 0.95, offset=0.03) for c in dataset.cameras]
    grey = [sensor(picture, random).astype(np.float64) for sensor, picture in zip(sensors, light, strict=True)]
    truth = tuple(camera.view for camera in dataset.cameras)
    focal = case.focal * truth[0].camera.matrix[0, 0]
    lens = Lens(focal, case.centre * truth[0].camera.size[0] / 1224)
    views = truth if case.poses == "known" else tuple(_believed(v, lens, nominal.mesh.nodes, random) for v in truth)
    freedom = Freedom(case.poses, (lens,) * len(views), views, nominal.mesh.nodes.mean(axis=0))
    started = time.perf_counter()
    shape = settings(nominal, grey, views, freedom)
    sigma = np.sqrt(shape.uncertainty.variances)
    seconds = time.perf_counter() - started
    return _compared(shape, dataset, freedom, sigma, seconds)


def _compared(shape: Shape, dataset: PictureDataset, freedom: Freedom, sigma: Floats, seconds: float) -> Score:
    sound, nodes = shape.sound, shape.scene.nodes
    true = dataset.deviation(nodes)
    solver = gauge_of(shape.scene, freedom)
    hidden = [motion for motion in shape.hidden if np.isfinite(motion.sigma)]
    weak = np.stack([m.pattern for m in hidden], axis=1) if hidden else np.zeros((len(nodes), 0))
    error = shape.values - true
    found = _without(shape, error, solver, sound)
    rest = _without(shape, error, np.column_stack([solver, weak]), sound)
    distance = 0.0
    if hidden:
        fields = (weak / len(nodes)) * sound[:, None]
        sizes = fields.T @ (error - solver @ (solver.T @ error))
        distance = float(sizes @ np.linalg.solve(fields.T @ shape.uncertainty.covariance(fields), sizes))
    visible = np.isin(np.arange(len(shape.mesh)), shape.scene.node[shape.scene.share >= 1])
    return Score(
        *found[:2],
        *rest[:2],
        distance,
        len(hidden),
        float(np.median(sigma[sound])),
        float(shape.observed[visible].mean()),
        seconds,
        len(shape.state.steps),
        shape.settled,
        shape.uncertainty.correlated,
    )


def _without(shape: Shape, error: Floats, modes: Floats, sound: Floats) -> tuple[Floats, Floats]:
    """Return an error less its modes, by least squares over the observed nodes, and its ratio to the claim."""
    inverse = np.zeros(modes.T.shape)
    inverse[:, sound] = np.linalg.pinv(modes[sound])
    left = error - modes @ (inverse @ error)
    sigma = np.sqrt(shape.uncertainty.variances_without(modes, inverse))
    return left[sound], (left / sigma)[sound]


def _believed(view: View, lens: Lens, nodes: Floats, random: np.random.Generator) -> View:
    """Return a view with a lens drawn from what is known of it, and the pose that a few picked points then give."""
    matrix = view.camera.matrix.copy()
    matrix[[0, 1], [0, 1]] += random.normal(0, lens.focal) if lens.focal else 0.0
    matrix[:2, 2] += random.normal(0, lens.centre, 2) if lens.centre else 0.0
    points = nodes[random.choice(len(nodes), 40, replace=False)]
    pixels = view.project(points) + random.normal(0, 0.5, (len(points), 2))
    _, turn, shift = cv2.solvePnP(points, pixels, matrix, view.camera.distortion)
    return View(replace(view.camera, matrix=matrix), Pose(cv2.Rodrigues(turn)[0], shift.ravel()))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _um(values: Floats) -> str:
    return f"{1e3 * _rms(values):5.2f} um"


def _cover(z: Floats) -> float:
    return float((np.abs(z) < 1.96).mean())


if __name__ == "__main__":
    main()
