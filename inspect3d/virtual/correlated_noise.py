"""A smooth random error, as scanners make it."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats

WAVES = 96


def correlated_noise(points: Floats, length: float, random: np.random.Generator) -> Floats:
    """Return a random field of variance one at points (n, 3) mm, with the covariance exp(-r² / (2 length²)).

    Parameters
    ----------
    length : mm

    Notes
    -----
    A sum of random plane waves: A. Rahimi, B. Recht, Random Features for Large-Scale Kernel Machines, 2007, section 3.
    """
    frequencies = random.normal(0.0, 1.0 / length, (WAVES, 3))
    phases = random.uniform(0.0, 2.0 * np.pi, WAVES)
    total = np.zeros(len(points))
    for frequency, phase in zip(frequencies, phases, strict=True):
        total += np.cos(points @ frequency + phase)
    return total * np.sqrt(2.0 / WAVES)
