"""Signed distances side by side, in one run: inspect3d, Open3D, trimesh, VTK, and libigl where it is installed.

    python benchmarks/signed_distance.py            (about three minutes)

Prints three tables: how time and memory of inspect3d grow to 10 million points, times for points in random and in scan
order, and errors against exact distances near and far from the origin. Every library gets the same points in the same
order, in the precision it works in, and is called several times in turn with the others; its fastest call counts, and
building its tree does not. trimesh and VTK get fewer points, and their time is scaled up.
"""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from time import perf_counter

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.nominal.surface import Surface
from inspect3d.system import import_open3d

Distances = Callable[[Floats], Floats]

POINTS = 1_000_000
REPEATS = 5
FEWER = {"trimesh": 2_000, "VTK": 50_000}
SIZES = (100_000, 1_000_000, 10_000_000)


def ring(around: int = 224) -> tuple[Floats, Integers]:
    """Return vertices and triangles, 2 around^2, of a ring of 146 mm with bumps: smooth, closed, curved everywhere."""
    u, v = np.meshgrid(*[np.arange(around) * 2 * np.pi / around] * 2, indexing="ij")
    radius = 20 + 3 * np.sin(5 * u) * np.cos(3 * v)
    across = 50 + radius * np.cos(v)
    vertices = np.stack([across * np.cos(u), across * np.sin(u), radius * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(around), indexing="ij")
    a, b = i * around + j, (i + 1) % around * around + j
    c, d = (i + 1) % around * around + (j + 1) % around, i * around + (j + 1) % around
    triangles = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    return vertices, triangles.reshape(-1, 3)


def scan(vertices: Floats, triangles: Integers, count: int, noise: float, seed: int) -> Floats:
    """Return points (count, 3) mm strewn over the triangles, `noise` mm off, in random order."""
    rng = np.random.default_rng(seed)
    points = np.empty((count, 3))
    for start in range(0, count, 1_000_000):
        part = points[start : start + 1_000_000]
        corners = vertices[triangles[rng.integers(len(triangles), size=len(part))]]
        part[:] = np.einsum("nk,nkj->nj", rng.dirichlet((1, 1, 1), len(part)), corners)
        part += rng.normal(scale=noise, size=part.shape)
    return points


def in_lines(points: Floats) -> Floats:
    """Return points in the order of a scanner: line by line, 0.2 mm apart, along each line."""
    return points[np.lexsort((points[:, 0], np.floor(points[:, 1] / 0.2)))]


def ours(vertices: Floats, triangles: Integers) -> Distances:
    surface = Surface(vertices, triangles)
    return lambda points: surface.closest(points).distance


def open3d(vertices: Floats, triangles: Integers) -> Distances:
    package = import_open3d()
    scene = package.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), triangles.astype(np.uint32))
    return lambda points: scene.compute_signed_distance(points).numpy()


def by_trimesh(vertices: Floats, triangles: Integers) -> Distances:
    import trimesh

    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    return lambda points: -trimesh.proximity.signed_distance(mesh, points)


def vtk(vertices: Floats, triangles: Integers) -> Distances:
    import pyvista

    mesh = pyvista.PolyData.from_regular_faces(vertices, triangles)
    return lambda points: pyvista.PolyData(points).compute_implicit_distance(mesh)["implicit_distance"]


def libigl(vertices: Floats, triangles: Integers) -> Distances:
    import igl

    return lambda points: np.asarray(igl.signed_distance(points, vertices, triangles)[0])


LIBRARIES = {"inspect3d": ours, "Open3D": open3d, "trimesh": by_trimesh, "VTK": vtk, "libigl": libigl}


def opened(vertices: Floats, triangles: Integers) -> dict[str, Distances]:
    """Return what each installed library answers with, its tree built."""
    found = {}
    for name, build in LIBRARIES.items():
        with suppress(ImportError):
            found[name] = build(vertices, triangles)
            found[name](prepared(name, vertices[:10] + 0.1))
    return found


def prepared(name: str, points: Floats) -> Floats:
    """Return points in the precision a library works in."""
    return points.astype(np.float32) if name == "Open3D" else points


def compare_times(vertices: Floats, triangles: Integers) -> None:
    """Print the time each library takes for a million points, and how often longer than inspect3d that is."""
    found = opened(vertices, triangles)
    near, wide = (scan(vertices, triangles, POINTS, noise, seed=1) for noise in (0.1, 10.0))
    cases = {
        "0.1 mm off, random order": near,
        "0.1 mm off, scan order": in_lines(near),
        "10 mm off, random order": wide,
    }
    print(f"\n{POINTS:,} points, {len(triangles):,} triangles: seconds (times inspect3d)\n")
    print(f"{'':28}" + "".join(f"{name:>20}" for name in found))
    for case, points in cases.items():
        seconds = dict.fromkeys(found, np.inf)
        for _ in range(REPEATS):
            for name, distances in found.items():
                some = prepared(name, points[: FEWER.get(name, POINTS)])
                start = perf_counter()
                distances(some)
                seconds[name] = min(seconds[name], (perf_counter() - start) * POINTS / len(some))
        row = [f"{seconds[name]:.3f} ({seconds[name] / seconds['inspect3d']:.1f})" for name in found]
        print(f"{case:28}" + "".join(f"{entry:>20}" for entry in row))


def compare_errors() -> None:
    """Print the largest error of each library around a box turned in space, whose distance has a formula."""
    half = np.array([50.0, 30.0, 0.05])
    corners = half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    sides = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    triangles = np.concatenate([sides[:, [0, 1, 2]], sides[:, [0, 2, 3]]])
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    points = scan(corners, triangles, 2_000, 1.0, seed=3)
    beyond = np.abs(points) - half
    true = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
    print("\nPlate of 100 x 60 x 0.1 mm, turned: largest error in mm; wrong signs of 2,000 beyond 1e-9 mm\n")
    for offset in (0.0, 300.0, 3000.0):
        found = opened(corners @ turn.T + offset, triangles)
        if not offset:
            print(f"{'':28}" + "".join(f"{name:>20}" for name in found))
        row = []
        for name, distances in found.items():
            answer = distances(prepared(name, points @ turn.T + offset))
            wrong = np.count_nonzero((np.sign(answer) != np.sign(true)) & (np.abs(true) > 1e-9))
            row.append(f"{np.abs(np.abs(answer) - np.abs(true)).max():.0e}, {wrong:d}")
        print(f"{f'{offset:.0f} mm from the origin':28}" + "".join(f"{entry:>20}" for entry in row))


def grow(count: int) -> None:
    """Print the time for a number of points and the most memory this process ever held."""
    vertices, triangles = ring()
    surface = Surface(vertices, triangles)
    surface.closest(vertices[:10])
    points = scan(vertices, triangles, count, 0.1, seed=4)
    start = perf_counter()
    surface.closest(points)
    seconds = perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    print(f"{count:>12,}{seconds:>12.3f}{seconds / count * 1e9:>14.0f}{peak:>12.2f}", flush=True)


def main() -> None:
    """Print all tables; with a number as argument, one line of the first."""
    if len(sys.argv) > 1:
        grow(int(sys.argv[1]))
        return
    print(f"{'points':>12}{'seconds':>12}{'ns per point':>14}{'peak, GB':>12}\n", flush=True)
    for size in SIZES:
        subprocess.run([sys.executable, __file__, str(size)], check=True)
    compare_times(*ring())
    compare_errors()


if __name__ == "__main__":
    main()
