"""The linear system of shape and cameras: nodes eliminated first, the gauge by constraint."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats
from inspect3d.correlation.factor import Factor

NOTHING = 2e-14


@dataclass(frozen=True, eq=False)
class System:
    """K u + B p = b, B'u + S p = s, subject to C'u = 0.

    With K̃ = K⁻¹ - K⁻¹C (C'K⁻¹C)⁻¹ C'K⁻¹ and X = K̃B, the cameras have the reduced matrix R = S - B'X. What it
    leaves free, motions that no picture shows, is held.

    Parameters
    ----------
    nodal : K factored, n nodes
    cross : B (n, m), for m unknowns of the cameras, which may be none
    camera : S (m, m)
    gauge : C (n, g), orthonormal columns, which may be none
    scale : (m,) the units of the unknowns p in which their stiffnesses compare
    """

    nodal: Factor
    cross: Floats
    camera: Floats
    gauge: Floats
    scale: Floats

    @cached_property
    def held(self) -> tuple[Floats, Floats]:
        """Return K⁻¹C (n, g) and (C'K⁻¹C)⁻¹ (g, g)."""
        solved = self.nodal.solve(self.gauge)
        return solved, np.asarray(np.linalg.inv(self.gauge.T @ solved), dtype=np.float64)

    def constrained(self, right: Floats) -> Floats:
        """Return K̃ b for b (n,) or (n, k)."""
        solved, inverse = self.held
        return self.nodal.solve(right) - solved @ (inverse @ (solved.T @ right))

    @cached_property
    def following(self) -> Floats:
        """Return X = K̃B, (n, m): how the shape follows the cameras, with the sign turned."""
        return self.constrained(self.cross)

    @cached_property
    def reduced(self) -> Floats:
        """Return R, (m, m)."""
        return self.camera - self.cross.T @ self.following

    @cached_property
    def spectrum(self) -> tuple[Floats, Floats]:
        """Return the eigenvalues of R in units of `scale`, ascending, over the largest one of S, and the modes of p."""
        both = self.scale * self.scale[:, None]
        stiffest = float(np.linalg.eigvalsh(self.camera * both)[-1]) if len(self.scale) else 1.0
        values, vectors = np.linalg.eigh(self.reduced * both / stiffest)
        return values, vectors * self.scale[:, None] / np.sqrt(stiffest)

    @property
    def unseen(self) -> Floats:
        """Return the motions of the cameras that change no picture beyond what the shape makes up for, (k, m)."""
        values, modes = self.spectrum
        return modes[:, values <= NOTHING].T

    @cached_property
    def camera_covariance(self) -> Floats:
        """Return R⁺, (m, m)."""
        values, modes = self.spectrum
        seen = values > NOTHING
        return (modes[:, seen] / values[seen]) @ modes[:, seen].T

    def solve(self, right: Floats, camera_right: Floats) -> tuple[Floats, Floats]:
        """Return the nodal motions u and camera unknowns p for right-hand sides b (n,) and s (m,), or more columns."""
        cameras = self.camera_covariance @ (camera_right - self.following.T @ right)
        return self.constrained(right) - self.following @ cameras, cameras

    def variances(self, rows: sparse.csr_matrix) -> Floats:
        """Return the diagonal of T C T' for the covariance C of the nodes, and T of neighbours' weights."""
        solved, inverse = self.held
        held, following = rows @ solved, rows @ self.following
        by_cameras = np.einsum("ij,jk,ik->i", following, self.camera_covariance, following)
        return self.nodal.quadratic(rows) - np.einsum("ij,jk,ik->i", held, inverse, held) + by_cameras

    def covariance(self, columns: Floats) -> Floats:
        """Return C times columns (n, k)."""
        return self.constrained(columns) + self.following @ (self.camera_covariance @ (self.following.T @ columns))
