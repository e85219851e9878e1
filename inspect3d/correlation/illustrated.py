"""What the report shows of a correlation: the part in the pictures, the residuals on the way, and the convergence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.correlation.overlay import overlay, reduced
from inspect3d.correlation.picks import Picks
from inspect3d.correlation.picture import Pictures, Stack
from inspect3d.correlation.residual import residuals
from inspect3d.correlation.shape import Shape
from inspect3d.correlation.state import Step
from inspect3d.figure import Descent, Figure, PixelMap
from inspect3d.nominal.nominal import Nominal

MOVES = {
    "poses": "poses",
    "cameras": "cameras",
    "shape": "shape",
    "placed": "poses and shape",
    "both": "cameras and shape",
}


def illustrated(
    nominal: Nominal,
    shape: Shape,
    start: Sequence[View],
    grey: Sequence[Floats],
    steps: Sequence[Step],
    picks: Picks | None,
) -> tuple[Figure, ...]:
    """Return the figures of a correlation.

    Parameters
    ----------
    start : the cameras it began with
    grey : the pictures
    steps : all that it made
    picks : it started from, if any
    """
    small = [reduced(picture) for picture in grey]
    figures: list[Figure] = []
    for k, (view, each) in enumerate(zip(shape.views, small, strict=True)):
        marks = np.zeros((0, 2)) if picks is None else picks.pixels[:, k]
        words = f"The CAD model over picture {k + 1}"
        words += "; crosses: landmarks as picked" if picks else ""
        figures.append(overlay(f"picture_{k + 1}", words, nominal, view, each, marks))
    stages = [("start", "at the start", tuple(start), False)]
    if shape.calibrated is not None:
        stages.append(("calibration", "after the cameras were fitted to the nominal shape", shape.calibrated, False))
    stages.append(("shape", "after the shape was found", shape.views, True))
    stack = Pictures(grey).blurred(0.0)
    maps = [_residual_map(shape, stack, views, moved, *small[0]) for _, _, views, moved in stages]
    limits = _limits(maps)
    for (name, words, _, _), values in zip(stages, maps, strict=True):
        figures.append(
            PixelMap(
                f"residual_{name}",
                f"Grey-level residual {words}, over picture 1",
                "Difference, grey levels",
                small[0][0],
                small[0][1],
                values,
                limits,
            )
        )
    names = tuple(f"{MOVES[step.level.moves]}, blur {step.level.blur:g} px" for step in steps)
    curves = (
        ("Largest motion in a step, µm", np.array([1000 * step.change for step in steps])),
        ("Residual, grey levels rms", np.array([step.noise for step in steps])),
    )
    figures.append(Descent("convergence", "How the solution converged, stage by stage", names, curves))
    return tuple(figures)


def _residual_map(
    shape: Shape, stack: Stack, views: Sequence[View], moved: bool, picture: NDArray[np.uint8], scale: float
) -> Floats:
    """Return the rms residual in each pixel of the reduced first picture, NaN where there is none."""
    motion = shape.state.motion if moved else np.zeros(len(shape.state.motion))
    pixels, residual = residuals(shape.scene, stack, views, motion)
    rows, columns = picture.shape
    there = np.isfinite(residual)
    at = np.floor((pixels[there] + 0.5) / scale).astype(np.int64)
    inside = ((at >= 0) & (at < [columns, rows])).all(axis=1)
    cell = at[inside, 1] * columns + at[inside, 0]
    counts = np.bincount(cell, minlength=rows * columns)
    sums = np.bincount(cell, residual[there][inside] ** 2, minlength=rows * columns)
    return np.sqrt(np.divide(sums, counts, out=np.full(len(sums), np.nan), where=counts > 0)).reshape(rows, columns)


def _limits(maps: Sequence[Floats]) -> tuple[float, float]:
    """Return ends of a logarithmic scale that hold nearly all values, powers of ten or their half."""
    values = np.concatenate([each[np.isfinite(each) & (each > 0)] for each in maps])
    low, high = np.percentile(values, (2.0, 99.5)) if len(values) else (0.1, 10.0)
    return float(10 ** (np.floor(2 * np.log10(low)) / 2)), float(10 ** (np.ceil(2 * np.log10(high)) / 2))
