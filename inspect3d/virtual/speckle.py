"""Paint on the virtual part: random dots, the same for every camera."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from inspect3d.arrays import Floats, floats


@dataclass(frozen=True)
class Speckle:
    """Dark dots on bright ground, as balls in space cut by the surface of the part.

    The paint sticks to the material: it is a function of the *nominal* surface point, wherever that has moved to. Since
    it fills space it needs no unwrapping, and it neither stretches nor has seams. Nearly 40 % of the area is covered.

    Parameters
    ----------
    dot : mm, mean diameter of a dot, where its paint is half faded
    ground, ink : reflectance between the dots and inside them, 0 to 1
    softness : share of a ball's radius over which the paint fades, above 0 to 1
    seed : the same seed gives the same paint
    """

    dot: float = 0.3
    ground: float = 0.85
    ink: float = 0.1
    softness: float = 0.5
    seed: int = 0

    def __post_init__(self) -> None:
        if self.dot <= 0.0 or not 0.0 < self.softness <= 1.0:
            raise ValueError("the size of a dot is positive, and its softness above 0 and at most 1")
        if not (0.0 <= self.ink <= 1.0 and 0.0 <= self.ground <= 1.0):
            raise ValueError("a reflectance lies between 0 and 1")
        if self.seed < 0:
            raise ValueError(f"a seed is not negative, as {self.seed} is")

    @property
    def ball(self) -> float:
        """Return the diameter of the balls, mm: a plane cuts a ball of diameter one in discs of pi / 4 on average."""
        return self.dot * (4.0 / pi) / (1.0 - 0.5 * self.softness)

    def __call__(self, points_cad: Floats) -> Floats:
        """Return the reflectance (n,) at points (n, 3) mm of the nominal surface."""
        from inspect3d.virtual.speckle_kernel import write_bareness

        points = floats(points_cad, "points_cad", None, 3)
        bare = np.empty(len(points))
        write_bareness(points, self.ball, self.softness, self.seed, bare)
        return self.ink + (self.ground - self.ink) * bare
