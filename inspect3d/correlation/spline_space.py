"""Nodes that move as the control points of NURBS surfaces have it: u = B q."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.correlation.dense import DenseFactor, cholesky
from inspect3d.correlation.space import RIDGE, Factored, Matrix, congruent, in_full, packed, typical

if TYPE_CHECKING:
    from inspect3d.correlation.evaluation import EvaluationPoints
    from inspect3d.correlation.scene import Scene
    from inspect3d.nominal.nurbs import Nurbs

SOFT = 1e-2  # medians of the stiffness of a node; it flattens a bump of four elements by less than a hundredth
SAMPLES = 4
"""Parts into which the edges of a facet are cut; the centres of what they cut it into are its sample points."""


@dataclass(frozen=True, eq=False)
class SplineSpace:
    """Motions of the control points along their normals, or in all directions, p = Z q mm, by the unknowns q (k,).

    Each facet follows the spline by a cubic, fitted to it at the sample points; for the derivatives by q, by the plane
    that fits best there. The solution is that of the cubic: a residual that vanishes does so whatever it is multiplied
    by.

    Parameters
    ----------
    nodes : (n, c), how the control points move the nodes
    samples : (16 f, c), the same at the sample points of every facet
    patches : the nominal surfaces, their control points numbered one patch after the other
    ways : in which each control point moves, see `Nurbs.along`
    free : Z (c, k), orthonormal columns; none: q = p
    apart : the same where neighbouring faces do not keep together; none: they do not here
    """

    nodes: sparse.csr_matrix
    samples: sparse.csr_matrix
    patches: tuple[Nurbs, ...]
    ways: int = 1
    free: Floats | None = None
    apart: SplineSpace | None = None

    @property
    def confined(self) -> bool:
        """Return True."""
        return True

    def within(self, free: Floats) -> SplineSpace:
        """Return the space of some of its motions only, orthonormal columns (k, m)."""
        return replace(self, free=self._spread(free))

    def rows(self, scene: Scene) -> sparse.csr_matrix:
        """Return B (n, k)."""
        return self._rows

    def motion(self, scene: Scene, deviation: Floats) -> Floats:
        """Return the q that comes nearest to a deviation (n,) mm."""
        return DenseFactor(cholesky(self._square)).solve(self._rows.T @ deviation)

    def bent(self, scene: Scene, points: EvaluationPoints, motion: Floats) -> EvaluationPoints:
        """Return the points moved along the normals from the facets to the cubics."""
        from inspect3d.correlation.point_kernel import bend

        flat = (self._rows @ motion)[scene.triangles]
        at_samples = (self.samples @ self._spread(motion)).reshape(len(flat), -1) - flat @ _shapes().T
        found = np.empty_like(points.places)
        cubics = at_samples @ _to_cubics()
        bend(points.starts, points.shapes, scene.triangles, scene.normals, cubics, points.places, found)
        return replace(points, places=found)

    def gathered(self, scene: Scene, parts: Floats) -> Floats:
        """Return what the corners give the control points."""
        flat = parts.reshape(3 * len(parts), int(np.prod(parts.shape[2:])))
        summed = self._packed.T @ flat
        summed = summed if self.free is None else self.free.T @ summed
        return summed.reshape(len(summed), *parts.shape[2:])

    def at_corners(self, scene: Scene, motions: Floats) -> Floats:
        """Return the corners of the planes that fit best."""
        return (self._packed @ self._spread(motions)).reshape(len(scene.triangles), 3, *motions.shape[1:])

    def matrix(self, scene: Scene, blocks: Floats, stiffness: float) -> Floats:
        """Return a full matrix."""
        found = congruent(_in_blocks(blocks), self._packed)
        found = found if self.free is None else self.free.T @ found @ self.free
        return found + self.plate(scene, blocks, stiffness)

    def plate(self, scene: Scene, blocks: Floats, stiffness: float) -> Floats:
        """Return a full matrix; a soft plate always stays, for control points that hardly anything shows."""
        median = typical(scene.gathered(np.einsum("fii->fi", blocks)))
        return median * (max(stiffness, SOFT) * scene.plate_of_motions + RIDGE * self._square)

    def pushes(self, scene: Scene, blocks: Floats) -> Floats:
        """Return the scores (n, k) that a unit of each motion gives nodes which move by themselves.

        Parameters
        ----------
        blocks : (f, 3, 3), the normal matrices of the facets' corners
        """
        corners, every = scene.triangles.ravel(), np.arange(3 * len(blocks))
        gather = sparse.csr_matrix((np.ones(len(every)), (corners, every)), shape=(len(scene.nodes), len(every)))
        of_points = in_full(gather @ (_in_blocks(blocks) @ self._packed))
        return of_points if self.free is None else of_points @ self.free

    def factored(self, scene: Scene, matrix: Matrix) -> DenseFactor:
        """Return the full factor."""
        return DenseFactor(cholesky(np.array(matrix)))

    def blocks(self, scene: Scene, factor: Factored) -> Floats:
        """Return the covariance of the corners of the planes."""
        assert isinstance(factor, DenseFactor)
        inverse = factor.inverse if self.free is None else self.free @ factor.inverse @ self.free.T
        spread = self._corners @ inverse
        found = np.empty((len(scene.triangles), 3, 3))
        for i in range(3):
            for j in range(3):
                product = self._corners[i::3].multiply(spread[j::3])
                found[:, i, j] = np.asarray(product.sum(axis=1)).ravel()
        return found

    def smoother(self, scene: Scene, weights: Floats) -> sparse.csr_matrix:
        """Return B: cubics are not biased."""
        return self._rows

    def surfaces(self, motion: Floats) -> tuple[Nurbs, ...]:
        """Return the patches whose control points have moved; those that nobody sees have not."""
        ends = np.cumsum([patch.size for patch in self.patches])[:-1]
        parts = np.split(self._spread(motion).reshape(-1, self.ways), ends)
        return tuple(
            patch.moved(np.einsum("ij,ijd->id", part, patch.frames[:, : self.ways]))
            for patch, part in zip(self.patches, parts, strict=True)
        )

    def restricted(self, node: Integers, kept: Booleans) -> SplineSpace:
        """Return the space of all functions over some of the nodes and facets."""
        apart = None if self.apart is None else self.apart.restricted(node, kept)
        return replace(self, nodes=self.nodes[node], samples=self.samples[np.repeat(kept, len(_shapes()))], apart=apart)

    def sharing(self, some: Booleans) -> Booleans:
        """Tell which nodes (n,) have a control point in common with some of them (n,)."""
        moved = self.nodes != 0
        return np.asarray(moved @ (moved.T @ some.astype(np.float64)) > 0)

    @cached_property
    def patch(self) -> Integers:
        """Return the number of the patch that moves each node, (n,)."""
        ends = np.cumsum([self.ways * patch.size for patch in self.patches])
        return np.searchsorted(ends, self.nodes.indices[self.nodes.indptr[:-1]], side="right")

    def _spread(self, motions: Floats) -> Floats:
        """Return the motions of the control points, Z q."""
        return motions if self.free is None else self.free @ motions

    @cached_property
    def _rows(self) -> sparse.csr_matrix:
        return self.nodes if self.free is None else sparse.csr_matrix(self.nodes @ self.free)

    @cached_property
    def _corners(self) -> sparse.csr_matrix:
        """Return (3 f, c), the corners of the plane that fits each function best at the sample points of a facet."""
        fit = sparse.csr_matrix(np.linalg.pinv(_shapes()))
        facets = self.samples.shape[0] // len(_shapes())
        return (sparse.kron(sparse.identity(facets), fit, format="csr") @ self.samples).tocsr()

    @cached_property
    def _packed(self) -> Matrix:
        """Return the corners of the planes, in full where that is quicker to multiply."""
        return packed(self._corners)

    @cached_property
    def _square(self) -> Floats:
        """Return B'B."""
        rows = packed(self._rows)
        return in_full(rows.T @ rows)


def _in_blocks(blocks: Floats) -> sparse.bsr_matrix:
    """Return a matrix of blocks (f, 3, 3) along its diagonal."""
    f = len(blocks)
    return sparse.bsr_matrix((blocks, np.arange(f), np.arange(f + 1)), shape=(3 * f, 3 * f))


def sample_points() -> Floats:
    """Return the barycentric coordinates (16, 3) of the sample points of a facet."""
    return _shapes()


@cache
def _shapes() -> Floats:
    from inspect3d.correlation.evaluation import centres

    return centres(SAMPLES)


@cache
def _to_cubics() -> Floats:
    """Return what values at the sample points give each of the ten cubic monomials of the fit, (16, 10)."""
    from inspect3d.correlation.point_kernel import cubic_monomials

    return np.linalg.pinv(np.array([cubic_monomials(*row) for row in _shapes().tolist()])).T
