"""A smooth error of a lens that no distortion model explains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.virtual.correlated_noise import correlated_noise

STEPS = 8  # nodes per correlation length; the spline between them is good to 1e-4 of the field


@dataclass(frozen=True)
class Warp:
    """A random displacement of the picture: pixel p shows what the lens alone would show at p + w(p).

    Each component of w is a Gaussian field of standard deviation `tau` and covariance tau² exp(-d² / (2 length²)).

    Parameters
    ----------
    tau, length : px
    seed : the same seed gives the same field; two cameras want two
    """

    tau: float
    length: float
    seed: int

    def __post_init__(self) -> None:
        if self.tau < 0.0 or self.length <= 0.0:
            raise ValueError("the size of a warp is not negative, and its length is positive")

    def __call__(self, columns: Floats, rows: Floats) -> Floats:
        """Return the displacements (rows, columns, 2) px at the pixels of a grid, both coordinates increasing."""
        from scipy.interpolate import RectBivariateSpline

        step = self.length / STEPS
        x, y = (step * np.arange(np.floor(at[0] / step) - 4, np.ceil(at[-1] / step) + 5) for at in (columns, rows))
        grid = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], axis=-1).reshape(-1, 3)
        random = np.random.default_rng(self.seed)
        fields = (correlated_noise(grid, self.length, random).reshape(len(y), len(x)) for _ in range(2))
        return self.tau * np.stack([RectBivariateSpline(y, x, values)(rows, columns) for values in fields], axis=-1)
