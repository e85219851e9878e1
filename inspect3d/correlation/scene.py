"""The part of the inspection mesh that the cameras see, ready for the kernel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from inspect3d.arrays import Booleans, Floats, Integers, unit
from inspect3d.camera import View
from inspect3d.correlation.cells import SMALLEST, cut_facets, whole_facets
from inspect3d.correlation.evaluation import EvaluationPoints, evaluation_points, points_per_edge
from inspect3d.correlation.factor import Ordering
from inspect3d.correlation.space import EVERY_NODE, Space
from inspect3d.correlation.visibility import visibility
from inspect3d.nominal.nominal import Nominal
from inspect3d.nominal.remeshing import FEATURE_ANGLE
from inspect3d.outcome import MeasurementError

FEWEST = 6
WHOLE = 0.5
SAMPLE = 200


@dataclass(frozen=True, eq=False)
class Scene:
    """Facets, or what a cut leaves of them, that at least two cameras see, their nodes and the points that count.

    Parameters
    ----------
    nodes, normals : (n, 3) mm and unit, of the nodes of these facets
    triangles : (f, 3) indices into them
    points : that every view taking part sees
    taking : (f, v), the views that see the facet
    node : (n,) number of each node in the inspection mesh, where it may be there more than once, see `Cells`
    sheet : (n,) number of the sheet of the CAD that each node moves with
    own : (n,), whether the node of the inspection mesh lies on it; true once for each
    facet : (f,) number of each facet there
    share : (n,) how much of the evaluation points around a node counts
    space : how the nodes may move
    within : the order of elimination in a larger scene and the number (n,) that each node has there, if any
    """

    nodes: Floats
    normals: Floats
    triangles: Integers
    points: EvaluationPoints
    taking: Booleans
    node: Integers
    sheet: Integers
    own: Booleans
    facet: Integers
    share: Floats
    space: Space = EVERY_NODE
    within: tuple[Ordering, Integers] | None = None

    @cached_property
    def centre(self) -> Floats:
        """Return the mean of the nodes, (3,) mm: small motions of the part are about it."""
        return self.nodes.mean(axis=0)

    @property
    def sample(self) -> Floats:
        """Return some hundred of the nodes, all over the part, (k, 3) mm."""
        return self.nodes[:: 1 + len(self.nodes) // SAMPLE]

    @property
    def whole(self) -> Booleans:
        """Tell around which nodes at least half of the evaluation points count, (n,)."""
        return self.share >= WHOLE

    @cached_property
    def upright(self) -> Booleans:
        """Tell which nodes move across the facets that are seen around them, within 30 degrees, (n,).

        A node of a sharp edge may belong to a face beside these facets. Its motion slides them along themselves, which
        says nothing about the face that it belongs to.
        """
        a, b, c = (self.nodes[self.triangles[:, k]] for k in range(3))
        across = unit(self.gathered(np.repeat(np.cross(b - a, c - a)[:, None], 3, axis=1)))
        return np.asarray((across * self.normals).sum(axis=1) >= np.cos(FEATURE_ANGLE))

    @cached_property
    def extent(self) -> float:
        """Return the diagonal of the nodes' bounding box, mm."""
        return float(np.linalg.norm(np.ptp(self.nodes, axis=0)))

    @property
    def _sides(self) -> Integers:
        """Return the ends of the sides of all facets, (3 f, 2)."""
        return np.concatenate([self.triangles[:, [0, 1]], self.triangles[:, [1, 2]], self.triangles[:, [2, 0]]])

    @cached_property
    def adjacency(self) -> sparse.csr_matrix:
        """Return a one for every pair of neighbours, (n, n)."""
        n, ends = len(self.nodes), self._sides
        pairs = sparse.coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(n, n)).tocsr()
        pairs = pairs + pairs.T
        pairs.data[:] = 1.0
        return pairs

    @cached_property
    def rim(self) -> Booleans:
        """Tell which facets touch the edge of what is seen, (f,)."""
        n = len(self.nodes)
        sides = np.sort(
            np.concatenate([self.triangles[:, [0, 1]], self.triangles[:, [1, 2]], self.triangles[:, [2, 0]]])
        )
        keys, counts = np.unique(sides @ [n, 1], return_counts=True)
        outer = np.zeros(n, dtype=bool)
        outer[np.concatenate(divmod(keys[counts == 1], n))] = True
        return np.asarray(outer[self.triangles].any(axis=1))

    @cached_property
    def ordering(self) -> Ordering:
        """Return the order of elimination for matrices that couple neighbours and neighbours of neighbours."""
        near = self.adjacency + sparse.identity(len(self.nodes), format="csr")
        pattern = (near @ near).tocsr()
        pattern.sort_indices()
        return Ordering(pattern.indptr.astype(np.int64), pattern.indices.astype(np.int64), self.within)

    @cached_property
    def positions(self) -> Integers:
        """Return where the entries of each facet's 3 x 3 block stand in the pattern, (f, 3, 3)."""
        return self.position(np.repeat(self.triangles, 3, axis=1), np.tile(self.triangles, (1, 3))).reshape(-1, 3, 3)

    def position(self, rows: Integers, columns: Integers) -> Integers:
        """Return where entries stand in the pattern."""
        return np.searchsorted(self._keys, rows * len(self.nodes) + columns)

    @cached_property
    def _keys(self) -> Integers:
        """Number the entries of the pattern by row and column, ascending."""
        n = len(self.nodes)
        return np.repeat(np.arange(n), np.diff(self.ordering.starts)) * n + self.ordering.columns

    @cached_property
    def diagonal(self) -> Integers:
        """Return where the diagonal stands in the pattern, (n,)."""
        every = np.arange(len(self.nodes))
        return self.position(every, every)

    @cached_property
    def plate(self) -> Floats:
        """Return R = L'L in the pattern, with L u = mean of the neighbours' u less the node's own: a bending plate."""
        near = self.adjacency
        laplacian = sparse.diags(1 / np.asarray(near.sum(axis=1)).ravel()) @ near - sparse.identity(len(self.nodes))
        bending = (laplacian.T @ laplacian).tocoo()
        values = np.zeros(len(self.ordering.columns))
        values[self.position(bending.row.astype(np.int64), bending.col.astype(np.int64))] = bending.data
        return values

    @cached_property
    def plate_of_motions(self) -> Floats:
        """Return B'RB (k, k), the plate under the motions of the space, in full."""
        rows = self.space.rows(self)
        return np.asarray((rows.T @ (self.matrix(self.plate) @ rows)).toarray())

    def matrix(self, values: Floats) -> sparse.csr_matrix:
        """Return a matrix (n, n) with these values in the pattern."""
        n = len(self.nodes)
        return sparse.csr_matrix((values, self.ordering.columns, self.ordering.starts), shape=(n, n))

    def assembled(self, blocks: Floats) -> Floats:
        """Return the values in the pattern of a sum of 3 x 3 blocks (f, 3, 3)."""
        size = len(self.ordering.columns)
        values = np.zeros(size)
        values += np.bincount(self.positions.ravel(), blocks.ravel(), minlength=size)
        return values

    def gathered(self, parts: Floats) -> Floats:
        """Return nodal sums (n, ...) of what each facet gives its corners, (f, 3, ...)."""
        n, nodes = len(self.nodes), self.triangles.ravel()
        flat = parts.reshape(len(nodes), int(np.prod(parts.shape[2:])))
        sums = np.empty((n, flat.shape[1]))
        for k, column in enumerate(flat.T):
            sums[:, k] = np.bincount(nodes, column, minlength=n)
        return sums.reshape(n, *parts.shape[2:])

    def tilt(self, deviation: Floats) -> Floats:
        """Return the slope of the deviation over each facet, (f,): by how much (rad) it turns the surface."""
        a, b, c = (self.nodes[self.triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        double = np.linalg.norm(normal, axis=1, keepdims=True)
        u = deviation[self.triangles, None]
        sides = u[:, 0] * (c - b) + u[:, 1] * (a - c) + u[:, 2] * (b - a)
        return np.linalg.norm(np.cross(normal / double, sides), axis=1) / double[:, 0]

    def restricted(self, kept: Booleans) -> tuple[Scene, Integers]:
        """Return the scene of some facets (f,) only, and the number (k,) that each of its nodes has here."""
        node, triangles = np.unique(self.triangles[kept], return_inverse=True)
        counts = np.diff(self.points.starts)
        chosen = np.repeat(kept, counts)
        points = EvaluationPoints(
            self.points.places[chosen],
            self.points.shapes[chosen],
            np.concatenate([[0], np.cumsum(counts[kept])]),
            self.points.chord,
        )
        before = np.bincount(self.triangles.ravel(), np.repeat(counts, 3), minlength=len(self.nodes))
        after = np.bincount(self.triangles[kept].ravel(), np.repeat(counts[kept], 3), minlength=len(self.nodes))
        rest = Scene(
            self.nodes[node],
            self.normals[node],
            triangles.reshape(-1, 3),
            points,
            self.taking[kept],
            self.node[node],
            self.sheet[node],
            self.own[node],
            self.facet[kept],
            (self.share * after / before)[node],
            self.space.restricted(node, kept),
            (self.ordering, node),
        )
        return rest, node

    def carried(self, other: Scene, deviation: Floats) -> Floats:
        """Return the deviation (n,) that nodes of another scene of the same mesh have, (m,); zero where it has none."""
        count = 1 + max(self.sheet.max(), other.sheet.max())
        here, there = (scene.node * count + scene.sheet for scene in (self, other))
        at = np.searchsorted(there, here)
        at[at == len(there)] = 0
        return np.where(there[at] == here, deviation[at], 0.0)

    def smoother(self, weights: Floats) -> sparse.csr_matrix:
        """Return T = (I + M_lumped⁻¹ M) / 2 with the mass matrices of the facets weighted by `weights` (f,).

        The least-squares T3 interpolant of a smooth field misses it at the nodes by (h²/12) lap(u) to leading order;
        T takes that off.
        """
        n = len(self.nodes)
        a, b, c = (self.nodes[self.triangles[:, k]] for k in range(3))
        area = weights * np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        mass = self.assembled(area[:, None, None] / 12 * (np.ones((3, 3)) + np.eye(3)))
        consistent = self.matrix(mass)
        lumped = np.asarray(consistent.sum(axis=1)).ravel()
        inverse = np.divide(1.0, lumped, out=np.zeros(n), where=lumped > 0)
        smoother = 0.5 * (sparse.diags(inverse) @ consistent) + sparse.diags(np.where(lumped > 0, 0.5, 1.0))
        smoother = smoother.tocsr()
        smoother.eliminate_zeros()
        return smoother


def scene(
    nominal: Nominal,
    views: Sequence[View],
    pixels: float,
    steepest: float,
    masks: Sequence[Booleans | None],
    per_edge: int | None = None,
    lifted: bool = True,
    cut: bool = True,
) -> Scene:
    """Return what the views see of a part.

    Parameters
    ----------
    pixels : px of the largest picture that one evaluation point stands for
    steepest : rad, largest angle between normal and line of sight
    masks : of each view, True where its picture may be used, or None
    per_edge : evaluation points along the edge of every facet, in place of `pixels`
    lifted : points on the nominal surface; else on the flat facets
    cut : facets cut where sheets of the CAD end

    Raises
    ------
    MeasurementError
        No facet is seen by two cameras.
    """
    mesh = nominal.mesh
    count = points_per_edge(mesh, views, pixels) if per_edge is None else np.full(len(mesh.triangles), per_edge)
    points, feet = evaluation_points(nominal, count, lifted)
    cells = cut_facets(nominal, points, feet) if cut else whole_facets(mesh, points)
    see = visibility(nominal, cells, views, steepest, masks)
    points, n = cells.points, len(cells.node)
    there = np.where(cells.part >= SMALLEST, np.diff(points.starts), 0)
    counts = np.bincount(points.facet[see.used], minlength=len(there))
    good = (there > 0) & (counts >= FEWEST)
    kept = np.flatnonzero(good)
    if not len(kept):
        raise MeasurementError(_unseen(views, see.seen))
    chosen = see.used & good[points.facet]
    node, triangles = np.unique(cells.triangles[kept], return_inverse=True)
    seen = EvaluationPoints(
        points.places[chosen], points.shapes[chosen], np.concatenate([[0], np.cumsum(counts[kept])]), points.chord
    )
    around = np.bincount(cells.triangles.ravel(), np.repeat(there, 3), minlength=n)
    taken = np.bincount(cells.triangles[kept].ravel(), np.repeat(counts[kept], 3), minlength=n)
    return Scene(
        mesh.nodes[cells.node[node]],
        cells.normals[node],
        triangles.reshape(-1, 3),
        seen,
        see.taking[kept],
        cells.node[node],
        cells.sheet[node],
        cells.own[node],
        cells.facet[kept],
        (taken / np.maximum(around, 1))[node],
    )


def _unseen(views: Sequence[View], seen: Booleans) -> str:
    shares = ", ".join(f"{100 * row.mean():.0f} %" for row in seen)
    return (
        f"No part of the surface is seen by two of the {len(views)} cameras (they see {shares} of it): check the "
        "poses, and that the normals of the part point out of the material."
    )
