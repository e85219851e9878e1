"""What a click on a photograph may snap to: a corner, or the centre of an ellipse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from inspect3d.arrays import Booleans, Floats, floats

REACH = 12
"""px, how far from the click a corner is looked for."""
MOST, LEAST_WINDOW = 0.15, 40
"""Of the picture, and in px: half of the square in which an ellipse is looked for."""
FIT = 0.04
"""Root mean square distance of an outline from its ellipse, of the shorter half-axis."""
LEAST_POINTS = 20


@dataclass(frozen=True)
class Snapped:
    """Where a click belongs.

    Parameters
    ----------
    x, y : px
    ellipse : both axes, px, and the angle of the first, degrees; None for a corner
    """

    x: float
    y: float
    ellipse: tuple[float, float, float] | None = None


def corner_near(grey: Floats, x: float, y: float) -> Snapped | None:
    """Return the corner nearest to a click, to a fraction of a pixel; None where there is none within 12 px.

    Parameters
    ----------
    grey : (rows, columns) grey levels of the photograph
    x, y : px, of the click

    Notes
    -----
    C. Harris, M. Stephens, "A combined corner and edge detector", 1988, refined as by OpenCV's `cornerSubPix`: at a
    corner the gradient of every point around it is at right angles to the way there.
    """
    import cv2

    window, left, top = _window(grey, x, y, 3 * REACH)
    if min(window.shape) < 2 * REACH:
        return None
    smooth = cv2.GaussianBlur(window, (0, 0), 1.5)
    found = cv2.goodFeaturesToTrack(smooth, 60, 0.08, 3, blockSize=7, useHarrisDetector=True, k=0.05)
    if found is None:
        return None
    corners = found.reshape(-1, 2)
    near = corners[np.argsort(np.hypot(corners[:, 0] + left - x, corners[:, 1] + top - y))[:1]].astype(np.float32)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
    refined = cv2.cornerSubPix(window, near.reshape(-1, 1, 2).copy(), (5, 5), (-1, -1), criteria).ravel()
    u, v = float(refined[0]) + left, float(refined[1]) + top
    moved = np.hypot(*(refined - near.ravel()))
    return Snapped(u, v) if np.hypot(u - x, v - y) <= REACH and moved < REACH / 2 else None


def ellipse_near(grey: Floats, x: float, y: float) -> Snapped | None:
    """Return the centre of the ellipse around a click, of a hole or a target; None where there is none.

    The picture of a circle's centre is not quite the centre of its ellipse: at a slant they are apart by about
    r^2 sin(2 a) / (2 z), r its radius, z the distance, a the angle of sight; for a hole of 5 mm at 500 mm by 0.02 mm.

    Parameters
    ----------
    grey : (rows, columns) grey levels of the photograph
    x, y : px, of the click

    Notes
    -----
    Outlines at several grey levels, the middle one first, and to each the ellipse of A. W. Fitzgibbon, M. Pilu,
    R. B. Fisher, "Direct least square fitting of ellipses", IEEE PAMI 21 (1999). The first that fits is taken, and
    fitted anew to where the picture is steepest across it.
    """
    import cv2

    half = max(int(MOST * max(grey.shape)), LEAST_WINDOW)
    window, left, top = _window(grey, x, y, half)
    if not window.size:
        return None
    smooth = cv2.GaussianBlur(window, (0, 0), 1.5)
    low, high = np.percentile(smooth, [2, 98])
    found = None
    for share in sorted(np.linspace(0.15, 0.85, 15), key=lambda share: abs(share - 0.5)):
        found = _around(smooth > low + share * (high - low), float(x - left), float(y - top))
        if found is not None:
            break
    if found is None:
        return None
    (u, v), (first, second), angle = _sharpened(cv2.GaussianBlur(window, (0, 0), 1.0), found)
    return Snapped(float(u + left), float(v + top), (float(first), float(second), float(angle)))


def _around(bright: Booleans, x: float, y: float) -> Any:
    """Return the ellipse that fits an outline around a place best; None where none fits."""
    import cv2

    best, least = None, FIT
    outlines, _ = cv2.findContours(bright.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    for outline in outlines:
        if len(outline) >= LEAST_POINTS and cv2.pointPolygonTest(outline, (x, y), False) >= 0:
            misfit, ellipse = _ellipse(outline.reshape(-1, 2).astype(np.float32))
            if misfit < least:
                best, least = ellipse, misfit
    return best


def _sharpened(picture: Any, ellipse: Any) -> Any:
    """Return the ellipse through the places of steepest grey across a first one, to a fraction of a pixel."""
    import cv2

    (u, v), (first, second), angle = ellipse
    along, turn = np.linspace(0, 2 * np.pi, 180, endpoint=False), np.radians(angle)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    on = np.column_stack([np.cos(along) * first / 2, np.sin(along) * second / 2])
    across = np.column_stack([np.cos(along) * second, np.sin(along) * first])
    across = (across / np.linalg.norm(across, axis=1, keepdims=True)) @ axes
    step = np.arange(-3.0, 3.01, 0.25)
    places = ((u, v) + on @ axes)[:, None] + step[:, None] * across[:, None]
    x, y = places[..., 0].astype(np.float32), places[..., 1].astype(np.float32)
    sampled = floats(cv2.remap(picture.astype(np.float32), x, y, cv2.INTER_LINEAR), "grey levels", len(x), None)
    slope = np.abs(np.gradient(sampled, axis=1))
    best = slope[:, 1:-1].argmax(axis=1) + 1
    rows = np.arange(len(best))
    before, most, after = (slope[rows, best + k] for k in (-1, 0, 1))
    shift = 0.5 * (before - after) / np.minimum(before - 2 * most + after, -1e-9)
    inner = (best > 2) & (best < len(step) - 3) & (most > 0.3 * np.median(most))
    if np.count_nonzero(inner) < len(best) / 2:
        return ellipse
    distance = step[best] + 0.25 * np.clip(shift, -1, 1)
    found = ((u, v) + on @ axes + distance[:, None] * across)[inner]
    return cv2.fitEllipseDirect(found.astype(np.float32))


def _ellipse(points: Floats) -> tuple[float, tuple | None]:
    """Return the ellipse nearest to points (n, 2), and their rms distance from it, of its shorter half-axis."""
    import cv2

    (u, v), (first, second), angle = cv2.fitEllipseDirect(points)
    if not np.isfinite([u, v, first, second]).all() or min(first, second) < 4:
        return np.inf, None
    turn = np.radians(angle)
    dx, dy = points[:, 0] - u, points[:, 1] - v
    a = (dx * np.cos(turn) + dy * np.sin(turn)) / (first / 2)
    b = (-dx * np.sin(turn) + dy * np.cos(turn)) / (second / 2)
    return float(np.sqrt(np.mean((np.hypot(a, b) - 1) ** 2))), ((u, v), (first, second), angle)


def _window(grey: Floats, x: float, y: float, half: int) -> tuple[Floats, int, int]:
    """Return a part of the picture about a place as 8 bits, stretched, and its left and top."""
    rows, columns = grey.shape
    left, right = max(round(x) - half, 0), min(round(x) + half + 1, columns)
    top, bottom = max(round(y) - half, 0), min(round(y) + half + 1, rows)
    part = grey[top:bottom, left:right]
    if part.size == 0:
        return np.zeros((0, 0), np.uint8), left, top
    low, high = float(part.min()), float(part.max())
    return np.round(255 * (part - low) / max(high - low, 1e-9)).astype(np.uint8), left, top
