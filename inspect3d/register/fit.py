"""What the common alignment is fitted to: the whole map, datums in their order, or reference points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import sparse

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.outcome import MeasurementError
from inspect3d.register.gauge import MAD, TUKEY, Gauge, best_fit
from inspect3d.register.ordered import Level

MOTIONS = ("rx", "ry", "rz", "tx", "ty", "tz")
"""The names of the motions that can be locked: turns about and shifts along the axes of the CAD frame."""

STEPS = 30
SETTLED = 1e-4
AROUND = 1.6  # edge lengths around a reference point within which nodes stand for it
ALONG = 0.5  # cosine between the direction of a reference point and the normals of its nodes


@dataclass(frozen=True, eq=False)
class Datum:
    """A feature that an alignment rests on: the nodes of a face or a few.

    Parameters
    ----------
    name : to call it by
    nodes : (n,) which nodes of the inspection mesh belong to it
    """

    name: str
    nodes: Booleans


@dataclass(frozen=True)
class ReferencePoint:
    """A point at which the deviation is to be zero (RPS).

    Parameters
    ----------
    point : mm, CAD frame
    direction : along the normal of the surface that is meant, either way
    """

    point: tuple[float, float, float]
    direction: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Fit:
    """How the common alignment is found in a map.

    "best" is the robust best fit of all nodes. "datum" fits the datums in their order, each robustly: the first fixes
    the motions it can, the next those that are left, as in 3-2-1 or plane, axis and point. "rps" brings the deviation
    at the reference points to zero, or as near to it as more than six allow. What datums or points leave open is best
    fitted. Locked motions are not made in any case; they stay those of the start.

    Parameters
    ----------
    kind : "best", "datum" or "rps"
    datums : in their order
    points : reference points
    locked : motions about the CAD's origin that are not made, of `MOTIONS`
    """

    kind: Literal["best", "datum", "rps"] = "best"
    datums: tuple[Datum, ...] = ()
    points: tuple[ReferencePoint, ...] = ()
    locked: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """Return which alignment it is, to go on a sentence with."""
        what = {
            "best": "robust best fit over all nodes",
            "datum": f"datums {', '.join(datum.name for datum in self.datums)} in this order",
            "rps": f"{len(self.points)} reference points",
        }[self.kind]
        return f"{what}, {' and '.join(self.locked)} locked" if self.locked else what

    def __call__(self, mesh: InspectionMesh, seen: Integers, values: Floats, growth: bool = False) -> Gauge:
        """Return the gauge of a map: values (k,) mm at the nodes `seen` (k,).

        Raises
        ------
        MeasurementError
            A datum or a reference point was not measured, or determines nothing.
        """
        best = best_fit(mesh.nodes[seen], mesh.normals[seen], mesh.areas[seen], values, growth)
        locked = tuple(MOTIONS.index(name) for name in self.locked)
        if self.kind == "best":
            return replace(best, offset=0.0, locked=locked) if locked else best
        whole = Level(sparse.identity(len(seen), format="csr"), best.weights)
        first = self._datum_levels(mesh, seen) if self.kind == "datum" else (self._points_level(mesh, seen),)
        gauge = replace(best, offset=0.0, levels=(*first, whole), locked=locked)
        gauge = _robust(gauge, values, len(first)) if self.kind == "datum" else gauge
        self._require_use(gauge)
        return gauge

    def _datum_levels(self, mesh: InspectionMesh, seen: Integers) -> tuple[Level, ...]:
        levels = []
        for datum in self.datums:
            at = np.flatnonzero(datum.nodes[seen])
            if len(at) < 3:
                raise MeasurementError(
                    f"Datum {datum.name} was observed at {len(at)} nodes, and 3 are needed: measure it, choose other "
                    "faces or a larger box, or a smaller element_size."
                )
            readings = sparse.csr_matrix((np.ones(len(at)), (np.arange(len(at)), at)), (len(at), len(seen)))
            levels.append(Level(readings, mesh.areas[seen[at]]))
        return tuple(levels)

    def _points_level(self, mesh: InspectionMesh, seen: Integers) -> Level:
        rows = []
        for k, reference in enumerate(self.points, start=1):
            weights = _around(reference, mesh, seen)
            if not weights.any():
                place = ", ".join(f"{x:g}" for x in reference.point)
                raise MeasurementError(
                    f"Reference point {k} at ({place}) mm was not measured, or no surface across its direction is "
                    f"there: {AROUND * mesh.edge_length:.2g} mm around it there is no observed node."
                )
            rows.append(weights / weights.sum())
        return Level(sparse.csr_matrix(np.array(rows)), np.ones(len(rows)))

    def _require_use(self, gauge: Gauge) -> None:
        """Refuse a datum that fixes no motion."""
        if self.kind != "datum":
            return
        for datum, count in zip(self.datums, gauge.determined, strict=False):
            if not count:
                raise MeasurementError(
                    f"Datum {datum.name} fixes no motion that the ones before it and the locked ones leave open: leave "
                    "it away, or choose another."
                )


def _around(reference: ReferencePoint, mesh: InspectionMesh, seen: Integers) -> Floats:
    """Return the weights (k,) of the nodes `seen` that stand for a reference point; all zero where there is none."""
    direction = np.array(reference.direction) / np.linalg.norm(reference.direction)
    distance = np.linalg.norm(mesh.nodes[seen] - np.array(reference.point), axis=1) / mesh.edge_length
    near = (distance < AROUND) & (np.abs(mesh.normals[seen] @ direction) > ALONG)
    if near.any():
        closest = np.flatnonzero(near)[distance[near].argmin()]
        near &= mesh.normals[seen] @ mesh.normals[seen[closest]] > ALONG
    return np.where(near, 1 - (distance / AROUND) ** 2, 0.0)


def _robust(gauge: Gauge, values: Floats, count: int) -> Gauge:
    """Return the gauge with Tukey weights in its first `count` levels: dirt on a datum does not tilt the part."""
    plain = gauge.levels
    for _ in range(STEPS):
        remains = gauge(values)
        levels = []
        for level in plain[:count]:
            off = level.readings @ remains
            width = TUKEY * MAD * np.median(np.abs(off))
            share = np.clip(1 - (off / width) ** 2, 0, None) ** 2 if width > 0 else np.ones(len(off))
            levels.append(Level(level.readings, level.weights * share))
        new = replace(gauge, levels=(*levels, *plain[count:]))
        change = max(
            np.abs(a.weights - b.weights).max() / b.weights.max() for a, b in zip(levels, gauge.levels, strict=False)
        )
        gauge = new
        if change < SETTLED:
            break
    return gauge
