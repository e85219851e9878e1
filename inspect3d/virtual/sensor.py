"""What makes grey levels of the light in a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inspect3d.arrays import Floats

BITS = (8, 12, 16)


@dataclass(frozen=True)
class Sensor:
    """A grey-level sensor: full scale (offset + gain light + noise), rounded and clipped.

    Parameters
    ----------
    bits : 8, 12 or 16; 12 bits fill the lower part of 16, as cameras deliver them
    gain : share of full scale that light of one gives
    offset : share of full scale that darkness gives
    noise : standard deviation of independent normal noise, as a share of full scale
    """

    bits: int = 8
    gain: float = 0.9
    offset: float = 0.05
    noise: float = 0.01

    def __post_init__(self) -> None:
        if self.bits not in BITS:
            raise ValueError(f"a sensor has 8, 12 or 16 bits, not {self.bits}")
        if self.noise < 0.0 or self.gain <= 0.0:
            raise ValueError("a sensor has a positive gain, and its noise is not negative")

    @property
    def full_scale(self) -> int:
        """Return the highest grey level."""
        return 2**self.bits - 1

    def __call__(self, light: Floats, random: np.random.Generator) -> NDArray[np.uint8] | NDArray[np.uint16]:
        """Return the grey levels (rows, columns) of light (rows, columns) between 0 and 1."""
        share = self.offset + self.gain * light
        if self.noise > 0.0:
            share = share + random.normal(0.0, self.noise, light.shape)
        levels = np.clip(np.rint(self.full_scale * share), 0, self.full_scale)
        return levels.astype(np.uint8) if self.bits == 8 else levels.astype(np.uint16)
