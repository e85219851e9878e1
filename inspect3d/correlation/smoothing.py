"""A plate that smooths a map which has been measured without one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from scipy import sparse

from inspect3d.arrays import Floats
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.space import Factored, Matrix
from inspect3d.correlation.system import System

STEP = 1e-3


@dataclass(frozen=True, eq=False)
class Smoothing:
    """Motions S q in place of the motions q that the pictures alone have given, S = (K + λR)⁻¹ K.

    K is the information of the pictures about the nodes and R a bending plate. With the covariance C of q, that of S q
    is S C S', the sandwich; what S takes off a shape that really curves is not in it.

    Parameters
    ----------
    scene : of n nodes
    blocks : (f, 3, 3) 1/mm², of the facets; their sum is K
    system : with K as its matrix; it has C
    stiffness : λ, in medians of K's diagonal
    """

    scene: Scene
    blocks: Floats
    system: System
    stiffness: float

    def __call__(self, motions: Floats) -> Floats:
        """Return S q for motions (n,) or (n, k)."""
        return self._stiff.solve(self._information @ motions)

    def taken(self, motion: Floats) -> Floats:
        """Return what the plate takes off the shape, q - S q = (K + λR)⁻¹ λR q, (n,): its bias as far as q is known."""
        return motion - self(motion)

    def variances(self, rows: sparse.csr_matrix) -> Floats:
        """Return the diagonal of T S C S' T'; each row of T is of a few neighbours.

        The part S K⁻¹ S' = (K + λR)⁻¹ K (K + λR)⁻¹ of it is minus the derivative of (s K + λR)⁻¹ by s at 1.
        """
        less, more = (self._factored(1 + sign * STEP).quadratic(rows) for sign in (-1, 1))
        solved, following = self(self.system.held[0]), self(self.system.following)
        return (less - more) / (2 * STEP) + self.system.beyond(rows @ solved, rows @ following)

    def covariance(self, columns: Floats) -> Floats:
        """Return S C S' times columns (n, k)."""
        return self(self.system.covariance(self._information @ self._stiff.solve(columns)))

    @cached_property
    def _information(self) -> Matrix:
        return self.scene.space.matrix(self.scene, self.blocks, 0.0)

    @cached_property
    def _stiff(self) -> Factored:
        return self._factored(1.0)

    def _factored(self, share: float) -> Factored:
        """Return the factor of s K + λR."""
        space = self.scene.space
        return space.factored(self.scene, space.matrix(self.scene, share * self.blocks, self.stiffness / share))
