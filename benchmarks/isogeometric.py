"""Control points of NURBS faces against nodes by themselves, on the same pictures of the virtual rig.

    python benchmarks/isogeometric.py study --full        the paper's first study: table 1, both maps against the truth
    python benchmarks/isogeometric.py step                height of a step, inside a face and along a border of faces
    python benchmarks/isogeometric.py sigma --seeds 12    is sigma true, inside the space of the splines and outside?
    python benchmarks/isogeometric.py sigma --where inside --cases lenses self
    python benchmarks/isogeometric.py speed --seeds 7     CPU time of the study against the mesh's, both in one process
    python benchmarks/isogeometric.py faces FOLDER        the faces of STEP and IGES files against their B-rep

Lengths are in µm, times are CPU seconds of the correlation alone. z is error over sigma, cover the share within 1.96;
"flagged" the share of nodes where splines do not follow the part, by their own word. Errors of unknown cameras are
compared once motions listed as hidden or weak are out of both; `weak` is the squared Mahalanobis distance of these over
its mean, with the 99 % limit, `node` the 5th and 95th percentile, over the nodes, of scatter over sigma where not
flagged. Fresh seeds start at `--first`: noise, gain and beliefs are new in each, the speckle in every third.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2
from spline_field import SplineField
from stereo_trial import CASES, Setup, Trial, cover, error_of, modes_of, remover, rms

from inspect3d.arrays import Booleans, Floats
from inspect3d.correlation.correlate import Correlate
from inspect3d.correlation.picture import Pictures
from inspect3d.correlation.residual import residuals
from inspect3d.correlation.shape import Shape
from inspect3d.correlation.splines import Splines
from inspect3d.correlation.state import Level
from inspect3d.correlation.ways import SHAPE
from inspect3d.nominal.nurbs import Nurbs
from inspect3d.nominal.nurbs_face import nurbs_of
from inspect3d.nominal.step_iges import read_brep
from inspect3d.outcome import InputError
from inspect3d.virtual.deviation_field import Step
from inspect3d.virtual.freeform import FreeformSizes
from inspect3d.virtual.milled import MilledSizes

PIXELS = 8.0
PLATE = 0.1  # medians of the stiffness of a node
BANDS = (1.0, 5.0)  # mm from a step, of the nodes that tell its height
HEIGHT = 0.04  # mm
FEW = 30  # nodes, too few for a figure
OFTEN = 0.75  # share of the seeds, in which a node tells its scatter
HEAD = "    e  sigma     z  cover "
METHODS = {
    "nodes": Correlate(pixels=PIXELS),
    "nodes, plate": Correlate(pixels=PIXELS, levels=(*SHAPE[:-1], Level(0, PLATE, 20, "shape"))),
    "CAD's knots": Correlate(pixels=PIXELS, splines=Splines()),
    "halved once": Correlate(pixels=PIXELS, splines=Splines(refine=1)),
    "halved twice": Correlate(pixels=PIXELS, splines=Splines(refine=2)),
    "CAD's knots, apart": Correlate(pixels=PIXELS, splines=Splines(continuity=0.0)),
}
SIZES = {"freeform": FreeformSizes(), "smooth": FreeformSizes(poles=(17, 4), degrees=(8, 3))}
SPED = ("CAD's knots", "nodes")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("study", "step", "sigma", "speed", "faces"))
    parser.add_argument("folder", nargs="?", type=Path, help="of STEP and IGES files")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=0, help="seed")
    parser.add_argument("--full", action="store_true", help="5 megapixels in place of a quarter of that")
    parser.add_argument("--element", type=float, default=2.7, help="mm")
    parser.add_argument("--pixels", type=float, default=PIXELS, help="px for each evaluation point, of `sigma`")
    parser.add_argument("--where", choices=("inside", "outside"), help="deviations of `sigma`; default: both")
    parser.add_argument("--part", choices=("freeform", "smooth", "milled"), help="of `sigma`; default: all")
    parser.add_argument("--cases", nargs="+", choices=tuple(CASES), default=["known"])
    chosen = parser.parse_args()
    if chosen.what == "faces":
        _faces(chosen.folder)
        return
    {"study": _study, "step": _step, "sigma": _sigma, "speed": _speed}[chosen.what](chosen)


def _seeds(chosen: argparse.Namespace) -> range:
    return range(chosen.first, chosen.first + chosen.seeds)


def _study(chosen: argparse.Namespace) -> None:
    setup = Setup("smooth", full=chosen.full, element=chosen.element)
    for case in chosen.cases:
        rows: dict[str, list] = {}
        for trial in setup.trials(CASES[case], _seeds(chosen)):
            for name in ("CAD's knots", "nodes", "nodes, plate"):
                if name == "nodes, plate" and case != "known":
                    continue
                shape, (_, seconds) = _measured(METHODS[name], trial)
                error, sigma = _judged(shape, trial)
                values = shape.values[shape.sound]
                rows.setdefault(name, []).append(
                    (len(shape.state.motion), values.mean(), values.std(), error.mean(), error.std(), np.median(sigma),
                     rms(error / sigma), *_stages(shape, trial), seconds)
                )  # fmt: skip
        print(f"cameras {case}; {chosen.seeds} seeds, elements of {chosen.element:g} mm")
        print(
            "                unknowns   map mean    std   error mean    std   sigma      z   residual start   end     s"
        )
        for name, found in rows.items():
            k, *lengths, z, start, end, seconds = np.mean(found, axis=0)
            words = " ".join(f"{1e3 * value:8.2f}" for value in lengths)
            print(f"{name:14s} {k:9.0f}  {words} {z:6.2f} {start:10.1f} {end:9.1f} {seconds:8.1f}", flush=True)


def _speed(chosen: argparse.Namespace) -> None:
    """Take turns on the same pictures; the first turn only loads compiled code."""
    setup = Setup("smooth", full=chosen.full, element=chosen.element)
    for case in chosen.cases:
        trial = next(setup.trials(CASES[case], range(1)))
        turns = [[_measured(METHODS[name], trial)[1] for name in SPED] for _ in range(1 + chosen.seeds)][1:]
        spent, ratios = np.median(turns, axis=0), np.median([splines / nodes for splines, nodes in turns], axis=0)
        print(f"cameras {case}, medians of {len(turns)}")
        for clock, seconds, ratio in zip(("clock", "processor"), spent.T, ratios, strict=True):
            words = ", ".join(f"{name} {each:.2f} s" for name, each in zip(SPED, seconds, strict=True))
            print(f"  {clock:9s} {words}, ratio {ratio:.2f}", flush=True)


def _step(chosen: argparse.Namespace) -> None:
    inside = Step(HEIGHT, (50.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    places = {
        "inside a face (freeform)": (Setup("freeform", element=chosen.element, deviation=inside), 50.0),
        "along a border (milled)": (Setup("milled", element=chosen.element), MilledSizes().section_start),
    }
    print(f"height found of a step of {1e3 * HEIGHT:g} µm, nodes {BANDS[0]:g} to {BANDS[1]:g} mm away; mean over seeds")
    for words, (setup, at) in places.items():
        for trial in setup.trials(CASES["known"], _seeds(chosen)):
            for name in ("nodes", "CAD's knots, apart", "CAD's knots", "halved once", "halved twice"):
                try:
                    shape, _ = _measured(METHODS[name], trial)
                except Exception as error:
                    print(f"{words:26s} {name:18s} {error}")
                    continue
                height, sigma = _height(shape, at)
                truth = trial.dataset.deviation(shape.scene.nodes)
                true, _ = _height(shape, at, truth)
                print(
                    f"{words:26s} {name:18s} found {1e3 * height:6.1f} true {1e3 * true:6.1f} sigma {1e3 * sigma:5.2f} "
                    f"unknowns {len(shape.state.motion)}",
                    flush=True,
                )


def _height(shape: Shape, at: float, values: Floats | None = None) -> tuple[float, float]:
    """Return the height of a step across the plane x = at, and its standard uncertainty."""
    x, sound = shape.scene.nodes[:, 0] - at, shape.sound & (shape.scene.normals[:, 2] > 0.7)
    beyond, before = (sound & (BANDS[0] < side * x) & (side * x < BANDS[1]) for side in (1, -1))
    weights = beyond / beyond.sum() - before / before.sum()
    variance = float(weights @ shape.uncertainty.covariance(weights[:, None])[:, 0])
    return float(weights @ (shape.values if values is None else values)), float(np.sqrt(variance))


def _sigma(chosen: argparse.Namespace) -> None:
    sizes = {part: SIZES[part] for part in SIZES if chosen.part in (None, part)}
    inside = {f"{part}, in their space": (part, SplineField.drawn(size, 0.03, 1)) for part, size in sizes.items()}
    outside = {
        "freeform, a bump of 12 mm": ("freeform", None),
        "freeform, a step of 40 µm": ("freeform", Step(HEIGHT, (50.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
        "milled, steps at its borders": ("milled", None),
    }
    outside = {words: what for words, what in outside.items() if chosen.part in (None, what[0])}
    chosen_ones = (inside if chosen.where != "outside" else {}) | (outside if chosen.where != "inside" else {})
    print(f"{'':49s}{HEAD} flagged {HEAD} others {HEAD} weak (99 %)  node 5, 95  kappa settled")
    for words, (part, deviation) in chosen_ones.items():
        setup = Setup(part, full=chosen.full, element=chosen.element, deviation=deviation)
        for case in chosen.cases:
            found: dict[str, list[Told]] = {}
            for trial in setup.trials(CASES[case], _seeds(chosen)):
                for name in ("CAD's knots", "halved once", "halved twice")[: 1 if "in their" in words else 3]:
                    found.setdefault(name, []).append(_told(replace(METHODS[name], pixels=chosen.pixels), trial))
            for name, rows in found.items():
                print(f"{words:28s} {case:6s} {name:12s} {_row(rows)}", flush=True)


@dataclass(frozen=True, eq=False)
class Told:
    """One map: errors and sigmas (n,) mm of the nodes of the mesh, NaN where there are none, and what is flagged.

    Parameters
    ----------
    distance, modes : squared Mahalanobis distance of the motions listed as weak, and how many there are
    """

    error: Floats
    sigma: Floats
    flagged: Booleans
    distance: float
    modes: int
    kappa: float
    settled: bool


def _row(rows: list[Told]) -> str:
    errors, sigmas = (np.stack([getattr(row, field) for row in rows]) for field in ("error", "sigma"))
    seen, flagged = np.isfinite(errors), np.stack([row.flagged for row in rows])
    scores = [_scored(errors[some], sigmas[some]) for some in (seen, seen & flagged, seen & ~flagged)]
    told = seen & ~flagged
    often = told.mean(axis=0) >= OFTEN
    squares, claims = (np.where(told, values, 0.0)[:, often] ** 2 for values in (errors, sigmas))
    node = np.sqrt(squares.sum(axis=0) / claims.sum(axis=0))
    low, high = np.percentile(node, [5, 95]) if often.any() else (np.nan, np.nan)
    modes = sum(row.modes for row in rows)
    weak = f"{sum(row.distance for row in rows) / modes:.2f} ({chi2.ppf(0.99, modes) / modes:.2f})" if modes else "-"
    return (
        f"{scores[0]} {flagged[seen].mean():7.3f} {scores[1]} {scores[2]} {weak:>16s} {low:5.2f} {high:.2f} "
        f"{np.mean([row.kappa for row in rows]):6.2f} {sum(row.settled for row in rows):3d}/{len(rows)}"
    )


def _scored(error: Floats, sigma: Floats) -> str:
    """Return rms error, median sigma, z and cover of some nodes; dashes where they are too few."""
    if len(error) < FEW:
        return f"{'-':>6s} {'-':>6s} {'-':>5s} {'-':>6s} "
    z = error / sigma
    return f"{1e3 * rms(error):6.2f} {1e3 * np.median(sigma):6.2f} {rms(z):5.2f} {cover(z):6.3f} "


def _told(correlate: Correlate, trial: Trial) -> Told:
    shape, _ = _measured(correlate, trial)
    model, sure, sound = shape.uncertainty.model, shape.uncertainty, shape.sound
    assert model is not None
    of_nodes = np.full((2, len(shape.mesh)), np.nan)
    of_nodes[:, shape.scene.node[sound]] = _judged(shape, trial)
    flagged = np.zeros(len(shape.mesh), dtype=bool)
    flagged[shape.scene.node] = model.missed
    gauge, weak = modes_of(shape, trial)
    distance = 0.0
    if weak.shape[1]:
        fields = weak * sound[:, None]
        fields = fields - remover(gauge, sound).T @ (gauge.T @ fields)
        sizes = fields.T @ error_of(shape, trial, shape.values)
        distance = float(sizes @ np.linalg.solve(fields.T @ sure.covariance(fields), sizes))
    return Told(*of_nodes, flagged, distance, weak.shape[1], sure.correlated, shape.settled)


def _measured(correlate: Correlate, trial: Trial) -> tuple[Shape, Floats]:
    """Return what is measured, and the seconds that takes by the clock and of the processor, (2,)."""
    started = np.array([time.perf_counter(), time.process_time()])
    shape = correlate(trial.nominal, trial.grey, trial.views, trial.freedom)
    return shape, np.array([time.perf_counter(), time.process_time()]) - started


def _judged(shape: Shape, trial: Trial) -> tuple[Floats, Floats]:
    """Return errors and sigmas of the sound nodes, without the motions that nothing tells or hardly."""
    error, sound = error_of(shape, trial, shape.values), shape.sound
    modes = np.column_stack(modes_of(shape, trial))
    if not modes.shape[1]:
        return error[sound], np.sqrt(shape.uncertainty.variances)[sound]
    inverse = remover(modes, sound)
    sigma = np.sqrt(shape.uncertainty.variances_without(modes, inverse))
    return (error - modes @ (inverse @ error))[sound], sigma[sound]


def _stages(shape: Shape, trial: Trial) -> tuple[float, float]:
    """Return the rms residual on the nominal shape and on the found one, grey levels."""
    stack = Pictures(trial.grey).sharp
    none = np.zeros(len(shape.state.motion))
    found = [
        residuals(shape.scene, stack, shape.views, motion)[1] for motion in (none, shape.state.motion)
    ]  # fmt: skip
    return float(np.sqrt(np.nanmean(found[0] ** 2))), float(np.sqrt(np.nanmean(found[1] ** 2)))


def _faces(folder: Path) -> None:
    random = np.random.default_rng(0)
    for path in _models(folder):
        part, worst, failed = read_brep(path), 0.0, 0
        shares, more = [0.0], 0.0
        converted = {}
        for number, surface in enumerate(part.surfaces, start=1):
            try:
                nurbs = converted[number] = nurbs_of(part, number)
            except InputError:
                failed += 1
                continue
            low = [surface.FirstUParameter(), surface.FirstVParameter()]
            high = [surface.LastUParameter(), surface.LastVParameter()]
            points = part.points_at(np.full(12, number), random.uniform(low, high, (12, 2)))
            worst = max(worst, _away(nurbs, points))
        for curve, numbers, tolerance in zip(part.curves, part.edge_faces, part.edge_tolerance, strict=True):
            if curve is not None:
                at = np.linspace(curve.FirstParameter(), curve.LastParameter(), 7)
                points = np.array([curve.Value(t).Coord() for t in at.tolist()])
                for n in numbers:
                    if n in converted:
                        away = _away(converted[n], points)
                        shares.append(away / tolerance)
                        if away > tolerance:  # the face itself may gape from its edge by as much
                            feet = part.project(points, np.full(len(points), n))[0]
                            more = max(more, away - np.linalg.norm(feet - points, axis=1).max())
        print(
            f"{path.name:40s} {len(part.faces):5d} faces, {failed} do not convert, worst {worst:.1e} mm; "
            f"{len(part.edges)} edges, worst {max(shares):.3f} of their tolerance, {sum(s > 1 for s in shares)} beyond "
            f"it, by {more:.1e} mm more than the face of the B-rep",
            flush=True,
        )


def _away(nurbs: Nurbs, points: Floats) -> float:
    """Return how far points (n, 3) lie off a surface at most, mm."""
    return float(np.linalg.norm(nurbs.points(nurbs.parameters(points)) - points, axis=1).max())


def _models(folder: Path) -> Iterator[Path]:
    """Yield the STEP and IGES files of a folder."""
    yield from (p for p in sorted(folder.iterdir()) if p.suffix.lower() in (".step", ".stp", ".iges", ".igs"))


if __name__ == "__main__":
    main()
