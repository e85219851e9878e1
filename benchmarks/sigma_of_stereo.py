"""Is the stated uncertainty of stereocorrelation true? Claimed against actual, over many seeds of the virtual rig.

    python benchmarks/sigma_of_stereo.py known lenses self --seeds 40
    python benchmarks/sigma_of_stereo.py known --part milled --cameras 3 --element 3
    python benchmarks/sigma_of_stereo.py known --tau 0.02 --length 25 --stated

Every seed draws noise, gain and offset, and what is believed of the cameras, around the truth, and every third one the
speckle and the rig too; with a systematic shift every one does, so that the shift is new in each. z is
(found - true) / sigma at the observed nodes; `raw` in the solver's gauge, `rest` once the motions listed as hidden or
weak are projected out of error and covariance; `weak` is their squared Mahalanobis distance over its mean, with the
99 % limit; `node` the 5th and 95th percentile, over the nodes, of scatter over sigma; `naive` the z of what each
picture's own gradients and s² times the inverse claim, raw and rest. Errors are rms, sigmas rms (raw) and median
(rest); `observed` counts the nodes of which every evaluation point is seen.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.stats import chi2
from stereo_trial import CASES, Setup, Trial, cover, error_of, modes_of, remover, rms

from inspect3d.arrays import Booleans, Floats
from inspect3d.correlation.correlate import Correlate
from inspect3d.correlation.picture import Pictures
from inspect3d.correlation.shape import Shape
from inspect3d.correlation.systematic import Systematic

HEAD = (
    "case         seeds |   e raw  sigma  z raw | weak of mean (99 %)  | e rest  sigma     max | z rest  cover |"
    " node 5, 95 | naive raw, rest cover | observed settled kappa     s"
)


@dataclass(frozen=True, eq=False)
class Score:
    """One seed: errors and sigmas (mm) of the nodes of the mesh, NaN where not observed."""

    raw: Floats
    raw_sigma: Floats
    rest: Floats
    rest_sigma: Floats
    naive: Floats
    naive_sigma: Floats
    naive_raw: Floats
    naive_raw_sigma: Floats
    distance: float
    modes: int
    steps: Booleans
    observed: float
    settled: bool
    kappa: float
    seconds: float

    def __str__(self) -> str:
        seen = np.isfinite(self.rest)
        z = self.rest[seen] / self.rest_sigma[seen]
        return (
            f"  e {1e3 * rms(self.raw[seen]):6.2f} um, z {rms(self.raw[seen] / self.raw_sigma[seen]):.3f}; "
            f"rest {1e3 * rms(self.rest[seen]):.2f} um, max {1e3 * np.abs(self.rest[seen]).max():.1f}, "
            f"z {rms(z):.3f} cover {cover(z):.3f}; weak {self.distance:.1f}/{self.modes}; kappa {self.kappa:.2f}"
            f"{'' if self.settled else ', not settled'}; {self.seconds:.1f} s"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"{', '.join(CASES)}; default: known")
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--part", choices=("freeform", "smooth", "milled"), default="freeform")
    parser.add_argument("--cameras", type=int, default=2)
    parser.add_argument("--full", action="store_true", help="5 megapixels in place of a quarter of that")
    parser.add_argument("--element", type=float, help="mm; default 4.6, full 2.7")
    parser.add_argument("--noise", type=float, default=0.01, help="share of full scale")
    parser.add_argument("--pixels", type=float, default=2.5, help="px for each evaluation point")
    parser.add_argument("--tau", type=float, default=0.0, help="px, size of a smooth systematic shift of the pictures")
    parser.add_argument("--length", type=float, default=25.0, help="mm over the part, of its correlation")
    parser.add_argument("--stated", action="store_true", help="state the shift to the engine")
    parser.add_argument("--quiet", action="store_true", help="the table only")
    chosen = parser.parse_args()
    element = chosen.element or (2.7 if chosen.full else 4.6)
    setup = Setup(chosen.part, chosen.cameras, chosen.full, element, chosen.noise, tau=chosen.tau, length=chosen.length)
    stated = Systematic(chosen.tau, chosen.length) if chosen.stated else None
    settings = Correlate(pixels=chosen.pixels, systematic=stated)
    rows = []
    for name in chosen.cases or ["known"]:
        scores = []
        for trial in setup.trials(CASES[name], range(chosen.seeds)):
            scores.append(_score(settings, trial, element))
            if not chosen.quiet:
                print(scores[-1], flush=True)
        rows.append(_row(name, scores))
        if chosen.part == "milled":
            rows.append(_row(f"{name}/step", scores, near=True))
    print(
        f"{chosen.part}, {chosen.cameras} cameras, {'full' if chosen.full else 'half'} size, {element:g} mm, "
        f"noise {chosen.noise:g}, {chosen.pixels:g} px a point, "
        f"systematic {chosen.tau:g} px over {chosen.length:g} mm{' stated' if chosen.stated else ''}; lengths in um"
    )
    print(HEAD, *rows, sep="\n", flush=True)


def _score(settings: Correlate, trial: Trial, element: float) -> Score:
    started = time.perf_counter()
    shape = settings(trial.nominal, trial.grey, trial.views, trial.freedom)
    sigma = np.sqrt(shape.uncertainty.variances)
    seconds = time.perf_counter() - started
    sound = shape.sound
    away = sound & ~trial.near_step(shape.scene.nodes, element)
    error = error_of(shape, trial, shape.values)
    gauge, weak = modes_of(shape, trial)
    both = np.column_stack([gauge, weak])
    raw, raw_sigma = _without(shape, error, gauge, sigma, away)
    rest, rest_sigma = _without(shape, error, both, sigma, away)
    distance = 0.0
    if weak.shape[1]:
        fields = (weak / len(weak)) * away[:, None]
        fields = fields - remover(gauge, away).T @ (gauge.T @ fields)
        sizes = fields.T @ error
        distance = float(sizes @ np.linalg.solve(fields.T @ shape.uncertainty.covariance(fields), sizes))
    naive = error_of(shape, trial, shape.state.deviation)
    covariance = _naive(shape, trial, gauge)
    claims = []
    for modes in (both, gauge):
        free = np.eye(len(naive)) - modes @ remover(modes, away)
        claims += [free @ naive, np.sqrt(np.einsum("ij,jk,ik->i", free, covariance, free))]
    whole = shape.scene.own & (shape.scene.share >= 1)
    everywhere = np.full((8, len(shape.mesh)), np.nan)
    columns = (raw, raw_sigma, rest, rest_sigma, *claims)
    everywhere[:, shape.scene.node[sound]] = np.stack(columns)[:, sound]
    return Score(
        *everywhere,
        distance,
        weak.shape[1],
        trial.near_step(shape.mesh.nodes, element),
        float(sound[whole & ~shape.mesh.crease[shape.scene.node]].mean()),
        shape.settled,
        shape.uncertainty.correlated,
        seconds,
    )


def _without(shape: Shape, error: Floats, modes: Floats, sigma: Floats, away: Booleans) -> tuple[Floats, Floats]:
    """Return an error less its modes, by least squares over nodes away from steps, and what the claim is for it."""
    if not modes.shape[1]:
        return error, sigma
    inverse = remover(modes, away)
    return error - modes @ (inverse @ error), np.sqrt(shape.uncertainty.variances_without(modes, inverse))


def _naive(shape: Shape, trial: Trial, gauge: Floats) -> Floats:
    """Return s² (J'J)⁻¹ (n, n) with each picture's own gradients, cameras eliminated, in the gauge; two views or more.

    Every view beyond the first is compared with the first one; grey levels are normalised in every facet.
    """
    scene, stack = shape.scene, Pictures(trial.grey).blurred(0.0)
    facet, corners = scene.points.facet, scene.triangles[scene.points.facet]
    normals = np.einsum("pi,pij->pj", scene.points.shapes, scene.normals[corners])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lift = (scene.points.shapes * shape.state.deviation[corners]).sum(axis=1)
    places = scene.points.places + lift[:, None] * normals
    unknowns = trial.freedom.unknowns
    steps = trial.freedom.scale(shape.views, scene.nodes) if unknowns else np.zeros(0)
    greys, lifts, cameras = [], [], []
    for k, view in enumerate(shape.views):
        here = view.project(places)
        read = stack.sampled(k, here)
        spread = _by_facet(read[:, 0], facet)[1]
        greys.append((read[:, 0] - _by_facet(read[:, 0], facet)[0][facet]) / spread[facet])
        slope = read[:, 1:] / spread[facet, None]
        lifts.append((slope * (view.project(places + 1e-3 * normals) - here)).sum(axis=1) / 1e-3)
        moved = [trial.freedom.moved(shape.views, 1e-3 * step)[k].project(places) for step in np.diag(steps)]
        cameras.append(np.stack([(slope * (m - here)).sum(axis=1) / 1e-3 for m in moved], axis=1) if moved else None)
    n = len(scene.nodes)
    matrix, energy, count = np.zeros((n + unknowns, n + unknowns)), 0.0, 0
    for k in range(1, len(shape.views)):
        both = scene.taking[facet, 0] & scene.taking[facet, k]
        values = ((lifts[0] - lifts[k])[:, None] * scene.points.shapes)[both]
        rows = np.repeat(np.arange(len(values)), 3)
        nodal = sparse.csr_matrix((values.ravel(), (rows, corners[both].ravel())), shape=(len(values), n))
        columns = nodal if not unknowns else sparse.hstack([nodal, (cameras[0] - cameras[k])[both]]).tocsr()
        matrix += (columns.T @ columns).toarray()
        energy += float(((greys[0] - greys[k])[both] ** 2).sum())
        count += len(values)
    noise = energy / (count - n - unknowns)
    matrix += np.diag([*([1e-9 * np.median(np.diag(matrix))] * n), *([0.0] * unknowns)])
    if unknowns:
        sigmas = trial.freedom.spread(trial.freedom.columns)[1]
        matrix[n:, n:] += np.diag(noise * (steps / sigmas) ** 2)
    g = gauge.shape[1]
    bordered = np.zeros((n + unknowns + g,) * 2)
    bordered[: n + unknowns, : n + unknowns] = matrix
    bordered[:n, n + unknowns :] = gauge * np.median(np.diag(matrix)[:n])
    bordered[n + unknowns :, :n] = bordered[:n, n + unknowns :].T
    return noise * np.linalg.pinv(bordered, 1e-16, hermitian=True)[:n, :n]


def _by_facet(values: Floats, facet: Floats) -> tuple[Floats, Floats]:
    """Return mean and standard deviation of the points of every facet."""
    count = np.bincount(facet)
    mean = np.bincount(facet, values) / count
    return mean, np.sqrt(np.maximum(np.bincount(facet, values**2) / count - mean**2, 1e-12))


def _row(name: str, scores: list[Score], near: bool = False) -> str:
    """Return a row of the table: nodes away from steps, or those near them."""
    keep = scores[0].steps if near else ~scores[0].steps
    fields = ("raw", "raw_sigma", "rest", "rest_sigma", "naive", "naive_sigma", "naive_raw", "naive_raw_sigma")
    raw, raw_sigma, rest, rest_sigma, *naive = (
        np.stack([getattr(score, field)[keep] for score in scores]) for field in fields
    )
    seen = np.isfinite(rest)
    z, claimed, claimed_raw = rest[seen] / rest_sigma[seen], *((naive[k] / naive[k + 1])[seen] for k in (0, 2))
    often = seen.sum(axis=0) >= 0.75 * len(scores)
    squares, claims = (np.nanmean(values[:, often] ** 2, axis=0) for values in (rest, rest_sigma))
    low, high = np.percentile(np.sqrt(squares / claims), [5, 95]) if often.any() else (np.nan, np.nan)
    modes, distance = sum(s.modes for s in scores), sum(s.distance for s in scores)
    weak = f"{distance / modes:9.2f} ({chi2.ppf(0.99, modes) / modes:.2f})" if modes else " " * 16
    return (
        f"{name:12s} {len(scores):2d} | {1e3 * rms(raw[seen]):7.2f} {1e3 * rms(raw_sigma[seen]):6.2f} "
        f"{rms(raw[seen] / raw_sigma[seen]):6.3f} | {weak:>20s} | {1e3 * rms(rest[seen]):6.2f} "
        f"{1e3 * np.median(rest_sigma[seen]):6.2f} {1e3 * np.abs(rest[seen]).max():7.1f} | {rms(z):6.3f} "
        f"{cover(z):6.3f} | {low:4.2f} {high:4.2f} | "
        f"{rms(claimed_raw):5.2f} {rms(claimed):5.2f} {cover(claimed):6.3f} | "
        f"{np.mean([s.observed for s in scores]):8.4f} {sum(s.settled for s in scores):4d}/{len(scores)} "
        f"{np.mean([s.kappa for s in scores]):5.2f} {np.mean([s.seconds for s in scores]):5.1f}"
    )


if __name__ == "__main__":
    main()
