"""The nearest point of a surface that looks the same way, so that a thin wall is not taken for its other side."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Floats, Integers, unit
from inspect3d.nominal.surface import Surface

_AXES = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)])
"""26 directions; any other lies within 28 degrees of one of them."""


def closest_facing(surface: Surface, points: Floats, normals: Floats) -> tuple[Floats, Integers]:
    """Return the closest points (n, 3) mm on triangles that look the way of normals (n, 3), and the triangles (n,).

    The closest point of all will do if its triangle is less than 90 degrees off. Otherwise those within 62 degrees
    are searched, and of those up to 118 degrees off some.
    """
    feet = surface.closest(points)
    found, triangle = feet.points.copy(), feet.triangle.copy()
    away = np.flatnonzero((surface.face_normals[triangle] * normals).sum(axis=1) < 0)
    directions = unit(_AXES.astype(float))
    nearest = (normals[away] @ directions.T).argmax(axis=1)
    for k in np.unique(nearest):
        facing = np.flatnonzero(surface.face_normals @ directions[k] > 0)
        if len(facing):
            members = away[nearest == k]
            among = Surface(surface.vertices, surface.triangles[facing]).closest(points[members])
            found[members], triangle[members] = among.points, facing[among.triangle]
    return found, triangle
