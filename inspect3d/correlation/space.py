"""How the nodes of a scene may move: each by itself, or together as fewer unknowns have it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np
from scipy import sparse

from inspect3d.arrays import Booleans, Floats, Integers

if TYPE_CHECKING:
    from inspect3d.correlation.evaluation import EvaluationPoints
    from inspect3d.correlation.factor import Factor
    from inspect3d.correlation.scene import Scene
    from inspect3d.nominal.nurbs import Nurbs

SUPPORT = 1e-6
FILLED = 0.05  # share of entries that are not zero
RIDGE = 1e-9
Matrix: TypeAlias = sparse.csr_matrix | Floats


class Factored(Protocol):
    """A symmetric positive definite matrix A (k, k), factored."""

    def solve(self, right: Floats) -> Floats:
        """Return A⁻¹ b for right-hand sides (k,) or (k, m)."""

    def quadratic(self, rows: sparse.csr_matrix) -> Floats:
        """Return t' A⁻¹ t for each row t, which belongs to a node and its neighbours."""

    def times(self, number: float) -> Factored:
        """Return the factor of A times a positive number."""


class Space(Protocol):
    """The motions q (k,) that a scene allows: its n nodes move by B q, its facets by what their corners make of it."""

    @property
    def confined(self) -> bool:
        """Tell whether the nodes could move in more ways than it allows."""

    def rows(self, scene: Scene) -> sparse.csr_matrix:
        """Return B (n, k)."""

    def motion(self, scene: Scene, deviation: Floats) -> Floats:
        """Return the q that moves the nodes by a deviation (n,) mm."""

    def bent(self, scene: Scene, points: EvaluationPoints, motion: Floats) -> EvaluationPoints:
        """Return evaluation points moved along the normals by what facets that are linear miss of a motion (k,)."""

    def gathered(self, scene: Scene, parts: Floats) -> Floats:
        """Return sums (k, ...) of what each facet gives its corners, (f, 3, ...)."""

    def at_corners(self, scene: Scene, motions: Floats) -> Floats:
        """Return how motions (k, m) move the corners of the facets, (f, 3, m)."""

    def matrix(self, scene: Scene, blocks: Floats, stiffness: float) -> Matrix:
        """Return the sum (k, k) of the facets' blocks (f, 3, 3), with the plate and what supports it; see `plates`."""

    def plate(self, scene: Scene, blocks: Floats, stiffness: float) -> Matrix:
        """Return the plate (k, k) that pulls the shape back to the nominal one."""

    def factored(self, scene: Scene, matrix: Matrix) -> Factored:
        """Return the factor of such a matrix.

        Raises
        ------
        ValueError
            It is not positive definite.
        """

    def blocks(self, scene: Scene, factor: Factored) -> Floats:
        """Return the covariance of each facet's corners (f, 3, 3) where the inverse of the matrix is that of q."""

    def smoother(self, scene: Scene, weights: Floats) -> sparse.csr_matrix:
        """Return (n, k), the deviation to be reported of a motion, for facets of weights (f,)."""

    def surfaces(self, motion: Floats) -> tuple[Nurbs, ...]:
        """Return the measured surfaces of a motion (k,), where it moves any."""

    def restricted(self, node: Integers, kept: Booleans) -> Space:
        """Return the space over some of the nodes, by number, and some of the facets (f,)."""


@dataclass(frozen=True)
class EveryNode:
    """Every node moves by itself, q = u, and facets are linear in between: three-noded elements (paper, section 2)."""

    @property
    def confined(self) -> bool:
        """Return False."""
        return False

    def rows(self, scene: Scene) -> sparse.csr_matrix:
        """Return the identity."""
        return sparse.identity(len(scene.nodes), format="csr")

    def motion(self, scene: Scene, deviation: Floats) -> Floats:
        """Return the deviation."""
        return deviation

    def bent(self, scene: Scene, points: EvaluationPoints, motion: Floats) -> EvaluationPoints:
        """Return the points: nothing is missed."""
        return points

    def gathered(self, scene: Scene, parts: Floats) -> Floats:
        """Return nodal sums."""
        return scene.gathered(parts)

    def at_corners(self, scene: Scene, motions: Floats) -> Floats:
        """Return the motions of the nodes that are corners."""
        return motions[scene.triangles]

    def matrix(self, scene: Scene, blocks: Floats, stiffness: float) -> sparse.csr_matrix:
        """Return a sparse matrix."""
        values = scene.assembled(blocks)
        plate, support = plates(scene, values[scene.diagonal], stiffness)
        return scene.matrix(values + plate + support)

    def plate(self, scene: Scene, blocks: Floats, stiffness: float) -> sparse.csr_matrix:
        """Return a sparse matrix."""
        return scene.matrix(plates(scene, scene.gathered(np.einsum("fii->fi", blocks)), stiffness)[0])

    def factored(self, scene: Scene, matrix: Matrix) -> Factor:
        """Return the sparse factor."""
        return scene.ordering.factor(sparse.csr_matrix(matrix).data)

    def blocks(self, scene: Scene, factor: Factored) -> Floats:
        """Return the entries of the sparse inverse."""
        from inspect3d.correlation.factor import Factor

        assert isinstance(factor, Factor)
        return factor.blocks(scene.triangles)

    def smoother(self, scene: Scene, weights: Floats) -> sparse.csr_matrix:
        """Return T of `Scene.smoother`, against the bias of linear facets."""
        return scene.smoother(weights)

    def surfaces(self, motion: Floats) -> tuple[Nurbs, ...]:
        """Return none: the nodes are all that moves."""
        return ()

    def restricted(self, node: Integers, kept: Booleans) -> EveryNode:
        """Return the same."""
        return self


EVERY_NODE = EveryNode()


def plates(scene: Scene, diagonal: Floats, stiffness: float) -> tuple[Floats, Floats]:
    """Return a plate for a nodal matrix and what supports it always, both in the scene's pattern.

    Parameters
    ----------
    diagonal : (n,) of the nodal matrix
    stiffness : of the plate, in medians of the diagonal. A millionth of that stays always, to carry nodes that show no
        texture, a hundredth for those of which slivers are seen only, and a billionth of a ridge
    """
    median = typical(diagonal)
    support = SUPPORT * median * scene.support
    support[scene.diagonal] += RIDGE * median
    return stiffness * median * scene.plate, support


def typical(diagonal: Floats) -> float:
    """Return the median stiffness of the nodes that show texture, from the diagonal (n,) of a nodal matrix."""
    stiff_ones = diagonal[diagonal > 0]
    return float(np.median(stiff_ones)) if len(stiff_ones) else 1.0


def packed(matrix: sparse.csr_matrix) -> Matrix:
    """Return a matrix, in full where that is quicker to multiply."""
    return matrix.toarray() if matrix.nnz > FILLED * np.prod(matrix.shape) else matrix


def in_full(matrix: Matrix) -> Floats:
    """Return a matrix with its zeros."""
    return matrix if isinstance(matrix, np.ndarray) else np.asarray(matrix.toarray())


def congruent(matrix: sparse.csr_matrix, rows: Matrix) -> Floats:
    """Return R'MR in full."""
    return in_full(rows.T @ (matrix @ rows))
