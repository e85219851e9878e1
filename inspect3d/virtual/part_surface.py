"""The exact surface of a part, addressed through fine triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from inspect3d.arrays import Floats, Integers, floats, integers
from inspect3d.nominal.surface import Surface
from inspect3d.virtual.patch import Patch


@dataclass(frozen=True, eq=False)
class PartSurface:
    """The exact surface of a part: triangles to find a place on it, NURBS patches to know where that place is.

    A triangle carries the patch it belongs to and the patch parameters of its corners. Rays and random numbers choose
    a triangle and a place in it; the point and its normal then come from the patch itself, so that the chord of the
    triangles does not enter. It remains in one place only: along a curved edge of the part a point may lie up to
    `chord` beyond the edge, on the continuation of its own face.

    Parameters
    ----------
    patches : exact faces of the part, outward normals
    triangles : (m, 3) indices of the triangulation, counter-clockwise seen from outside
    vertices : (k, 3) mm, on the exact surface; not shared between faces
    parameters : (k, 2), (u, v) of each vertex in its patch
    face : (m,), the patch of each triangle
    """

    patches: tuple[Patch, ...]
    vertices: Floats
    parameters: Floats
    triangles: Integers
    face: Integers

    def __post_init__(self) -> None:
        count = len(self.vertices)
        object.__setattr__(self, "vertices", floats(self.vertices, "vertices", None, 3))
        object.__setattr__(self, "parameters", floats(self.parameters, "parameters", count, 2))
        object.__setattr__(self, "triangles", integers(self.triangles, "triangles", None, 3))
        object.__setattr__(self, "face", integers(self.face, "face", len(self.triangles)))

    @classmethod
    def of_shape(cls, shape: Any, chord: float = 2e-4, chord_inside: float = 0.05) -> PartSurface:
        """Return the surface of an OpenCASCADE shape in mm.

        Parameters
        ----------
        shape : TopoDS_Shape; every face of it is turned into its exact NURBS form
        chord : mm, largest distance between a curved edge and its polygon
        chord_inside : mm, the same between the triangles and the faces; matters for what hides what, not for points
        """
        from inspect3d.virtual.tessellation import tessellated

        return cls(*tessellated(shape, chord, chord_inside))

    @cached_property
    def areas(self) -> Floats:
        """Return the area of each triangle, (m,) mm²."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)

    @property
    def area(self) -> float:
        """Return the whole area, mm²."""
        return float(self.areas.sum())

    @cached_property
    def triangulation(self) -> Surface:
        """Return the triangles as a surface that rays can hit."""
        return Surface(self.vertices, self.triangles)

    def at(self, triangle: Integers, weights: Floats) -> tuple[Floats, Floats]:
        """Return exact points (n, 3) mm and outward normals (n, 3) at barycentric weights (n, 3) of triangles (n,)."""
        parameters = np.einsum("nk,nkd->nd", weights, self.parameters[self.triangles[triangle]])
        points, normals = np.empty((2, len(triangle), 3))
        face = self.face[triangle]
        order = np.argsort(face, kind="stable")
        ends = np.searchsorted(face[order], np.arange(len(self.patches) + 1))
        for patch, start, stop in zip(self.patches, ends[:-1], ends[1:], strict=True):
            here = order[start:stop]
            points[here], normals[here] = patch(parameters[here])
        return points, normals

    def seen_from(self, origins: Floats, direction: Floats, reach: float) -> tuple[Floats, Floats]:
        """Return the points (k, 3) mm of the surface that parallel rays meet first, and their outward normals.

        Rays that meet nothing leave no point. A point is on the exact surface, and at most `chord_inside` off the place
        where its ray meets the triangles.

        Parameters
        ----------
        origins : (n, 3) mm
        direction : (3,), unit, of all rays
        reach : mm, length of the rays
        """
        hits = self.triangulation.first_hit(origins, direction, reach)
        hit = hits.triangle >= 0
        triangle = hits.triangle[hit]
        return self.at(triangle, self._weights(triangle, origins[hit] + hits.distance[hit, None] * direction))

    def sample(self, count: int, random: np.random.Generator) -> tuple[Floats, Floats]:
        """Return points (count, 3) mm spread uniformly at random over the surface, and their outward normals."""
        cumulated = np.cumsum(self.areas)
        triangle = np.searchsorted(cumulated, random.uniform(0.0, cumulated[-1], count), side="right")
        triangle = np.minimum(triangle, len(cumulated) - 1)
        root, share = np.sqrt(random.random(count)), random.random(count)
        weights = np.column_stack([1.0 - root, root * (1.0 - share), root * share])
        return self.at(triangle, weights)

    def _weights(self, triangle: Integers, points: Floats) -> Floats:
        """Return barycentric weights (n, 3), none negative, of points (n, 3) mm in the planes of their triangles."""
        corners = self.vertices[self.triangles[triangle]]
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        to_point = points[:, None] - corners
        opposite = np.cross(np.roll(to_point, -1, axis=1), np.roll(to_point, -2, axis=1))
        shares = np.maximum(np.einsum("nki,ni->nk", opposite, facing), 0.0)
        return shares / shares.sum(axis=1, keepdims=True)
