"""How long a report of a million nodes takes, and how large it is: a closed body, two methods, tolerance, a section.

Run by hand: `python benchmarks/report_size.py [NODES]`. Seconds are of the processor (user and system), so that a busy
machine does not count; on an idle one they are about those of the clock.
"""

import cProfile
import pstats
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from inspect3d.compare.comparison import Comparison
from inspect3d.compare.tolerances import tolerances
from inspect3d.compare.verdict import verdict
from inspect3d.deviate.deviation import Deviation
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.surface import Surface
from inspect3d.outcome import Status
from inspect3d.recipe import Recipe
from inspect3d.record import InputFile, MeasuredPart, Record
from inspect3d.report.write import write_report


def wavy_body(count: int) -> InspectionMesh:
    """Return a closed ring, 200 mm across, with about that many nodes and a waved surface."""
    around, across = round(np.sqrt(count * 2.5)), round(np.sqrt(count / 2.5))
    u, v = np.meshgrid(2 * np.pi * np.arange(around) / around, 2 * np.pi * np.arange(across) / across, indexing="ij")
    radius = 30 + 2 * np.sin(7 * u) * np.cos(3 * v)
    nodes = np.stack(
        [(70 + radius * np.cos(v)) * np.cos(u), (70 + radius * np.cos(v)) * np.sin(u), radius * np.sin(v)], -1
    )
    number = np.arange(around * across).reshape(around, across)
    right, up = np.roll(number, -1, axis=0), np.roll(number, -1, axis=1)
    corner = np.roll(right, -1, axis=1)
    triangles = np.concatenate(
        [np.stack(each, -1).reshape(-1, 3) for each in ((number, right, corner), (number, corner, up))]
    )
    nodes = nodes.reshape(-1, 3)
    facets = np.cross(nodes[triangles[:, 1]] - nodes[triangles[:, 0]], nodes[triangles[:, 2]] - nodes[triangles[:, 0]])
    normals = np.column_stack([np.bincount(triangles.ravel(), np.repeat(facets[:, k], 3)) for k in range(3)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return InspectionMesh(nodes, triangles, normals, np.zeros(len(nodes), bool), np.full(len(nodes), -1))


def a_record(count: int) -> Record:
    """Return an inspection of the body by two methods, and their comparison."""
    mesh, random = wavy_body(count), np.random.default_rng(0)
    table = Recipe.model_validate(
        {
            "schema": 1,
            "part": {"name": "Wavy ring", "cad": "ring.step", "tolerance": (-0.1, 0.1)},
            "measurements": tuple(
                {"name": name, "method": "scan", "files": ("a.ply",)} for name in ("laser", "stereo")
            ),
            "report": {
                "formats": ("html", "pdf"),
                "sections": ({"point": (0.0, 0.0, 0.0), "normal": (0.0, 1.0, 0.0)},),
                "labels": ({"name": "P1", "point": (100.0, 0.0, 0.0)},),
            },
        }
    )
    limits = tolerances(table.part, mesh)
    parts = []
    form = 0.04 * np.sin(mesh.nodes[:, 0] / 15) + 0.12 * np.exp(-np.sum((mesh.nodes - [70, 0, 30]) ** 2, axis=1) / 40)
    for name, noise, low in (("laser", 0.01, -99.0), ("stereo", 0.006, -20.0)):
        seen = mesh.nodes[:, 2] > low
        value = np.where(seen, form + random.normal(0, noise, len(mesh)), np.nan)
        deviation = Deviation(value, np.where(seen, noise, np.nan), seen)
        judged = verdict(deviation, limits, 0.95)
        parts.append(MeasuredPart(name, "scan", "Scan()", Status.OK, deviation=deviation, verdict=judged))
    files = (InputFile("ring.step", "ab" * 32),)
    nominal = Nominal("Wavy ring", Surface(mesh.nodes, mesh.triangles), mesh, 0.001)
    return Record(table, nominal, tuple(parts), files, {}, (), (compared(mesh, *parts),))


def compared(mesh: InspectionMesh, a: MeasuredPart, b: MeasuredPart) -> Comparison:
    """Return the comparison of two maps with independent errors, as they are."""
    common = a.deviation.observed & b.deviation.observed
    difference = np.where(common, a.deviation.value - b.deviation.value, np.nan)
    sigma = np.where(common, np.hypot(a.deviation.sigma, b.deviation.sigma), np.nan)
    areas = mesh.areas[common] / mesh.areas[common].sum()
    mean = float(areas @ difference[common])
    std = float(np.sqrt(areas @ (difference[common] - mean) ** 2))
    en = np.abs(difference[common]) / (2 * sigma[common])
    share = [
        float(mesh.areas[each].sum() / mesh.areas.sum())
        for each in (a.deviation.observed, b.deviation.observed, common)
    ]
    return Comparison(
        a.name, b.name, common, difference, (a.deviation.value + b.deviation.value) / 2, sigma, "", mean, std,
        (mean - 1.96 * std, mean + 1.96 * std), None, *share, float(np.sqrt(np.mean(en**2))), float(np.mean(en > 1)),
        (), "Both maps as they are.", ("Both maps as they are.",),
    )  # fmt: skip


def main() -> None:
    """Write the report into a folder that is thrown away, and print seconds and sizes."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    record = a_record(count)
    profile = cProfile.Profile(time.process_time)
    with TemporaryDirectory() as name:
        folder = Path(name)
        clock, processor = time.perf_counter(), time.process_time()
        profile.enable()
        write_report(record, folder)
        profile.disable()
        seconds = time.process_time() - processor
        print(
            f"{len(record.nominal.mesh)} nodes: {seconds:.1f} s of the processor, {time.perf_counter() - clock:.1f} s"
        )
        for file in ("report.html", "report.pdf", "laser.vtp", "laser.csv", "laser.parquet"):
            print(f"{file}: {(folder / file).stat().st_size / 1e6:.1f} MB")
    pstats.Stats(profile).sort_stats("cumulative").print_stats("inspect3d", 25)


if __name__ == "__main__":
    main()
