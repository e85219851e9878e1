"""Do independent methods agree as their stated uncertainties say, and is a defect of one of them found, and no other?

    python benchmarks/agreement.py scans --seeds 20
    python benchmarks/agreement.py scans --seeds 40 --defect
    python benchmarks/agreement.py stereo --seeds 5 --defect
    python benchmarks/agreement.py lenses picks --seeds 20

`scans`: two simulated scans of the bracket that differ in noise and density. `stereo`: photographs of the freeform
sheet, a new speckle, rig and noise for each seed, measured by stereocorrelation, against a scan of it; `systematic` is
0, since the virtual pictures have no shift that no model explains. Its cameras and their places are known; with
`lenses` the lenses are known to a standard uncertainty of 0.5 px and the places from six picks and the part itself;
with `picks` nothing is but a focal length some per cent off. The comparison takes out of both maps what the pictures
then hardly tell. `milled`: cameras known and the milled block, which has steps of 30 and 40 um between its faces that
each method resolves in its own way. The part has a form error; with `--defect` the second of the two measurements has a
local defect of 60 um and 8 mm width in it as well.

Printed are the rms of E_n and the share of nodes above 1 over all seeds (0.5 and 4.6 % where the uncertainties are
true), and how many seeds show a region where none is; with a defect the share of the nodes with E_n above 1 where the
defect exceeds 4 sigma of the difference, the share where it is below a tenth of sigma, and how many seeds show the
defect and nothing else.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from inspect3d.compare.compare import Compare
from inspect3d.compare.comparison import Comparison
from inspect3d.compare.measured_map import MeasuredMap
from inspect3d.deviate.deviate import Deviate
from inspect3d.inspection import inspect
from inspect3d.measure import Cloud
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nominal import Nominal
from inspect3d.pose import Pose
from inspect3d.progress import Progress
from inspect3d.recipe import load_recipe
from inspect3d.register.register import Register
from inspect3d.virtual.bracket import bracket
from inspect3d.virtual.camera_knowledge import LensesKnown
from inspect3d.virtual.deviation_field import Bump, DeviationField, Sum, Uniform, Wave
from inspect3d.virtual.freeform import freeform
from inspect3d.virtual.milled import milled
from inspect3d.virtual.part_surface import PartSurface
from inspect3d.virtual.stereo_datasets import knowing, milled_stereo, smooth_stereo
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d.virtual.uniform_scan import uniform_scan

HEIGHT, WIDTH = 0.06, 8.0  # mm, of the defect
FORM = Sum((Wave(0.018, (0.008, 0.003, 0.002), 0.7), Wave(0.012, (-0.004, 0.011, 0.005), 2.1)))

Pair = tuple[Nominal, MeasuredMap, MeasuredMap, DeviationField]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("methods", nargs="+", choices=("scans", "stereo", "lenses", "picks", "milled"))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--defect", action="store_true")
    chosen = parser.parse_args()
    for methods in chosen.methods:
        print(methods)
        compare(methods, range(chosen.first, chosen.first + chosen.seeds), chosen.defect)


def compare(methods: str, seeds: range, defective: bool) -> None:
    """Print how a pair of methods agrees over the seeds."""
    en, on_defect, elsewhere, right, started = [], [], [], 0, time.process_time()
    pairs = scans(seeds, defective) if methods == "scans" else stereo(seeds, defective, methods)
    for seed, (nominal, a, b, defect) in zip(seeds, pairs, strict=True):
        (found,) = Compare()((a, b), nominal.mesh)
        at, excess = found.common, np.abs(defect(nominal.mesh.nodes)) / found.sigma
        en.append(found.en[at])
        on_defect.append(found.en[at & (excess > 4)] > 1)
        elsewhere.append(found.en[at & (excess < 0.1)] > 1)
        as_it_is = alone(found, defect, nominal) if defective else not found.regions
        right += as_it_is
        weak = a.covariance.weak.shape[1]
        print(
            f"  seed {seed}: {found.nodes} nodes, {weak} weak motions, E_n rms {found.en_rms:.3f}, "
            f"above 1 {100 * found.en_above_1:.1f} %, "
            f"sigma {1e3 * np.nanmedian(found.sigma):.1f} um; {'as it is' if as_it_is else 'WRONG'}: "
            + ", ".join(f"{np.round(region.place, 0)} {1e3 * region.mean:.0f} um" for region in found.regions),
            flush=True,
        )
    every = np.concatenate(en)
    print(f"E_n rms {np.sqrt(np.mean(every**2)):.3f}, above 1 {100 * np.mean(every > 1):.1f} % of {len(every)} nodes")
    if defective:
        print(
            f"above 1 on the defect {100 * np.mean(np.concatenate(on_defect)):.1f} %, "
            f"elsewhere {100 * np.mean(np.concatenate(elsewhere)):.1f} %"
        )
    what = "the defect and nothing else" if defective else "no region"
    print(
        f"{right} of {len(seeds)} seeds show {what}; {time.process_time() - started:.0f} s of processor time",
        flush=True,
    )


def alone(found: Comparison, defect: DeviationField, nominal: Nominal) -> bool:
    """Tell whether the one region found is the defect."""
    if len(found.regions) != 1:
        return False
    return float(np.abs(defect(found.regions[0].place[None]))[0]) > 0.5 * HEIGHT


def scans(seeds: range, defective: bool) -> Iterator[Pair]:
    """Yield pairs of scans of the bracket, the second with the defect."""
    part = bracket()
    surface = part.surface()
    with tempfile.TemporaryDirectory() as folder:
        part.write_step(Path(folder) / "part.step")
        nominal = load_nominal(Path(folder) / "part.step", element_size=4.0)
    for seed in seeds:
        defect = defect_on(nominal, seed) if defective else Uniform()
        a = scanned(nominal, surface, "a", FORM, (3.0, 0.02), 2 * seed)
        b = scanned(nominal, surface, "b", FORM + defect, (8.0, 0.015), 2 * seed + 1)
        yield nominal, a, b, defect


def stereo(seeds: range, defective: bool, known: str) -> Iterator[Pair]:
    """Yield pairs of photographs and a scan of the freeform sheet, the scan with the defect."""
    surface = (milled() if known == "milled" else freeform()).surface()
    for seed in seeds:
        if known == "milled":
            study = milled_stereo(seed, StereoRig().halved())
        else:
            study = smooth_stereo(seed, StereoRig().halved(), 4.6)
        if known in ("lenses", "picks"):
            study = knowing(study, LensesKnown() if known == "lenses" else None)
        with tempfile.TemporaryDirectory() as folder:
            study.write(Path(folder), seed)
            recipe = Path(folder) / "recipe.toml"
            method = 'method = "stereocorrelation"\n'
            text = recipe.read_text(encoding="utf-8").replace(method, f"{method}systematic = 0.0\n")
            recipe.write_text(text, encoding="utf-8")
            record = inspect(load_recipe(recipe), Progress())
        (part,), nominal = record.parts, record.nominal
        a = MeasuredMap("stereo", part.deviation, part.covariance, part.sources)
        defect = defect_on(nominal, seed) if defective else Uniform()
        truth = study.deviation + defect
        yield nominal, a, scanned(nominal, surface, "scan", truth, (8.0, 0.01), seed), defect


def defect_on(nominal: Nominal, seed: int) -> DeviationField:
    """Return a defect somewhere on the part, away from its edges."""
    mesh, random = nominal.mesh, np.random.default_rng(seed)
    edges = np.concatenate([mesh.nodes[mesh.crease], mesh.nodes[rim(mesh.triangles)]])
    while True:
        centre = mesh.nodes[random.integers(len(mesh))]
        if np.linalg.norm(edges - centre, axis=1).min() > 0.75 * WIDTH:
            return Bump(tuple(centre.tolist()), HEIGHT, WIDTH)


def rim(triangles: np.ndarray) -> np.ndarray:
    """Return the nodes on open rims."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, count = np.unique(sides, axis=0, return_counts=True)
    return np.unique(unique[count == 1])


def scanned(
    nominal: Nominal,
    surface: PartSurface,
    name: str,
    deviation: DeviationField,
    scanner: tuple[float, float],
    seed: int,
) -> MeasuredMap:
    """Return the map of a scan of so many points per mm² with so much noise (mm)."""
    scan = uniform_scan(surface, deviation, scanner[0], scanner[1], seed)
    cloud = Cloud(name, scan.points_scan, scan.normals_scan)
    alignment = Register(nominal, Pose.identity())(cloud)
    found = Deviate()((cloud,), (alignment,), nominal, np.ones(len(nominal.mesh), bool))
    return MeasuredMap(name, found.deviation, found.covariance)


if __name__ == "__main__":
    main()
