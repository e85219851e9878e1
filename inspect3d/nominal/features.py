"""Faces, edges and vertices of triangles, and the normal that tells on which side of each a point lies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers

CANCELLED = 1e-12


class Features(NamedTuple):
    """Every place a foot can be: m faces, then the edges, then the vertices, then one for sides without length.

    Parameters
    ----------
    of_triangle : (m, 7) the numbers of its face, its edges ab, bc, ca, and its vertices a, b, c
    normals : (f, 3) pseudo-normals, unit: of the face, summed at the edge, angle-weighted at the vertex. Zero where a
        triangle without area takes part: there it must be gathered at the foot.
    rims : (f,) edges with one triangle only, and their ends
    tolerance : mm, a triangle nearer to a foot than this touches it where a normal is gathered
    """

    of_triangle: Integers
    normals: Floats
    rims: Booleans
    tolerance: float


class Edges(NamedTuple):
    """The edges of m triangles.

    Parameters
    ----------
    of_triangle : (m, 3) the numbers of ab, bc, ca; -1 for all three where two corners coincide
    triangles : (e,) how many triangles have the edge
    ends : (e, 2) its vertices
    """

    of_triangle: Integers
    triangles: Integers
    ends: Integers


def welded(vertices: Floats) -> Integers:
    """Return for each vertex (n,) the number of one that stands for all at exactly its position."""
    rank = np.lexsort(vertices.T)
    ranked = vertices[rank]
    fresh = np.append(True, (ranked[1:] != ranked[:-1]).any(axis=1))
    stands_for = np.empty(len(rank), np.int64)
    stands_for[rank] = rank[fresh][np.cumsum(fresh) - 1]
    return stands_for


def edges_of(triangles: Integers) -> Edges:
    """Return the edges of triangles (m, 3); one with two corners the same adds none."""
    start, end = triangles, np.roll(triangles, -1, axis=1)
    proper = (start != end).all(axis=1)
    base = triangles.max() + 1
    keys = (np.minimum(start, end) * base + np.maximum(start, end))[proper]
    found, which, count = np.unique(keys, return_inverse=True, return_counts=True)
    of_triangle = np.full(triangles.shape, -1, np.int64)
    of_triangle[proper] = which.reshape(-1, 3)
    return Edges(of_triangle, count, np.stack(np.divmod(found, base), axis=1))


def corner_sums(corners: Floats, triangles: Integers, normals: Floats, count: int) -> Floats:
    """Return for each of `count` vertices the sum of the triangles' normals, weighted by their angles there, unit.

    Parameters
    ----------
    corners : (m, 3, 3) mm
    triangles : (m, 3) indices of the corners
    normals : (m, 3), unit or zero
    """
    sums = np.zeros((count, 3))
    for k in range(3):
        u, v = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        angle = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))
        _add(sums, triangles[:, k], angle[:, None] * normals)
    return _unit_or_zero(sums)


def features_of(
    triangles: Integers, normals: Floats, vertex_normals: Floats, edges: Edges, tolerance: float
) -> Features:
    """Return the features of triangles (m, 3) with unit normals (m, 3), zero where a triangle has no area."""
    m, e, n = len(triangles), len(edges.triangles), len(vertex_normals)
    flat = ~normals.any(axis=1)
    proper = edges.of_triangle[:, 0] >= 0

    edge_normals = np.zeros((e, 3))
    for k in range(3):
        _add(edge_normals, edges.of_triangle[proper, k], normals[proper])
    edge_normals = _unit_or_zero(edge_normals)
    edge_normals[edges.of_triangle[flat & proper]] = 0.0
    vertex_normals = vertex_normals.copy()
    vertex_normals[triangles[flat]] = 0.0

    edge_rims = edges.triangles == 1
    vertex_rims = np.zeros(n, np.bool_)
    vertex_rims[edges.ends[edge_rims]] = True

    nowhere = m + e + n
    edge_numbers = np.where(edges.of_triangle >= 0, m + edges.of_triangle, nowhere)
    return Features(
        np.column_stack([np.arange(m), edge_numbers, m + e + triangles]),
        np.concatenate([normals, edge_normals, vertex_normals, np.zeros((1, 3))]),
        np.concatenate([np.zeros(m, np.bool_), edge_rims, vertex_rims, np.zeros(1, np.bool_)]),
        tolerance,
    )


def _add(sums: Floats, at: Integers, vectors: Floats) -> None:
    for axis in range(3):
        sums[:, axis] += np.bincount(at, vectors[:, axis], minlength=len(sums))


def _unit_or_zero(vectors: Floats) -> Floats:
    """Return vectors (n, 3) at length one, those that cancelled but for rounding errors at zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > CANCELLED, vectors / np.maximum(length, CANCELLED), 0.0)
