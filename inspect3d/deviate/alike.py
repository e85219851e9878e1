"""What noise that neighbouring points share leaves at the nodes: a local fit hardly averages it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from inspect3d.arrays import Floats
from inspect3d.deviate.low_rank import LowRank

LANDMARKS, NUMBERS, RANK = 600, 2e7, 1e-4
RINGS, SPOKES = 16, 40  # of the disc over which a fit is made, to integrate over it
SHORT = 0.12  # radii; noise alike over less is taken for as many independent patches
REACH = 4.0  # lengths beyond which noise has nothing in common
STEPS = 32  # distances at which the shared noise is integrated


def with_alike_noise(variances: Floats, nodes: Floats, noise: float, length: float, radius: float) -> LowRank:
    """Return the covariance of local fits to points whose noise is alike over a length, exp(-r² / 2 L²).

    A quadratic fit over a disc of radius R weighs a point at the distance ρ from its middle by (4 - 6 ρ² / R²) / π R².
    Noise seen through two such discs, the distance of their nodes apart, gives the covariance; the modes of it are
    found from nodes chosen as landmarks (Nyström), and what they leave of a variance stays independent. It adds to the
    variance of independent points, as for points strewn at random: those are a point's own part, this its neighbours'.
    A fit that is worse than the median, as at a rim, is so for noise alike over a short length as for independent
    noise, and no worse for noise that all its points share.

    Parameters
    ----------
    variances : (k,) mm², of the fits if the points were independent
    nodes : (k, 3) mm
    noise : mm, standard uncertainty of a point
    length : L, mm
    radius : R, mm
    """
    at, shared = _shared(length / radius)
    chosen = np.linspace(0, len(nodes) - 1, int(min(LANDMARKS, len(nodes), max(NUMBERS // len(nodes), 1))))
    marks = nodes[chosen.astype(np.int64)]
    values, vectors = np.linalg.eigh(np.interp(cdist(marks, marks) / radius, at, shared, right=0.0))
    kept = values > RANK * values[-1]
    modes = np.interp(cdist(nodes, marks) / radius, at, shared, right=0.0) @ (vectors[:, kept] / np.sqrt(values[kept]))
    power = (modes**2).sum(axis=1)
    worse = variances / np.median(variances)
    whole = shared[0] * worse / (1 + shared[0] * (worse - 1))
    modes *= noise * np.sqrt(whole / shared[0] * np.minimum(1.0, shared[0] / np.maximum(power, 1e-300)))[:, None]
    return LowRank(variances + np.maximum(noise**2 * whole - (modes**2).sum(axis=1), 0.0), modes)


def _shared(length: float) -> tuple[Floats, Floats]:
    """Return distances (m,) of two nodes, in radii, and the covariance (m,) of fits there for noise of variance 1."""
    share, weight = np.polynomial.legendre.leggauss(RINGS)
    share, weight = (share + 1) / 2, weight / 2  # of the area inside a ring
    angles = 2 * np.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    places = np.sqrt(share)[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    weights = np.repeat(weight * (4 - 6 * share) / SPOKES, SPOKES)
    places, alike = places.reshape(-1, 2), max(length, SHORT)
    at = np.linspace(0.0, 2 + REACH * alike, STEPS)
    shared = np.empty(STEPS)
    for k, distance in enumerate(at):
        squares = cdist(places, places + np.array([distance, 0.0]), "sqeuclidean")
        shared[k] = weights @ np.exp(-squares / (2 * alike**2)) @ weights
    return at, shared * (length / alike) ** 2
