"""Is the stated uncertainty of a cloud's map true? Claimed against actual over simulated scans of three parts.

    python benchmarks/sigma_of_clouds.py [scans]

Each scan has a noise, a density, drop-outs and a pose of its own; the part has a smooth form error and a bump. The true
deviation is brought into the gauge of the map before it is compared. Printed for each part and for all: the root mean
square of (found - true) / sigma, the share of nodes whose 95 % interval holds the truth, and the median sigma.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from inspect3d.deviate.deviate import Deviate
from inspect3d.measure import Cloud
from inspect3d.nominal.load import load_nominal
from inspect3d.register.gauge import best_fit
from inspect3d.register.register import Register
from inspect3d.virtual.bracket import bracket
from inspect3d.virtual.deviation_field import Bump, Wave
from inspect3d.virtual.freeform import freeform
from inspect3d.virtual.milled import milled
from inspect3d.virtual.random_pose import random_pose
from inspect3d.virtual.uniform_scan import uniform_scan

PARTS = {"bracket": bracket, "freeform": freeform, "milled": milled}
NOISES, DENSITIES = (0.005, 0.02, 0.05), (3.0, 8.0, 20.0)  # mm; points per mm²


def main(scans: int) -> None:
    """Print the table."""
    print(f"{'part':10} {'scans':>5} {'nodes':>7} {'rms z':>6} {'in 95 %':>8} {'sigma':>9}  worst scan (rms z)")
    pooled = []
    with tempfile.TemporaryDirectory() as folder:
        for k, (name, make) in enumerate(PARTS.items()):
            part = make()
            part.write_step(Path(folder) / f"{name}.step")
            nominal = load_nominal(Path(folder) / f"{name}.step", element_size=2.5)
            surface = part.surface()
            found = [one_scan(nominal, surface, seed) for seed in range(k, scans, len(PARTS))]
            z = np.concatenate([z for z, _ in found])
            worst = max(np.sqrt(np.mean(z**2)) for z, _ in found)
            row(name, len(found), z, np.median(np.concatenate([sigma for _, sigma in found])), worst)
            pooled += found
    z = np.concatenate([z for z, _ in pooled])
    worst = max(np.sqrt(np.mean(z**2)) for z, _ in pooled)
    row("all", len(pooled), z, np.median(np.concatenate([sigma for _, sigma in pooled])), worst)


def row(name: str, scans: int, z: np.ndarray, sigma: float, worst: float) -> None:
    """Print one line of the table."""
    inside, rms = 100 * np.mean(np.abs(z) < 1.96), np.sqrt(np.mean(z**2))
    print(f"{name:10} {scans:5d} {len(z):7d} {rms:6.3f} {inside:6.1f} % {1e3 * sigma:6.2f} um  {worst:.3f}")


def one_scan(nominal, surface, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (found - true) / sigma and sigma at the observed nodes of one simulated scan."""
    random = np.random.default_rng(seed)
    low, high = nominal.surface.bounds
    centre = nominal.mesh.nodes[random.integers(len(nominal.mesh))]
    field = Wave(0.02, (0.010, 0.013, 0.005), 1.0) + Bump(tuple(centre), 0.15, 14.0)
    pose = random_pose(random)
    scan = uniform_scan(surface, field, random.choice(DENSITIES), random.choice(NOISES), seed, pose)
    keep = np.ones(len(scan.points_scan), bool)
    for _ in range(6):
        hole = random.uniform(low, high)
        keep &= np.linalg.norm(scan.points_cad - hole, axis=1) > random.uniform(4, 10)
    cloud = Cloud(f"scan {seed}", scan.points_scan[keep], scan.normals_scan[keep])
    alignment = Register(nominal, start=pose.inverse())(cloud)
    found = Deviate()((cloud,), (alignment,), nominal, np.ones(len(nominal.mesh), bool)).deviation
    mesh, seen = nominal.mesh, found.observed
    gauge = best_fit(mesh.nodes[seen], mesh.normals[seen], mesh.areas[seen], found.value[seen])
    return (found.value[seen] - gauge(field(mesh.nodes[seen]))) / found.sigma[seen], found.sigma[seen]


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 42)
