"""A triangulated surface that answers where the nearest point of it is, and on which side."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from inspect3d.arrays import Booleans, Floats, Integers, floats, integers, unit
from inspect3d.nominal.features import Edges, Features, corner_sums, edges_of, features_of, welded

if TYPE_CHECKING:
    from inspect3d.nominal.bvh import Tree

CHUNK = 1 << 20
FLATNESS = 1e-13
TOUCH = 1e-12
LARGEST = 1e15


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
class Hits:
    """Where n rays first meet a surface.

    Parameters
    ----------
    distance : (n,) mm along the ray, infinity where it meets nothing
    triangle : (n,) the triangle met, -1 where there is none
    """

    distance: Floats
    triangle: Integers


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles in space, oriented out of the material; open or closed.

    Vertices at exactly the same position count as one, so loose triangles behave like the mesh they make up.

    Parameters
    ----------
    vertices : (n, 3) mm, shared by the triangles around them
    triangles : (m, 3) indices, counter-clockwise seen from outside

    Raises
    ------
    ValueError
        There is no triangle, none has an area, an index points nowhere, or a coordinate is infinite or absurdly large.
    """

    vertices: Floats
    triangles: Integers

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", floats(self.vertices, "vertices", None, 3))
        object.__setattr__(self, "triangles", integers(self.triangles, "triangles", None, 3))
        if len(self.triangles) == 0:
            raise ValueError("a surface has at least one triangle")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices):
            raise ValueError(f"a triangle refers to a vertex that does not exist; there are {len(self.vertices)}")
        if np.abs(self.bounds).max() > LARGEST:
            raise ValueError(f"the vertices reach {np.abs(self.bounds).max():.0e} mm, where distances lose all digits")
        if not self.face_normals.any():
            raise ValueError("no triangle of the surface has an area")

    @cached_property
    def bounds(self) -> Floats:
        """Return the lower and the upper corner (2, 3) mm of the box around the triangles."""
        used = self.vertices[self.triangles.ravel()]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @cached_property
    def diagonal(self) -> float:
        """Return the diagonal of the box around the triangles, mm."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @cached_property
    def areas(self) -> Floats:
        """Return the area of each triangle, (m,) mm²."""
        return 0.5 * np.linalg.norm(self._cross, axis=1)

    @cached_property
    def face_normals(self) -> Floats:
        """Return the unit normal of each triangle, (m, 3); zero where it has no area.

        A triangle lower than 1e-13 of its longest side counts as one: its normal would be made of rounding errors. The
        cross product of a needle leans along it; taking that out keeps distances to its plane exact to rounding.
        """
        sides = np.roll(self._corners, -1, axis=1) - self._corners
        lengths = np.linalg.norm(sides, axis=2)
        longest = lengths.argmax(axis=1)[:, None]
        length = np.take_along_axis(lengths, longest, axis=1)
        along = unit(np.take_along_axis(sides, longest[:, :, None], axis=1)[:, 0])
        flat = np.linalg.norm(self._cross, axis=1, keepdims=True) <= FLATNESS * length**2
        normals = unit(self._cross)
        normals = unit(normals - np.einsum("ij,ij->i", normals, along)[:, None] * along)
        return np.where(flat, 0.0, normals)

    @cached_property
    def vertex_normals(self) -> Floats:
        """Return the angle-weighted normal of each vertex, (n, 3), unit; zero where no triangle has one."""
        sums = corner_sums(self._corners, self._welded[self.triangles], self.face_normals, len(self.vertices))
        return sums[self._welded]

    @cached_property
    def closed(self) -> bool:
        """Tell whether every edge has exactly two triangles."""
        return bool((self._edges.triangles == 2).all())

    @cached_property
    def rim_edges(self) -> Integers:
        """Return the vertices (r, 2) at the ends of each edge that has only one triangle."""
        return self._edges.ends[self._edges.triangles == 1]

    def closest(self, points: ArrayLike) -> Feet:
        """Return the closest point of the surface to each of points (n, 3) mm.

        The sign of the distance is that of (p - foot) . N, where N belongs to the feature the foot lies on: the normal
        of a face, the sum of the normals of the triangles at an edge, and at a vertex their sum weighted by their
        angles there. That is right everywhere around a closed surface, and an open one needs no inside. Next to
        triangles without area, N is gathered from all triangles that touch the foot.

        Where a point lies on the medial axis, and several feet are equally near, it is the one in the triangle of the
        lowest number. The points are worked on in chunks, so 10 million need little more memory than their feet.

        Raises
        ------
        ValueError
            The points are not (n, 3), or a coordinate is not finite.

        Notes
        -----
        J. A. Baerentzen, H. Aanaes, "Signed distance computation using the angle weighted pseudonormal", IEEE
        Transactions on Visualization and Computer Graphics 11(3), 2005.
        """
        from inspect3d.nominal.closest_kernel import closest
        from inspect3d.nominal.visit_kernel import visiting_order

        points = floats(points, "points", None, 3)
        n = len(points)
        feet = Feet(np.empty((n, 3)), np.empty(n), np.empty((n, 3)), np.empty(n, np.int64), np.empty(n, np.bool_))
        for start in range(0, n, CHUNK):
            part = slice(start, start + CHUNK)
            closest(
                points[part],
                visiting_order(points[part], self._tree.origin, self.diagonal),
                self._tree,
                self._features,
                feet.points[part],
                feet.distance[part],
                feet.normals[part],
                feet.triangle[part],
                feet.on_rim[part],
            )
        return feet

    def first_hit(self, origins: ArrayLike, directions: ArrayLike, reach: ArrayLike = np.inf) -> Hits:
        """Return where rays first meet the surface, from either side.

        No ray slips through between neighbours. One that starts on the surface meets it there or not, as rounding has
        it: lift its origin. "Is q seen from p" is a ray from p towards q with their distance, less a little, as reach.

        Parameters
        ----------
        origins : (n, 3) mm, or (3,) for all rays
        directions : (n, 3), or (3,) for all rays, of any length but zero
        reach : (n,) mm, or one number: a hit farther away does not count

        Raises
        ------
        ValueError
            The shapes differ, a direction is zero, or a coordinate is not finite.
        """
        from inspect3d.nominal.ray_kernel import first_hit

        origins, directions = np.broadcast_arrays(np.atleast_2d(origins), np.atleast_2d(directions))
        origins, directions = floats(origins, "origins", None, 3), floats(directions, "directions", len(origins), 3)
        if not directions.any(axis=1).all():
            raise ValueError("a ray has the direction zero")
        n = len(origins)
        reaches = floats(np.broadcast_to(reach, n), "reach", n, finite=False)
        hits = Hits(np.empty(n), np.empty(n, np.int64))
        first_hit(origins, unit(directions), reaches, self._tree, hits.distance, hits.triangle)
        return hits

    def hides(self, points: ArrayLike, target: ArrayLike) -> Booleans:
        """Tell from which of points (n, 3) mm the surface hides a target (3,) mm; see `first_hit`, which is slower."""
        from inspect3d.nominal.ray_kernel import between

        points, target = floats(points, "points", None, 3), floats(target, "target", 3)
        if (points == target).all(axis=1).any():
            raise ValueError("a point is the target itself")
        hidden = np.empty(len(points), dtype=np.bool_)
        between(points, target, self._tree, hidden)
        return hidden

    @cached_property
    def _corners(self) -> Floats:
        return self.vertices[self.triangles]

    @cached_property
    def _cross(self) -> Floats:
        a, b, c = (self._corners[:, k] for k in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def _welded(self) -> Integers:
        return welded(self.vertices)

    @cached_property
    def _edges(self) -> Edges:
        return edges_of(self._welded[self.triangles])

    @cached_property
    def _features(self) -> Features:
        return features_of(
            self._welded[self.triangles], self.face_normals, self.vertex_normals, self._edges, TOUCH * self.diagonal
        )

    @cached_property
    def _tree(self) -> Tree:
        from inspect3d.nominal.bvh import build

        return build(self._corners, self.face_normals)
