"""A triangulated surface that answers where the nearest point of it is, and on which side."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inspect3d.arrays import Booleans, Floats, Integers, floats, integers, unit

if TYPE_CHECKING:
    from inspect3d.nominal.bvh import Tree

CHUNK = 1 << 20


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


class _Edges(NamedTuple):
    """Edges between vertices that differ in position; see `Surface._edges`."""

    of_triangle: Integers
    triangles: Integers
    vertices: Integers


class _Engine(NamedTuple):
    """What the kernels walk over; made once per surface."""

    centre: Floats
    tree: Tree
    facets: Floats
    edge_normals: Floats
    corner_normals: Floats
    tolerance: float


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles in space, oriented out of the material; open or closed.

    Vertices at exactly the same position count as one, so a triangle soup behaves like the mesh it stands for.

    Parameters
    ----------
    vertices : (n, 3) mm, shared by the triangles around them
    triangles : (m, 3) indices, counter-clockwise seen from outside

    Raises
    ------
    ValueError
        There is no triangle, none has an area, an index points nowhere, or a coordinate is not finite.
    """

    vertices: Floats
    triangles: Integers

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", floats(self.vertices, "vertices", None, 3))
        object.__setattr__(self, "triangles", integers(self.triangles, "triangles", None, 3))
        if len(self.triangles) == 0:
            raise ValueError("a surface has at least one triangle")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices):
            raise ValueError(f"triangles refer to vertices that do not exist: there are {len(self.vertices)}")
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

        A triangle lower than 1e-13 of its longest edge has none: its normal would be made of rounding errors.
        """
        longest = self._sides.max(axis=1)
        flat = np.linalg.norm(self._cross, axis=1) <= 1e-13 * longest**2
        return np.where(flat[:, None], 0.0, unit(self._cross))

    @cached_property
    def vertex_normals(self) -> Floats:
        """Return the angle-weighted normal of each vertex, (n, 3), unit; zero where no triangle has one."""
        corners = self.vertices[self.triangles]
        normals = np.zeros((len(self.vertices), 3))
        for k in range(3):
            u, v = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
            angle = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))
            at = self._welded[self.triangles[:, k]]
            for axis in range(3):
                normals[:, axis] += np.bincount(at, angle * self.face_normals[:, axis], minlength=len(normals))
        return _unit_or_zero(normals)[self._welded]

    @cached_property
    def closed(self) -> bool:
        """Tell whether every edge has exactly two triangles."""
        return bool((self._edges.triangles == 2).all())

    @cached_property
    def rim_edges(self) -> Integers:
        """Return the vertices (r, 2) at both ends of each edge that has only one triangle."""
        return self._edges.vertices[self._edges.triangles == 1]

    def closest(self, points: ArrayLike) -> Feet:
        """Return the closest point of the surface to each of points (n, 3) mm.

        The sign of the distance is that of (p - foot) . N, with N the normal of the feature the foot lies on: of the
        face; the sum of the normals of the triangles at an edge; the sum of those at a vertex, each weighted by the
        angle of its triangle there. On a closed surface that sign is right everywhere, and an open one needs no inside.
        Where triangles without area meet the foot, N is gathered from all triangles that touch it.

        Raises
        ------
        ValueError
            The points are not (n, 3), or a coordinate is not finite.

        Notes
        -----
        J. A. Baerentzen, H. Aanaes, "Signed distance computation using the angle weighted pseudonormal", IEEE
        Transactions on Visualization and Computer Graphics 11(3), 2005.
        """
        from inspect3d.nominal.closest_kernel import closest, morton_keys

        points = floats(points, "points", None, 3)
        n = len(points)
        feet = Feet(np.empty((n, 3)), np.empty(n), np.empty((n, 3)), np.empty(n, np.int64), np.empty(n, np.bool_))
        engine = self._engine
        edges, rim = self._edges, self._edges.triangles == 1
        corner_rim = np.zeros(len(self.vertices), np.bool_)
        corner_rim[self.rim_edges] = True
        for start in range(0, n, CHUNK):
            keys = morton_keys(points[start : start + CHUNK], engine.centre, self.diagonal)
            closest(
                points,
                start + np.argsort(keys, kind="stable"),
                engine.centre,
                *engine.tree,
                engine.facets,
                edges.of_triangle,
                engine.edge_normals,
                rim,
                self._welded_triangles,
                engine.corner_normals,
                corner_rim,
                engine.tolerance,
                feet.points,
                feet.distance,
                feet.normals,
                feet.triangle,
                feet.on_rim,
            )
        return feet

    def first_hit(self, origins: ArrayLike, directions: ArrayLike, reach: ArrayLike = np.inf) -> Hits:
        """Return where rays first meet the surface, from either side.

        A ray that starts on the surface meets it there or just misses it, as rounding has it: lift the origin.

        Parameters
        ----------
        origins : (n, 3) mm, or (3,) for all rays
        directions : (n, 3), or (3,) for all rays, of any length but zero
        reach : (n,) mm, or one number: a hit farther away does not count, so for "is q seen from p" give its distance

        Raises
        ------
        ValueError
            The shapes differ, a direction is zero, or a number is not finite.
        """
        from inspect3d.nominal.ray_kernel import first_hit

        origins, directions = np.broadcast_arrays(np.atleast_2d(origins), np.atleast_2d(directions))
        origins, directions = floats(origins, "origins", None, 3), floats(directions, "directions", len(origins), 3)
        if not directions.any(axis=1).all():
            raise ValueError("a ray has the direction zero")
        n = len(origins)
        reach = floats(np.broadcast_to(reach, n), "reach", n, finite=False)
        hits = Hits(np.empty(n), np.empty(n, np.int64))
        engine = self._engine
        first_hit(
            origins, unit(directions), engine.centre, reach, *engine.tree, engine.facets, hits.distance, hits.triangle
        )
        return hits

    @cached_property
    def _sides(self) -> Floats:
        corners = self.vertices[self.triangles]
        return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)

    @cached_property
    def _cross(self) -> Floats:
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def _welded(self) -> Integers:
        """For each vertex, (n,), the number of the first one at the same position in lexical order."""
        rank = np.lexsort(self.vertices.T)
        ranked = self.vertices[rank]
        fresh = np.append(True, (ranked[1:] != ranked[:-1]).any(axis=1))
        welded = np.empty(len(rank), np.int64)
        welded[rank] = rank[fresh][np.cumsum(fresh) - 1]
        return welded

    @cached_property
    def _welded_triangles(self) -> Integers:
        return self._welded[self.triangles]

    @cached_property
    def _edges(self) -> _Edges:
        """Number the edges.

        Returns
        -------
        of_triangle : (m, 3) edges ab, bc, ca; -1 for a triangle two of whose corners coincide
        triangles : (e,) how many triangles have the edge
        vertices : (e, 2) at its ends
        """
        n = len(self.vertices)
        start, end = self._welded_triangles, np.roll(self._welded_triangles, -1, axis=1)
        proper = (start != end).all(axis=1)
        keys = (np.minimum(start, end) * n + np.maximum(start, end))[proper]
        found, which, count = np.unique(keys, return_inverse=True, return_counts=True)
        of_triangle = np.full(self.triangles.shape, -1, np.int64)
        of_triangle[proper] = which.reshape(-1, 3)
        return _Edges(of_triangle, count, np.stack(np.divmod(found, n), axis=1))

    @cached_property
    def _engine(self) -> _Engine:
        from inspect3d.nominal.bvh import build

        centre = self.bounds.mean(axis=0)
        corners = self.vertices[self.triangles] - centre
        tree = build(corners)
        facets = np.concatenate([corners.reshape(-1, 9), self.face_normals], axis=1)[tree.order]

        edges, normals = self._edges, self.face_normals
        proper = edges.of_triangle[:, 0] >= 0
        flat = ~normals.any(axis=1)
        edge_normals = np.zeros((len(edges.triangles), 3))
        for k in range(3):
            np.add.at(edge_normals, edges.of_triangle[proper, k], normals[proper])
        edge_normals = _unit_or_zero(edge_normals)
        edge_normals[edges.of_triangle[flat & proper].ravel()] = 0.0
        corner_normals = self.vertex_normals.copy()
        corner_normals[self._welded_triangles[flat].ravel()] = 0.0
        return _Engine(centre, tree, facets, edge_normals, corner_normals, 1e-12 * self.diagonal)


def _unit_or_zero(vectors: Floats) -> Floats:
    """Return vectors (n, 3) at length one, those that cancelled to rounding errors at zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-12, vectors / np.maximum(length, 1e-12), 0.0)
