"""A triangulated surface that answers where the nearest point of it is, and on which side."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers, booleans, floats, integers


@dataclass(frozen=True, eq=False)
class Feet:
    """The closest points of a surface to n points.

    Parameters
    ----------
    points : (n, 3) mm, the feet
    distance : (n,) mm, signed: positive outside the material
    normals : (n, 3), unit, out of the material: of the face, or the angle-weighted pseudo-normal of an edge or vertex
    triangle : (n,) the triangle the foot lies in
    on_rim : (n,), the foot lies on an open rim of the surface
    """

    points: Floats
    distance: Floats
    normals: Floats
    triangle: Integers
    on_rim: Booleans


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles in space, oriented out of the material; open or closed.

    Parameters
    ----------
    vertices : (n, 3) mm, shared by the triangles around them
    triangles : (m, 3) indices, counter-clockwise seen from outside
    """

    vertices: Floats
    triangles: Integers

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", floats(self.vertices, "vertices", None, 3))
        object.__setattr__(self, "triangles", integers(self.triangles, "triangles", None, 3))

    def closest(self, points: Floats) -> Feet:
        """Return the closest point of the surface to each of points (n, 3) mm."""
        raise NotImplementedError
