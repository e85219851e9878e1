"""The part of the inspection mesh that the cameras see, ready for the kernel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from inspect3d.arrays import Booleans, Floats, Integers, unit
from inspect3d.correlation.evaluation import EvaluationPoints
from inspect3d.correlation.factor import Ordering
from inspect3d.correlation.space import EVERY_NODE, Space, congruent, packed
from inspect3d.nominal.remeshing import FEATURE_ANGLE

WHOLE = 0.5
SLIVER, FIRMER = 0.25, 1e4
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
    loose : nodes of slivers are not held: what holds them would pull at unknown cameras
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
    loose: bool = False

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

    @property
    def slivers(self) -> Booleans:
        """Tell around which nodes hardly a point counts, (n,), where these are held.

        Of their facets slivers are seen, far off the node: what these show does not tell where it is.
        """
        return self.share < (0.0 if self.loose else SLIVER)

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
        return self._bending(np.ones(len(self.nodes)))

    @cached_property
    def support(self) -> Floats:
        """Return such a plate that is ten thousand times as stiff at nodes of slivers."""
        return self._bending(np.where(self.slivers, FIRMER, 1.0)) if self.slivers.any() else self.plate

    def _bending(self, weights: Floats) -> Floats:
        """Return L'WL in the pattern, W of weights (n,)."""
        near = self.adjacency
        laplacian = sparse.diags(1 / np.asarray(near.sum(axis=1)).ravel()) @ near - sparse.identity(len(self.nodes))
        bending = (laplacian.T @ sparse.diags(weights) @ laplacian).tocoo()
        values = np.zeros(len(self.ordering.columns))
        values[self.position(bending.row.astype(np.int64), bending.col.astype(np.int64))] = bending.data
        return values

    @cached_property
    def plate_of_motions(self) -> Floats:
        """Return B'RB (k, k), the plate under the motions of the space, in full."""
        return congruent(self.matrix(self.plate), packed(self.space.rows(self)))

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
            self.loose,
        )
        return rest, node

    def of_nodes(self, owner: Integers) -> Scene:
        """Return the scene with nodes numbered as in a coarser mesh.

        Parameters
        ----------
        owner : (k,) number there of each node of this inspection mesh; for those that the coarser one has not, of
            another, which they are not
        """
        return replace(self, node=owner[self.node], own=self.own & (owner[self.node] == self.node))

    def carried(self, other: Scene, deviation: Floats, ends: Integers) -> Floats:
        """Return the deviation (n,) that nodes have in another scene (m,): the mean of their ends, or 0 without any.

        Parameters
        ----------
        ends : (k, 2) numbers in the other's inspection mesh of the ends of each node of this one's
        """
        count = 1 + max(self.sheet.max(), other.sheet.max())
        there = other.node * count + other.sheet
        here = ends[self.node] * count + self.sheet[:, None]
        at = np.searchsorted(there, here)
        at[at == len(there)] = 0
        found = there[at] == here
        return (deviation[at] * found).sum(axis=1) / np.maximum(found.sum(axis=1), 1)

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
