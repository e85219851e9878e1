"""A measuring method in a package of its own: points touched with a probe, as a table of x, y, z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.measure import Cloud, Files, Measurement
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import InputError


@dataclass(frozen=True)
class Touched:
    """Points touched with a probe, one row of x, y, z each.

    Parameters
    ----------
    radius : of the ball at the probe's tip, mm; the points are its centres
    noise : standard uncertainty of a point, mm
    """

    radius: float = 0.0
    noise: float = 0.005

    def open(self, files: Files) -> np.ndarray:
        """Return the centres of the ball, (n, 3) mm."""
        (path,) = files["files"]
        try:
            return np.loadtxt(path, delimiter=",", ndmin=2)[:, :3]
        except (ValueError, IndexError) as error:
            raise InputError(f"{path.name} is not a table of x, y, z: {error}.") from error

    def __call__(self, source: np.ndarray, nominal: Nominal) -> Measurement:
        """Take the ball's radius off along the normals of the CAD."""
        touched = source - self.radius * nominal.surface.closest(source).normals
        return Measurement((Cloud("touched", touched, noise=self.noise),), frame="cad")
