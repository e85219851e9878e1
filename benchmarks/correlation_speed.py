"""How long does stereocorrelation take, and what memory, from pictures in memory to the shape and its uncertainty?

    python benchmarks/correlation_speed.py
    python benchmarks/correlation_speed.py --large

The part is a plane that is a little too high and turned, seen by two cameras that are known; its pictures are computed
from the homography of the plane and a speckle of waves, so that they are made in seconds. Imports and the compiling
of kernels are not counted: a small case runs first. `--large` takes 100,000 nodes, 4,000,000 evaluation points and
two pictures of 20 megapixels in place of 1400 nodes and 5 megapixels.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Floats, Singles
from inspect3d.camera import Camera, View
from inspect3d.correlation.correlate import Correlate
from inspect3d.correlation.shape import Shape
from inspect3d.correlation.state import Step
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.surface import Surface
from inspect3d.pose import Pose

DISTANCE, ANGLE = 500.0, np.radians(13.5)  # mm, rad
WAVES, LONGEST = 16, 14.0  # px
NOISE = 2.5  # grey levels
TURNED = np.array([0.02, 1e-4, -2e-4])  # mm, and per mm along x and y
PUBLISHED = "OpenCorr, stereo-DIC on other hardware: 97,969 points in 39 s"


@dataclass(frozen=True)
class Case:
    """A size of the task.

    Parameters
    ----------
    size : px, of the pictures
    nodes : along x and y
    pixels : px that one evaluation point stands for
    """

    size: tuple[int, int]
    nodes: tuple[int, int]
    pixels: float = 2.5


SMALL = Case((300, 240), (9, 8))
USUAL = Case((2448, 2048), (41, 34))
LARGE = Case((5472, 3648), (388, 258), 4.45)


def main() -> None:
    """Print the time per stage, the peak of memory, and the time per iteration against the evaluation points."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--large", action="store_true", help="100,000 nodes on 20 megapixels")
    parser.add_argument("--runs", type=int, default=3)
    chosen = parser.parse_args()
    case = LARGE if chosen.large else USUAL
    views, nominal, grey = made(SMALL)
    Correlate()(nominal, grey, views).uncertainty.variances.sum()
    views, nominal, grey = made(case)
    print(f"{case.size[0]} x {case.size[1]} px, two views; {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    for _ in range(chosen.runs):
        stages, shape = run(Correlate(pixels=case.pixels), nominal, grey, views)
        print_run(stages, shape)
    print(PUBLISHED)
    print(f"peak of memory, with the making of the pictures: {peak():.2f} GB")
    print("evaluation points   s per iteration   ns per point")
    for per_edge in (3, 4, 6) if chosen.large else (6, 12, 24, 36):
        points, seconds = iteration(Correlate(per_edge=per_edge), nominal, grey, views)
        print(f"{points:17,d} {seconds:17.3f} {1e9 * seconds / points:14.0f}")


def run(
    settings: Correlate, nominal: Nominal, grey: Sequence[Singles], views: Sequence[View]
) -> tuple[dict[str, Floats], Shape]:
    """Return wall and processor seconds of each stage (2,), and the shape."""
    stages: dict[str, Floats] = {}
    last = np.array([time.perf_counter(), time.process_time()])

    def pass_to(stage: str) -> None:
        nonlocal last
        now = np.array([time.perf_counter(), time.process_time()])
        stages[stage] = stages.get(stage, np.zeros(2)) + now - last
        last = now

    shape = settings(
        nominal, grey, views, told=lambda step: pass_to(f"blur {step.level.blur:g}" if stages else "to the first step")
    )
    shape.uncertainty.variances.sum()
    pass_to("uncertainty")
    return stages, shape


def print_run(stages: dict[str, Floats], shape: Shape) -> None:
    """Print how long a run took and how good its result is."""
    print(
        f"{len(shape.scene.nodes):,} nodes, {len(shape.scene.points):,} evaluation points, "
        f"{len(shape.state.steps)} steps: {sum(s[0] for s in stages.values()):.2f} s, "
        f"{sum(s[1] for s in stages.values()):.2f} s of processor time"
    )
    print("  " + ", ".join(f"{name} {wall:.2f} ({busy:.2f})" for name, (wall, busy) in stages.items()))
    sound, nodes = shape.sound, shape.scene.nodes
    error = (shape.values - (TURNED[0] + nodes[:, :2] @ TURNED[1:]))[sound]
    z = error / np.sqrt(shape.uncertainty.variances[sound])
    print(f"  error {1e3 * np.sqrt((error**2).mean()):.2f} um rms, over the claim {np.sqrt((z**2).mean()):.2f}")


def iteration(
    settings: Correlate, nominal: Nominal, grey: Sequence[Singles], views: Sequence[View]
) -> tuple[int, float]:
    """Return the number of evaluation points, and the median seconds of a step without blur."""
    times: list[float] = []
    sharp: list[bool] = []

    def told(step: Step) -> None:
        times.append(time.perf_counter())
        sharp.append(step.level.blur == 0)

    shape = settings(nominal, grey, views, told=told)
    steps = np.diff(times)[np.array(sharp[1:]) & np.array(sharp[:-1])]
    return len(shape.scene.points), float(np.median(steps))


def made(case: Case) -> tuple[tuple[View, ...], Nominal, list[Singles]]:
    """Return the cameras, the part and the pictures of a case."""
    width, height = case.size
    focal = 4.0 * width
    across = 0.86 * width * DISTANCE / focal
    views = tuple(view(sign * ANGLE, focal, case.size) for sign in (-1, 1))
    part = plane(across, across * height / width, case.nodes)
    random = np.random.default_rng(0)
    length = LONGEST * DISTANCE / focal
    numbers, angles = 2 * np.pi / length * random.uniform(1, 2, WAVES), random.uniform(0, 2 * np.pi, (2, WAVES))
    waves = np.stack([numbers, *angles], axis=1)
    return views, part, [picture(v, waves, random) for v in views]


def view(angle: float, focal: float, size: tuple[int, int]) -> View:
    """Return a camera that looks at the origin from the side."""
    matrix = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    back = np.array([np.sin(angle), 0.0, np.cos(angle)])
    rotation = np.stack([[np.cos(angle), 0.0, -np.sin(angle)], [0.0, -1.0, 0.0], -back])
    return View(Camera(matrix, np.zeros(5), size), Pose(rotation, np.array([0.0, 0.0, DISTANCE])))


def plane(width: float, height: float, nodes: tuple[int, int]) -> Nominal:
    """Return a plane with a regular mesh."""
    x, y = (np.linspace(-0.5, 0.5, n) * side for n, side in zip(nodes, (width, height), strict=True))
    grid = np.stack([*(a.ravel() for a in np.meshgrid(x, y, indexing="ij")), np.zeros(len(x) * len(y))], axis=1)
    number = np.arange(len(grid)).reshape(len(x), len(y))
    a, b, c, d = number[:-1, :-1].ravel(), number[1:, :-1].ravel(), number[1:, 1:].ravel(), number[:-1, 1:].ravel()
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    normals = np.tile([0.0, 0.0, 1.0], (len(grid), 1))
    mesh = InspectionMesh(grid, triangles, normals, np.zeros(len(grid), bool), np.full(len(grid), -1))
    return Nominal("plane", Surface(grid, triangles), mesh)


def picture(camera: View, waves: Floats, random: np.random.Generator) -> Singles:
    """Return what a camera sees of the turned plane z = TURNED . (1, x, y), with noise, in whole grey levels."""
    rotation, shift, matrix = camera.camera_from_cad.rotation, camera.camera_from_cad.translation, camera.camera.matrix
    along = np.stack([[1.0, 0.0, TURNED[1]], [0.0, 1.0, TURNED[2]]], axis=1)
    pixel_from_plane = matrix @ np.column_stack([rotation @ along, rotation[:, 2] * TURNED[0] + shift])
    width, height = camera.camera.size
    grey = np.empty((height, width), dtype=np.float32)
    write_speckle(np.linalg.inv(pixel_from_plane), waves, grey)
    return np.clip(np.rint(grey + NOISE * random.standard_normal(grey.shape, dtype=np.float32)), 0, 255)


@njit(cache=True, parallel=True)
def write_speckle(plane_from_pixel: Floats, waves: Floats, grey: Singles) -> None:
    """Write grey levels from the waves (k, 3), wave number in 1/mm, direction and phase in rad, at each pixel."""
    height, width = grey.shape
    for row in prange(height):
        for column in range(width):
            x, y, w = plane_from_pixel @ np.array([column, row, 1.0])
            total = 0.0
            for number, direction, phase in waves:
                total += np.cos(number * (np.cos(direction) * x + np.sin(direction) * y) / w + phase)
            grey[row, column] = 125 + 90 * np.tanh(total / np.sqrt(0.5 * len(waves)))


def peak() -> float:
    """Return the most memory this process has held, GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9


if __name__ == "__main__":
    main()
