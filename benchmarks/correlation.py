"""How accurate is stereocorrelation on virtual parts? The figures that its issue asks for, against the truth.

    python benchmarks/correlation.py known picks --seeds 3
    python benchmarks/correlation.py chord milled scallops --half

`known`: cameras known. `picks`: self-calibrated from six picks with 1.5 px noise and a focal length 3 % off, beside the
paper's two steps on the same pictures. `chord`: points on the nominal surface against flat facets as in the paper.
`milled`: mismatch and facet errors of the milled block. `scallops`: their height, found against true, over mesh size.
Lengths are in um; `rest` is the error once hidden motions, and weak ones that are known from priors mostly, are out.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from stereo_trial import CASES, Setup, Trial, error_of, modes_of, remover, rms

from inspect3d.arrays import Booleans, Floats
from inspect3d.correlation.correlate import Correlate
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.correlation.picks import Picks, ideal_camera, placed_by_picks
from inspect3d.correlation.shape import Shape
from inspect3d.correlation.ways import TWO_STEPS
from inspect3d.virtual.milled import MilledSizes
from inspect3d.virtual.picks import picks
from inspect3d.virtual.scene import Scene

LENS_OFF = 1.03
ROUGH, CENTRE, DISTORTION = 0.05, 0.025, (0.2, 0.3, 1e-3, 1e-3, 0.0)
FULL, HALF = 2.7, 4.6
PITCH = 4.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"{', '.join(TABLES)}; default: all")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--half", action="store_true", help="a quarter of the 5 megapixels")
    parser.add_argument("--per-edge", type=int, default=6, help="evaluation points along an edge; 6 make 36 a facet")
    chosen = parser.parse_args()
    for name in chosen.tables or TABLES:
        TABLES[name](chosen)


def _known(chosen: argparse.Namespace) -> None:
    setup, settings = _setup(chosen), Correlate(per_edge=chosen.per_edge)
    print(f"cameras known, {_words(setup, chosen)}")
    for trial in setup.trials(CASES["known"], range(chosen.seeds)):
        print(_line("known", *_measured(settings, trial)), flush=True)


def _picks(chosen: argparse.Namespace) -> None:
    setup = _setup(chosen)
    joint = Correlate(per_edge=chosen.per_edge)
    print(f"self-calibrated from 6 picks (1.5 px), focal length 3 % off, {_words(setup, chosen)}")
    for seed, trial in enumerate(setup.trials(CASES["known"], range(chosen.seeds))):
        start = from_picks(trial, seed)
        shape, seconds = _measured(joint, start)[0::2]
        print(_line("joint", shape, start, seconds), flush=True)
        two, seconds = _measured(replace(joint, levels=TWO_STEPS), start)[0::2]
        print(_line("two steps", two, start, seconds, shape), flush=True)
        for motion in shape.hidden:
            print(f"    {motion.words}")


def _chord(chosen: argparse.Namespace) -> None:
    setup = _setup(chosen)
    print(f"flat facets against lifted points, cameras known, {_words(setup, chosen)}")
    print("  element mm |  nodes | flat e  bias   max | lifted e  bias   max   (bias: rms over noise)")
    for element in (2.0, 2.7, 3.8, 5.4, 7.6) if not chosen.half else (2.7, 3.8, 5.4, 7.6):
        sized = replace(setup, element=element)
        trial = next(sized.trials(CASES["known"], range(1)))
        cells, nodes = [], 0
        for lifted in (False, True):
            shape, _, _ = _measured(Correlate(per_edge=chosen.per_edge, lifted=lifted), trial)
            error = error_of(shape, trial, shape.values)[shape.sound]
            sigma = np.sqrt(shape.uncertainty.variances[shape.sound])
            bias = np.sqrt(max(rms(error) ** 2 - rms(sigma) ** 2, 0.0))
            cells.append(f"{1e3 * rms(error):6.2f} {1e3 * bias:5.2f} {1e3 * np.abs(error).max():5.1f}")
            nodes = int(shape.sound.sum())
        print(f"  {element:10.1f} | {nodes:6d} | {' |   '.join(cells)}", flush=True)


def _milled(chosen: argparse.Namespace) -> None:
    """Print step and facet errors as weighted means over regions one element and more away from the jumps."""
    setup = replace(_setup(chosen), part="milled", element=2.0, scallop=0.012)
    sizes = MilledSizes()
    print(
        f"milled block: mismatch 40, facet errors 15, -15, 15, -15, scallops 12; cameras known, {_words(setup, chosen)}"
    )
    for trial in setup.trials(CASES["known"], range(chosen.seeds)):
        shape, _, seconds = _measured(Correlate(per_edge=chosen.per_edge), trial)
        x = shape.scene.nodes[:, 0]
        borders = (*sizes.facet_borders, sizes.section_start)
        far = shape.sound & ~trial.near_step(shape.scene.nodes, setup.element)
        regions = {f"facet {k + 1}": far & (x > a) & (x < b) for k, (a, b) in enumerate(pairwise(borders[:5]))}
        regions["land"] = far & (x > borders[4]) & (x < borders[5])
        regions["section"] = far & (x > borders[5]) & (x < borders[5] + 12.0)
        true = trial.dataset.deviation(shape.scene.nodes)
        rows = {name: _mean(region) for name, region in regions.items()}
        rows["mismatch"] = rows["section"] - rows["land"]
        for name, row in rows.items():
            sigma = 1e3 * np.sqrt(row @ shape.uncertainty.covariance(row[:, None])[:, 0])
            found, wanted = 1e3 * row @ shape.values, 1e3 * row @ true
            print(f"  {name:9s} found {found:7.2f} +/- {sigma:4.2f}, true {wanted:7.2f}, error {found - wanted:6.2f}")
        print(f"  {seconds:.1f} s", flush=True)


def _mean(region: Booleans) -> Floats:
    return region / region.sum()


def _scallops(chosen: argparse.Namespace) -> None:
    """Print the height of the scallops by the component of their period along x on the section, found against true."""
    setup = replace(_setup(chosen), part="milled", scallop=0.012)
    sizes = MilledSizes()
    print(f"scallops 12 um high, {PITCH:g} mm apart, cameras known, {_words(setup, chosen)}")
    print("  element mm | nodes | height found +/- sigma | seen by a perfect map of these nodes | true")
    for element in (4.0, 2.0, 1.4, 1.0, 0.7):
        trial = next(replace(setup, element=element).trials(CASES["known"], range(1)))
        shape, _, _ = _measured(Correlate(pixels=2.5), trial)
        x = shape.scene.nodes[:, 0]
        region = (
            shape.sound & (x > sizes.section_start + element) & (x < sizes.section_start + sizes.section[0] - element)
        )
        row = _scallop_row(shape, region)
        sigma = 1e3 * np.sqrt(row @ shape.uncertainty.covariance(row[:, None])[:, 0])
        found, perfect = 1e3 * row @ shape.values, 1e3 * row @ trial.dataset.deviation(shape.scene.nodes)
        print(
            f"  {element:10.1f} | {region.sum():5d} | {found:6.2f} +/- {sigma:4.2f} | {perfect:6.2f} | 12.00",
            flush=True,
        )


def _scallop_row(shape: Shape, region: Booleans) -> Floats:
    """Return weights (n,) that fit the height h of h (2 s / pitch)² beside a smooth shape, by least squares."""
    x, y = shape.scene.nodes[region, 0], shape.scene.nodes[region, 1]
    passes = x / PITCH
    scallop = (2.0 * (passes - np.round(passes))) ** 2
    along, across = (x - x.mean()) / np.ptp(x), (y - y.mean()) / np.ptp(y)
    smooth = [along**i * across**j for i in range(4) for j in range(4 - i)]
    row = np.zeros(len(region))
    row[region] = np.linalg.pinv(np.column_stack([scallop, *smooth]))[0]
    return row


def from_picks(trial: Trial, seed: int) -> Trial:
    """Return a trial whose cameras are not known: six picks, a focal length 3 % off, and nothing of the lens."""
    dataset = trial.dataset
    scene = Scene(dataset.part.surface(), dataset.deviation, dataset.speckle)
    clicked = picks(scene, trial.truth, 6, 1.5, seed)
    width = trial.truth[0].camera.size[0]
    focal = LENS_OFF * float(np.mean([view.camera.matrix[0, 0] for view in trial.truth]))
    cameras = tuple(ideal_camera(focal, view.camera.size) for view in trial.truth)
    lenses = (Lens(ROUGH * focal, CENTRE * width, DISTORTION),) * len(cameras)
    priors = tuple(replace(view, camera=camera) for view, camera in zip(trial.truth, cameras, strict=True))
    freedom = Freedom("free", lenses, priors, trial.nominal.mesh.nodes.mean(axis=0))
    placed = placed_by_picks(Picks(clicked.points_cad, clicked.pixels), [None] * len(cameras), cameras, freedom)
    return replace(trial, views=placed.views, freedom=freedom)


def _measured(settings: Correlate, trial: Trial) -> tuple[Shape, Trial, float]:
    started = time.perf_counter()
    shape = settings(trial.nominal, trial.grey, trial.views, trial.freedom)
    return shape, trial, time.perf_counter() - started


def _line(name: str, shape: Shape, trial: Trial, seconds: float, judge: Shape | None = None) -> str:
    """Return errors before and after removal of what `judge`, by default the shape itself, lists as hidden or weak."""
    error = error_of(shape, trial, shape.values)
    gauge, _ = modes_of(shape, trial)
    _, weak = modes_of(judge or shape, trial)
    by_prior = [m.pattern for m in (judge or shape).hidden if np.isfinite(m.sigma) and m.prior > 0.5]
    node, where = np.unique((judge or shape).scene.node, return_index=True)
    at = where[np.clip(np.searchsorted(node, shape.scene.node), 0, len(node) - 1)]
    mostly = np.stack(by_prior, axis=1)[at] if by_prior else np.zeros((len(error), 0))
    cells = []
    for modes in (gauge, np.column_stack([gauge, mostly]), np.column_stack([gauge, weak[at]])):
        inverse = remover(modes, shape.sound) if modes.shape[1] else np.zeros((0, len(error)))
        left = (error - modes @ (inverse @ error))[shape.sound]
        sigma = np.sqrt(shape.uncertainty.variances_without(modes, inverse))[shape.sound]
        cells.append(
            f"{1e3 * rms(left):7.2f} (max {1e3 * np.abs(left).max():5.1f}, sigma {1e3 * rms(sigma):6.2f}, "
            f"z {rms(left / sigma):5.2f})"
        )
    visible = shape.scene.share >= 1
    return (
        f"  {name:9s} raw {cells[0]} | rest, by priors {cells[1]} | rest, all weak {cells[2]} | "
        f"observed {100 * shape.sound[visible].mean():.1f} % of visible, {shape.sound.sum()} nodes, "
        f"{'settled' if shape.settled else 'NOT settled'}, {seconds:.1f} s"
    )


def _setup(chosen: argparse.Namespace) -> Setup:
    return Setup(full=not chosen.half, element=HALF if chosen.half else FULL)


def _words(setup: Setup, chosen: argparse.Namespace) -> str:
    return (
        f"{'2448 x 2048' if setup.full else '1224 x 1024'} px, {setup.element:g} mm elements, "
        f"{chosen.per_edge**2} points a facet, 1 % noise"
    )


TABLES: dict[str, Callable[[argparse.Namespace], None]] = {
    "known": _known,
    "picks": _picks,
    "chord": _chord,
    "milled": _milled,
    "scallops": _scallops,
}


if __name__ == "__main__":
    main()
