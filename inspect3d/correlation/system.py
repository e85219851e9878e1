"""The linear system of shape and cameras: the shape eliminated first, the gauge by constraint."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats
from inspect3d.correlation.space import Factored

NOTHING = 1e-9
UNTOLD = 1e-9  # px⁻²: a motion that priors leave open by 30,000 px of the pictures is one that they do not tell


@dataclass(frozen=True, eq=False)
class System:
    """K q + B p = b, B'q + (S + P) p = s, subject to C'q = 0.

    With K̃ = K⁻¹ - K⁻¹C (C'K⁻¹C)⁻¹ C'K⁻¹ and X = K̃B, the pictures give the cameras the reduced matrix R = S - B'X,
    to which the priors add P. What both leave free, motions that no picture shows, is held.

    Parameters
    ----------
    motion : K factored, of n unknowns q of the shape: those of `inspect3d.correlation.space`
    cross : B (n, m), for m unknowns of the cameras, which may be none
    camera : S (m, m)
    gauge : C (n, g), independent columns, which may be none
    prior : (m,) the diagonal of P
    scale : (m,) the units of the unknowns p in which their stiffnesses compare
    slides : (m, s) changes of the cameras that no picture shows
    across : N (m, s), by which they are held, N'p = 0
    redundant : (m, r) changes of the cameras that others stand for, held
    shifts : how many of the m unknowns, the last ones, are numbers of a smooth shift of the pictures
    """

    motion: Factored
    cross: Floats
    camera: Floats
    gauge: Floats
    prior: Floats
    scale: Floats
    slides: Floats
    across: Floats
    redundant: Floats
    shifts: int = 0

    @cached_property
    def held(self) -> tuple[Floats, Floats]:
        """Return K⁻¹C (n, g) and (C'K⁻¹C)⁻¹ (g, g)."""
        solved = self.motion.solve(self.gauge)
        return solved, np.asarray(np.linalg.inv(self.gauge.T @ solved), dtype=np.float64)

    def constrained(self, right: Floats) -> Floats:
        """Return K̃ b for b (n,) or (n, k)."""
        solved, inverse = self.held
        return self.motion.solve(right) - solved @ (inverse @ (solved.T @ right))

    @cached_property
    def following(self) -> Floats:
        """Return X = K̃B, (n, m): how the shape follows the cameras, with the sign turned."""
        return self.constrained(self.cross)

    @cached_property
    def reduced(self) -> Floats:
        """Return R, (m, m), symmetric."""
        reduced = self.camera - self.cross.T @ self.following
        return (reduced + reduced.T) / 2

    @cached_property
    def _modes(self) -> tuple[Floats, Floats]:
        """Return modes of the cameras (m, k) that pictures or priors tell about, and (m, l) those neither does.

        In the first, R + P has a diagonal of about ones. Few pictures leave some lenses to their priors alone. Beside
        that of a distortion, which may hold what hardly moves the pictures to a thousandth of a pixel, these are weak
        by nine orders, and tell all the same: a prior of a pixel and one that is stiffer count alike.
        """
        if not len(self.scale):
            return np.zeros((0, 0)), np.zeros((0, 0))
        both = self.scale * self.scale[:, None]
        held = np.column_stack([self.across * self.scale[:, None], self.redundant / self.scale[:, None]])
        turned, _ = np.linalg.qr(held, mode="complete")
        slides, others = np.linalg.qr(self.slides / self.scale[:, None])[0], turned[:, held.shape[1] :]
        values, modes = np.linalg.eigh(others.T @ (self.reduced * both) @ others)
        modes = others @ modes
        silent = values <= NOTHING * float(np.linalg.eigvalsh(self.camera * both)[-1])
        prior = self.prior * self.scale**2
        told, turns = np.linalg.eigh((modes[:, silent].T * np.minimum(prior, 1.0)) @ modes[:, silent])
        modes[:, silent] = modes[:, silent] @ turns
        values = np.maximum(values, 0.0) + (prior[:, None] * modes**2).sum(axis=0)
        unseen = silent.copy()
        unseen[silent] = told <= UNTOLD
        modes = self.scale[:, None] * modes
        hidden = np.column_stack([self.scale[:, None] * slides, modes[:, unseen]])
        return modes[:, ~unseen] / np.sqrt(values[~unseen]), hidden

    @property
    def unseen(self) -> Floats:
        """Return the motions of the cameras that change no picture beyond what the shape makes up for, (k, m)."""
        return self._modes[1].T

    @cached_property
    def camera_factor(self) -> Floats:
        """Return F (m, k) with F F' = (R + P)⁺."""
        seen = self._modes[0]
        turned = seen.T @ ((self.reduced + np.diag(self.prior)) @ seen)
        values, modes = np.linalg.eigh(turned)
        return seen @ (modes / np.sqrt(values))

    @cached_property
    def camera_covariance(self) -> Floats:
        """Return (R + P)⁺, (m, m)."""
        return self.camera_factor @ self.camera_factor.T

    @property
    def factor_by_cameras(self) -> Floats:
        """Return those columns of F, turned, by which cameras alone are unsure: shifts only go along with them."""
        if not self.shifts:
            return self.camera_factor
        alone = self.camera_factor[: -self.shifts] / self.scale[: -self.shifts, None]
        return self.camera_factor @ np.linalg.svd(alone, full_matrices=False)[2].T

    def solve(self, right: Floats, camera_right: Floats) -> tuple[Floats, Floats]:
        """Return q and p for right-hand sides b (n,) and s (m,), or more columns."""
        cameras = self.camera_covariance @ (camera_right - self.following.T @ right)
        return self.constrained(right) - self.following @ cameras, cameras

    def variances(self, rows: sparse.csr_matrix) -> Floats:
        """Return the diagonal of T C T' for the covariance C of the motions; each row of T is of a few neighbours."""
        return self.motion.quadratic(rows) + self.beyond(rows @ self.held[0], rows @ self.following)

    def beyond(self, held: Floats, following: Floats) -> Floats:
        """Return what gauge and cameras add to the diagonal of T K⁻¹ T', from T K⁻¹C (n, g) and T X (n, m)."""
        by_cameras = np.einsum("ij,jk,ik->i", following, self.camera_covariance, following)
        return by_cameras - np.einsum("ij,jk,ik->i", held, self.held[1], held)

    def covariance(self, columns: Floats) -> Floats:
        """Return C times columns (n, k)."""
        return self.constrained(columns) + self.following @ (self.camera_covariance @ (self.following.T @ columns))
