"""Points of a scan that are not of the part."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats, unit


def foreign_points(points: Floats, up: Floats, count: int, random: np.random.Generator) -> Floats:
    """Return points (count, 3) mm of the table, of a clamp, and flying ones, a third each.

    The table is a ring of plane around the part, as low as the part's lowest measured point. The clamp is an upright
    cylinder that touches the part's outermost point. Flying points hang above or below measured ones.

    Parameters
    ----------
    points : (n, 3) mm, measured on the part
    up : (3,), away from the table
    """
    up = unit(up)
    along = unit(np.cross(up, np.eye(3)[np.argmin(np.abs(up))]))
    plane = np.stack([along, np.cross(up, along)])
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    height = (points - centre) @ up
    flat = (points - centre) @ plane.T
    radius = np.linalg.norm(flat, axis=1)
    outermost = np.argmax(radius)
    outward, reach = flat[outermost] / radius[outermost], radius[outermost]

    on_table, on_clamp = count // 3, count // 3
    flying = count - on_table - on_clamp

    table = _circle(random, on_table) * (reach * random.uniform(1.05, 1.5, on_table))[:, None] @ plane
    thickness = 0.06 * reach
    foot = (outward * (reach + thickness)) @ plane
    clamp = foot + thickness * _circle(random, on_clamp) @ plane
    rise = random.uniform(height.min(), height.min() + 0.6 * reach, on_clamp)
    away = random.uniform(0.01, 0.15, flying) * reach * random.choice([-1.0, 1.0], flying)
    flown = points[random.integers(len(points), size=flying)] + away[:, None] * up
    return np.concatenate([centre + table + height.min() * up, centre + clamp + rise[:, None] * up, flown])


def _circle(random: np.random.Generator, count: int) -> Floats:
    angle = random.uniform(0.0, 2.0 * np.pi, count)
    return np.column_stack([np.cos(angle), np.sin(angle)])
