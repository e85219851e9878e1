"""The smooth shape behind the facets: normals without the steps of the tessellation, and faces without its seams."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from inspect3d.arrays import Floats, Integers, unit
from inspect3d.nominal.surface import Surface

SHARP = np.cos(np.radians(30.0))  # facets that meet at more than 30 degrees belong to different faces


@dataclass(frozen=True, eq=False)
class Smooth:
    """A surface seen without its facets: neighbours within 30 degrees are one smooth face."""

    surface: Surface

    @cached_property
    def patches(self) -> Integers:
        """Return the number of the smooth face that each triangle (m,) belongs to."""
        triangles, normals = self.surface.triangles, self.surface.face_normals
        ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        owner = np.repeat(np.arange(len(triangles)), 3)
        order = np.lexsort((ends[:, 1], ends[:, 0]))
        ends, owner = ends[order], owner[order]
        shared = (ends[1:] == ends[:-1]).all(axis=1)
        one, other = owner[:-1][shared], owner[1:][shared]
        smooth = np.einsum("ni,ni->n", normals[one], normals[other]) > SHARP
        one, other = one[smooth], other[smooth]
        graph = coo_array((np.ones(len(one)), (one, other)), shape=(len(triangles),) * 2)
        return connected_components(graph, directed=False)[1].astype(np.int64)

    def normals(self, points: Floats, triangle: Integers) -> Floats:
        """Return the normals (n, 3), unit, at points (n, 3) mm of given triangles (n,), interpolated over smooth faces.

        Each corner takes the mean of the facets around it that lie within 30 degrees of the triangle, weighted by area.
        """
        faces, inverse = np.unique(triangle, return_inverse=True)
        corner_normals = self._corners(faces)[inverse]
        a, b, c = (self.surface.vertices[self.surface.triangles[triangle, k]] for k in range(3))
        return unit(np.einsum("nk,nki->ni", _barycentric(points, a, b, c), corner_normals))

    def _corners(self, faces: Integers) -> Floats:
        """Return the smooth normals (k, 3, 3) at the three corners of k triangles."""
        starts, around = self._incidence
        corners = self.surface.triangles[faces].ravel()
        own = np.repeat(self.surface.face_normals[faces], 3, axis=0)
        count = starts[corners + 1] - starts[corners]
        which = np.repeat(np.arange(len(corners)), count)
        offset = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        neighbour = around[starts[corners][which] + offset]
        normals = self.surface.face_normals[neighbour]
        weight = self.surface.areas[neighbour] * (np.einsum("ni,ni->n", normals, own[which]) > SHARP)
        total = np.stack([np.bincount(which, weight * normals[:, k], minlength=len(corners)) for k in range(3)], axis=1)
        return unit(np.where(np.linalg.norm(total, axis=1, keepdims=True) > 0, total, own)).reshape(-1, 3, 3)

    @cached_property
    def _incidence(self) -> tuple[Integers, Integers]:
        """Triangles around each vertex: those of vertex v are around[starts[v]:starts[v + 1]]."""
        flat = self.surface.triangles.ravel()
        order = np.argsort(flat, kind="stable")
        starts = np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=len(self.surface.vertices)))])
        return starts.astype(np.int64), (order // 3).astype(np.int64)


def _barycentric(points: Floats, a: Floats, b: Floats, c: Floats) -> Floats:
    """Return the barycentric coordinates (n, 3) of points in triangles, clipped to the inside."""
    u, v, w = b - a, c - a, points - a
    uu, uv, vv = (np.einsum("ni,ni->n", x, y) for x, y in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("ni,ni->n", w, u), np.einsum("ni,ni->n", w, v)
    det = np.where(np.abs(uu * vv - uv * uv) > 0, uu * vv - uv * uv, 1.0)
    second, third = (vv * wu - uv * wv) / det, (uu * wv - uv * wu) / det
    shares = np.clip(np.stack([1 - second - third, second, third], axis=1), 0, 1)
    return shares / np.maximum(shares.sum(axis=1, keepdims=True), 1e-12)
