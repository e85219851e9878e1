"""Where the pictures are compared: evaluation points, uniform in each facet of the mesh (paper, figure 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats, Integers, floats, integers
from inspect3d.camera import View
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.surface import Feet

LEAST_THINNED = 9


@dataclass(frozen=True, eq=False)
class EvaluationPoints:
    """Points on the nominal surface; the mesh carries their displacement only.

    A point of barycentric coordinates N in its facet moves to X + (sum N_i u_i) n with the nodal motions u_i and the
    direction n of sum N_i n_i, the interpolated normals of the nodes.

    Parameters
    ----------
    places : (p, 3) mm, X
    shapes : (p, 3), N
    starts : (f + 1,), the points of facet i are those from starts[i] to starts[i + 1]
    chord : how far the points lie off the nominal surface at most, mm
    """

    places: Floats
    shapes: Floats
    starts: Integers
    chord: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "places", floats(self.places, "places", None, 3))
        object.__setattr__(self, "shapes", floats(self.shapes, "shapes", len(self.places), 3))
        object.__setattr__(self, "starts", integers(self.starts, "starts", None))

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.places)

    def thinned(self, step: int) -> EvaluationPoints:
        """Return every `step`-th point of each facet, the first included, but of small facets at least nine."""
        counts = np.diff(self.starts)
        steps = np.maximum(1, np.minimum(step, counts // LEAST_THINNED))
        chosen = (np.arange(len(self)) - np.repeat(self.starts[:-1], counts)) % np.repeat(steps, counts) == 0
        starts = np.concatenate([[0], np.cumsum(-(-counts // steps))])
        return EvaluationPoints(self.places[chosen], self.shapes[chosen], starts, self.chord)

    @property
    def facet(self) -> Integers:
        """Return the facet of each point, (p,)."""
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))


def evaluation_points(nominal: Nominal, per_edge: Integers, lifted: bool = True) -> tuple[EvaluationPoints, Feet]:
    """Return n² points in each facet, and where they are on the nominal surface.

    They are the centres of the n² triangles into which n parts of each edge cut the facet.

    Parameters
    ----------
    nominal : whose mesh has f facets
    per_edge : (f,), n
    lifted : put each point on its foot on the nominal surface; else it stays on the flat facet, as in the paper, off
        the surface by the chord
    """
    mesh = nominal.mesh
    starts = np.concatenate([[0], np.cumsum(np.asarray(per_edge, dtype=np.int64) ** 2)])
    shapes = np.empty((starts[-1], 3))
    for n in np.unique(per_edge):
        chosen = np.flatnonzero(per_edge == n)
        shapes[starts[chosen][:, None] + np.arange(n * n)] = centres(int(n))
    places = interpolated(starts, shapes, mesh.triangles, mesh.nodes)
    feet = nominal.surface.closest(places)
    if lifted:
        return EvaluationPoints(feet.points, shapes, starts), feet
    return EvaluationPoints(places, shapes, starts, chord=float(np.abs(feet.distance).max())), feet


def interpolated(starts: Integers, shapes: Floats, triangles: Integers, values: Floats, unit: bool = False) -> Floats:
    """Return nodal vectors (n, 3) at the points of facets (f, 3), see `EvaluationPoints`; `unit`: at length one."""
    from inspect3d.correlation.point_kernel import interpolate

    found = np.empty((len(shapes), 3))
    interpolate(starts, shapes, triangles, values, unit, found)
    return found


def centres(n: int) -> Floats:
    """Return the barycentric coordinates (n², 3) of the centres of the n² equal parts of a triangle."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    upright, turned = i + j < n, i + j < n - 1
    first = np.concatenate([i[upright] + 1 / 3, i[turned] + 2 / 3]) / n
    second = np.concatenate([j[upright] + 1 / 3, j[turned] + 2 / 3]) / n
    order = np.lexsort([second, first])
    return np.stack([1 - first - second, first, second], axis=1)[order]


def points_per_edge(
    mesh: InspectionMesh, views: Sequence[View], pixels: float, least: int = 4, most: int = 48
) -> Integers:
    """Return n for each facet, (f,), so that one of its n² points stands for about `pixels` px of the largest picture.

    A facet behind a camera does not count there; n stays between `least` and `most`.
    """
    area = np.zeros(len(mesh.triangles))
    for view in views:
        ahead = view.depth(mesh.nodes) > 0
        pixel = np.zeros((len(mesh), 2))
        pixel[ahead] = view.project(mesh.nodes[ahead])
        a, b, c = (pixel[mesh.triangles[:, k]] for k in range(3))
        cross = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        area = np.maximum(area, np.where(ahead[mesh.triangles].all(axis=1), 0.5 * np.abs(cross), 0.0))
    return np.clip(np.ceil(np.sqrt(area / pixels)), least, most).astype(np.int64)
