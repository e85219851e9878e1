"""Who resolves what on the milled part: mismatch, facet errors and scallops, against noise, spacing and element size.

    python benchmarks/milled_features.py scans --lengths 0 1 4
    python benchmarks/milled_features.py stereo --elements 2 3 4.6

The part has a mismatch of 40 um at the beginning of its section, facets alternately 15 um too high and too low, 16 mm
from high to high, whose first harmonic has the height 38.2 um, and scallops of 12 um, 4 mm apart. `scans`: a laser
scanner above the part with 20 and 79 um of noise, lines 0.2 to 2 mm apart, points 0.2 mm apart along a line, read point
by point. The noise of neighbouring points is independent, or alike over a length L: exp(-r² / 2 L²). `stereo`: two
photographs of 5 megapixels, cameras known, read at the nodes.

Printed: found height and standard uncertainty, um, in brackets where it is not resolved; - where the readings are too
coarse to tell; and after it what the true deviation shows at the same places in the alignment of the map. The mismatch
lies on an edge of 30 degrees, and the best fit, which moves the part along x to share the errors out, changes it.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from inspect3d.compare.feature_estimate import FeatureEstimate
from inspect3d.compare.features import features_of_nodes, features_of_points
from inspect3d.deviate.deviate import Deviate
from inspect3d.inspection import inspect
from inspect3d.measure import Cloud
from inspect3d.nominal.load import load_nominal
from inspect3d.pose import Pose
from inspect3d.progress import Progress
from inspect3d.recipe import load_recipe
from inspect3d.recipe_feature import Feature
from inspect3d.recipe_types import Region
from inspect3d.register.gauge import best_fit
from inspect3d.register.mobility import jacobian
from inspect3d.register.register import Register
from inspect3d.virtual.datasets import make_dataset
from inspect3d.virtual.laser_scanner import LaserScanner
from inspect3d.virtual.milled import MilledSizes, machining, milled

ACROSS = (1.0, 0.0, 0.0)
START = MilledSizes().section_start
FIRST, *_, LAST = MilledSizes().facet_borders


def place(low: float, high: float) -> Region:
    """Return the place between two positions along x, on the milled top."""
    return Region(box=((low, 4.0, 15.0), (high, 44.0, 60.0)))


FEATURES = (
    Feature(
        name="mismatch",
        kind="step",
        place=place(LAST + 0.5, START + 16),
        across=ACROSS,
        point=(START, 0.0, 0.0),
        wavelength=4.0,
    ),
    Feature(name="facets", kind="waviness", place=place(FIRST, LAST), across=ACROSS, wavelength=16.0),
    Feature(name="scallops", kind="scallops", place=place(START + 2, START + 30), across=ACROSS, wavelength=4.0),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("methods", choices=("scans", "stereo"))
    parser.add_argument("--elements", type=float, nargs="+", default=[2.0, 4.0], help="mm")
    parser.add_argument("--lengths", type=float, nargs="+", default=[0.0], help="mm, over which scan noise is alike")
    parser.add_argument(
        "--spacings", type=float, nargs="+", default=[0.2, 0.5, 1.0, 2.0], help="mm, of the scan's lines"
    )
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    print(f"{'found ± sigma, true':34s} {'mismatch':>14s}       {'facets':>14s}       {'scallops':>14s}")
    if chosen.methods == "scans":
        scans(chosen.lengths, chosen.spacings, chosen.seed)
    else:
        for element in chosen.elements:
            stereo(element, chosen.seed)


def scans(lengths: list[float], spacings: list[float], first: int) -> None:
    """Print a row for each noise, each length over which it is alike, and each spacing of the lines."""
    part = milled()
    with tempfile.TemporaryDirectory() as folder:
        part.write_step(Path(folder) / "part.step")
        nominal = load_nominal(Path(folder) / "part.step", element_size=3.0)
    surface, counted = part.surface(), np.ones(len(nominal.mesh), bool)
    cases = product(enumerate((0.020, 0.079)), lengths, spacings)
    for (number, noise), length, spacing in cases:
        alike = {"noise": 0.0, "drift": noise, "drift_length": length} if length else {"noise": noise}
        scanner = LaserScanner(line_spacing=spacing, point_spacing=0.2, **alike)
        scan = scanner(surface, machining(4.0), 100 * first + number + int(10 * spacing))
        cloud = Cloud("scan", scan.points_scan, scan.normals_scan)
        found = Deviate()((cloud,), (Register(nominal, Pose.identity())(cloud),), nominal, counted)
        features = features_of_points(
            FEATURES, nominal.mesh, found.points_cad, found.distance, found.noise, found.alignments[0]
        )
        mesh, seen = nominal.mesh, found.deviation.observed
        fitted = best_fit(mesh.nodes[seen], mesh.normals[seen], mesh.areas[seen], found.deviation.value[seen])
        moved = fitted.motion(machining(4.0)(mesh.nodes[seen]))
        feet = nominal.surface.closest(found.points_cad)
        shift = jacobian(feet.points, feet.normals, fitted.origin) @ moved
        exact = machining(4.0)(feet.points) + shift
        truth = features_of_points(FEATURES, mesh, found.points_cad, exact, found.noise, found.alignments[0])
        alike_over = f", L {length:g} mm" if length else ""
        row(f"scan, {1e3 * noise:.0f} um{alike_over}, lines {spacing:g} mm", features, truth)


def stereo(element: float, seed: int) -> None:
    """Print a row for an element size."""
    with tempfile.TemporaryDirectory() as folder:
        make_dataset("milled-stereo", Path(folder), seed)
        recipe = Path(folder) / "recipe.toml"
        size = "element_size = {}"
        text = recipe.read_text(encoding="utf-8").replace(size.format("2.0"), size.format(element))
        recipe.write_text(text, encoding="utf-8")
        record = inspect(load_recipe(recipe), Progress())
    (part,) = record.parts
    features = features_of_nodes(FEATURES, record.nominal.mesh, part.deviation, part.covariance, part.alignments[0])
    at = part.deviation.observed
    exact = np.where(at, machining(4.0)(record.nominal.mesh.nodes), np.nan)
    true = replace(part.deviation, value=exact)
    truth = features_of_nodes(FEATURES, record.nominal.mesh, true, part.covariance, part.alignments[0])
    row(f"stereo, elements {element:g} mm", features, truth)


def row(name: str, features: tuple[FeatureEstimate, ...], truth: tuple[FeatureEstimate, ...]) -> None:
    """Print what a method found, and what is true."""
    cells = (
        f"{words(found):>14s} {'' if true.value is None else f'{1e3 * true.value:.1f}':5s}"
        for found, true in zip(features, truth, strict=True)
    )
    print(f"{name:34s} " + " ".join(cells), flush=True)


def words(feature: FeatureEstimate) -> str:
    """Return a height with its uncertainty."""
    if feature.value is None or feature.sigma is None:
        return "-"
    found = f"{1e3 * feature.value:.1f} ± {1e3 * feature.sigma:.1f}"
    return found if feature.resolved else f"({found})"


if __name__ == "__main__":
    main()
