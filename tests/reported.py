"""A finished inspection of a box by three methods, made up: two that share pictures, and one bump."""

from dataclasses import replace

import numpy as np
from test_report import a_record, box_mesh, recipe

from inspect3d.compare.compare import Compare
from inspect3d.compare.deviation_region import DeviationRegion
from inspect3d.compare.feature_estimate import FeatureEstimate
from inspect3d.compare.measured_map import MeasuredMap
from inspect3d.compare.sensitivity import OtherAlignment, Sensitivity
from inspect3d.compare.tolerances import tolerances
from inspect3d.compare.verdict import verdict
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.map_covariance import Independent, MapCovariance
from inspect3d.nominal.nominal import Nominal
from inspect3d.nominal.surface import Surface
from inspect3d.record import Record

NOISE = (0.004, 0.008, 0.006)


def three_methods(edge: float = 2.5, **report: object) -> Record:
    """Return a record with the maps of three methods and their comparisons; `report` holds keys of that table."""
    mesh, table, base = box_mesh(edge), recipe(**report), a_record()
    random, limits = np.random.default_rng(5), tolerances(table.part, mesh)
    x, y, z = mesh.nodes.T
    bump = 0.15 * np.exp(-((x - 5) ** 2 + y**2) / 18) * (z > 4.9)
    parts, maps = [], []
    for k, noise in enumerate(NOISE):
        seen = ~mesh.crease & ((z > -4.9) if k else np.ones(len(mesh), bool))
        node = np.flatnonzero(seen)
        value, sigma = np.full(len(mesh), np.nan), np.full(len(mesh), np.nan)
        value[node] = bump[node] * (k < 2) + random.normal(0, noise, len(node))
        sigma[node] = noise
        deviation = Deviation(value, sigma, seen)
        residual = np.where(seen, np.abs(random.normal(0, 0.1, len(mesh))), np.nan) if k else None
        covariance = MapCovariance(node, Independent(sigma[node] ** 2), np.zeros((len(node), 0)))
        part = replace(base.parts[0], name=base.parts[k].name, deviation=deviation, covariance=covariance)
        if k == 0:
            motion = np.array([0, 0, 0, 0, 0, 0.03])
            other = OtherAlignment.of("the datums A, B and C", motion, np.zeros(3), mesh)
            part = replace(part, sensitivity=Sensitivity("a best fit", (other,), np.full(len(mesh), 0.001)))
        step = FeatureEstimate("Kante", "step", 0.04, 0.003, 900, "nodes", 2.5, "" if k < 2 else "too coarse <here>")
        region = DeviationRegion(node[:9], 12.5, np.array([5.0, 0, 5]), 0.15, 0.08, 0.002)
        part = replace(part, features=(step,), regions=(region,) if k == 0 else ())
        parts.append(replace(part, verdict=verdict(deviation, limits, 0.95), residual=residual, points_cad=None))
        maps.append(MeasuredMap(parts[-1].name, deviation, covariance, {"ab": "left <1>.png"} if k else {}))
    nominal = Nominal(table.part.name, Surface(mesh.nodes, mesh.triangles), mesh, 0.003)
    comparisons = Compare()(tuple(maps), mesh)
    return replace(base, recipe=table, nominal=nominal, parts=tuple(parts), warnings=(), comparisons=comparisons)
