"""Steps, waviness and scallops from readings of the deviation, each with its uncertainty or why it is not resolved."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from inspect3d.arrays import Booleans, Floats
from inspect3d.compare.feature_estimate import FeatureEstimate
from inspect3d.compare.readings import Readings
from inspect3d.recipe_feature import Feature

LEAST = 5  # readings beyond the unknowns
CLEAR = 2.0  # standard uncertainties that a step must have to be resolved
PROBABILITY = 0.95  # that a waviness is not chance
READINGS = 4.0  # readings that a wavelength must hold
SCALLOP = np.pi**2 / 4  # height of scallops over the amplitude of their first harmonic
OUTLYING = 4.0  # robust scales beyond which a reading is left out
BLOCKS = 6  # blocks along and across, within which errors may correlate


def estimate(feature: Feature, readings: Readings) -> FeatureEstimate:
    """Return a feature as readings in its place show it.

    The deviation is fitted by a smooth trend of the second degree and the feature: a jump at the joint, or a wave of
    the given length, two harmonics, whose phase is free. The uncertainty is the larger of what the covariance of the
    readings says and of a sandwich over blocks of the place, in which errors may correlate, and the pose comes on top.
    The height is that in the alignment of the map: a step on an edge changes where the part is moved along its faces.

    Readings within their own reach of a joint mix both sides and are left out. The height of a waviness is twice the
    amplitude; that of scallops, arcs of a parabola between cusps, follows from their first harmonic, 4 h / pi².
    """
    if len(readings) < 3:
        return _unresolved(feature, readings, "nothing was measured in the place marked")
    origin = np.array(feature.point) if feature.point else readings.places.mean(axis=0)
    s, t = readings.along(np.array(feature.across), origin)
    waves = _waves(s, feature.wavelength) if feature.wavelength else np.zeros((len(s), 0))
    if feature.kind == "step":
        kept, columns, others = np.abs(s) > readings.reach, (s > 0).astype(float)[:, None], waves
        doubt = _one_sided(s[kept])
        if feature.wavelength and not doubt and _too_coarse(s, readings, feature.wavelength):
            if not readings.reach:  # nodes average waves that short; points that meet them alike take them for the step
                return _unresolved(feature, readings, "its points do not tell the waves around the joint from the step")
            others = waves[:, :0]
    else:
        kept, columns, others = np.ones(len(s), bool), waves[:, :2], waves[:, 2:]
        doubt = _too_coarse(s, readings, float(feature.wavelength or np.inf))
    if doubt:
        return _unresolved(feature, readings, doubt)
    size = max(np.abs(s).max(), np.abs(t).max())
    u, v = s / size, t / size
    design = np.column_stack([columns, others, np.ones(len(u)), u, v, u * u, u * v, v * v])
    kept = _without_outliers(design, readings.values, kept)
    if np.count_nonzero(kept) < design.shape[1] + LEAST:
        return _unresolved(feature, readings, "too few readings lie in the place marked")
    found, covariance = _solved(design, readings, kept, _blocks(u, v))
    wanted = columns.shape[1]
    return _told(feature, readings, found[:wanted], covariance[:wanted, :wanted], int(kept.sum()))


def _waves(s: Floats, length: float) -> Floats:
    """Return the first two harmonics (k, 4) of a wave along s (k,) mm."""
    turns = 2 * np.pi * s / length
    return np.column_stack([np.cos(turns), np.sin(turns), np.cos(2 * turns), np.sin(2 * turns)])


def _one_sided(s: Floats) -> str:
    """Return why readings do not show both sides of a joint, or nothing."""
    if min(np.count_nonzero(s > 0), np.count_nonzero(s < 0)) < LEAST:
        return f"one side of the joint has fewer than {LEAST} readings"
    return ""


def _too_coarse(s: Floats, readings: Readings, length: float) -> str:
    """Return why readings do not show a wave of that length, or nothing."""
    if readings.reach and readings.spacing > length / READINGS:
        apart = f"its {readings.source} lie {readings.spacing:.2g} mm apart"
        return f"{apart}, and {length / READINGS:.2g} mm are needed"
    if np.ptp(s) < length:
        return "the place holds less than one wave"
    phase = np.sort(s / length % 1.0)
    if np.diff(phase, append=phase[0] + 1.0).max() > 1 / READINGS:
        return f"its {readings.source} meet every wave in the same places, too few to tell its height"
    return ""


def _told(feature: Feature, readings: Readings, found: Floats, covariance: Floats, count: int) -> FeatureEstimate:
    if feature.kind == "step":
        value, sigma = float(found[0]), float(np.sqrt(covariance[0, 0]))
        clear = abs(value) > CLEAR * sigma
    else:
        amplitude = float(np.linalg.norm(found))
        along = found / max(amplitude, 1e-300)
        factor = SCALLOP if feature.kind == "scallops" else 2.0
        value, sigma = factor * amplitude, factor * float(np.sqrt(along @ covariance @ along))
        clear = found @ np.linalg.solve(covariance, found) > chi2.ppf(PROBABILITY, 2)
    reason = "" if clear else f"it does not stand out of its uncertainty of {1000 * sigma:.1f} µm (k = 1)"
    return FeatureEstimate(
        feature.name, feature.kind, value, sigma, count, readings.source, readings.spacing, _sentence(reason)
    )


def _unresolved(feature: Feature, readings: Readings, reason: str) -> FeatureEstimate:
    count, spacing = len(readings), readings.spacing
    return FeatureEstimate(feature.name, feature.kind, None, None, count, readings.source, spacing, _sentence(reason))


def _sentence(reason: str) -> str:
    return f"Not resolved: {reason}." if reason else ""


def _without_outliers(design: Floats, values: Floats, kept: Booleans) -> Booleans:
    """Return which readings lie within four robust scales of the fit."""
    for _ in range(10):
        left = values - design @ np.linalg.lstsq(design[kept], values[kept], rcond=None)[0]
        scale = 1.4826 * np.median(np.abs(left[kept]))
        inside = kept & (np.abs(left) <= OUTLYING * max(scale, 1e-12))
        if (inside == kept).all() or np.count_nonzero(inside) < design.shape[1] + LEAST:
            break
        kept = inside
    return kept


def _blocks(u: Floats, v: Floats) -> np.ndarray:
    cells = [np.minimum((BLOCKS * (x - x.min()) / max(np.ptp(x), 1e-12)).astype(np.int64), BLOCKS - 1) for x in (u, v)]
    return np.unique(BLOCKS * cells[0] + cells[1], return_inverse=True)[1].ravel()


def _solved(design: Floats, readings: Readings, kept: Booleans, block: np.ndarray) -> tuple[Floats, Floats]:
    """Return the unknowns and their covariance: the larger one of two, and that of the pose.

    Notes
    -----
    Sandwich over blocks: K.-Y. Liang & S. L. Zeger, "Longitudinal data analysis using generalized linear models",
    Biometrika 73 (1986).
    """
    gain = np.zeros((design.shape[1], len(design)))
    gain[:, kept] = np.linalg.pinv(design[kept])
    found = gain @ readings.values
    stated = gain @ readings.covariance.covariance(np.ascontiguousarray(gain.T))
    scores = gain * (readings.values - design @ found)
    sums = np.stack([np.bincount(block, row) for row in scores], axis=1)
    blocks = len(sums)
    shown = sums.T @ sums * blocks / max(blocks - 1, 1)
    pose = gain @ readings.pose
    return found, (shown if shown[0, 0] > stated[0, 0] else stated) + pose @ pose.T
