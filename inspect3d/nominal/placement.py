"""Put nodes exactly on a B-rep: corners on corners, nodes of sharp edges on their curves, all others on their faces."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.nominal.facing import closest_facing
from inspect3d.nominal.lines import Lines, Placed
from inspect3d.nominal.sharp import nearest_nodes, nearest_on_segments
from inspect3d.nominal.surface import Surface
from inspect3d.nominal.tessellation import Tessellation

SNAP = 0.1
"""A node of a sharp edge or a corner lies nearer to its line than this share of the element size."""

_SLIDE = 0.35
"""Where faces gape a node may slide along their edge by this share of the element size."""

_NEAR = 0.05
"""Nodes of a face nearer to its border than this share of the element size are looked at twice."""


def placed(tessellation: Tessellation, nodes: Floats, normals: Floats, feature: Booleans, size: float) -> Placed:
    """Return nodes near a tessellated B-rep at their places on it.

    A node on a line where faces meet or end lies on the one that gapes from the line least, or else has the lowest
    number, at the parameters of its border, and so within the edge's tolerance of the others.

    Parameters
    ----------
    tessellation : of the part, or of one body of it
    nodes : (n, 3) mm, near the part
    normals : (n, 3) of the mesh they make, to tell the sides of a thin wall apart
    feature : (n,) the node belongs to a sharp edge or rim of that mesh
    size : edge length of that mesh, mm
    """
    lines = Lines(tessellation)
    n = len(nodes)
    result = Placed(nodes.copy(), normals.copy(), np.zeros(n, dtype=np.int64), np.zeros(n, dtype=bool))
    near = nearest_on_segments(nodes, *lines.ends(lines.sharp), size / 4)
    sharp = feature & (near.distance < SNAP * size)
    corner, which = nearest_nodes(nodes, tessellation.vertices[lines.corners], SNAP * size)
    sharp[corner] = False
    inside = ~sharp
    inside[corner] = False
    _assign(result, corner, lines.at_vertices(lines.corners[which]))
    segment, share = lines.sharp[near.segment[sharp]], near.share[sharp]
    _assign(result, sharp, lines.at_segments(segment, share, nodes[sharp], _SLIDE * size))
    _assign(result, inside, _on_faces(lines, nodes[inside], normals[inside], size))
    return result


def _assign(all_nodes: Placed, where: Booleans | Integers, some: Placed) -> None:
    for target, source in zip(all_nodes, some, strict=True):
        target[where] = source


def _on_faces(lines: Lines, nodes: Floats, normals: Floats, size: float) -> Placed:
    """Project nodes onto the face whose facet is nearest; over a border onto the neighbour, or else onto the border."""
    mesh = lines.tessellation
    feet, triangle = closest_facing(Surface(mesh.vertices, mesh.triangles), nodes, normals)
    weights = _barycentric(mesh.vertices[mesh.triangles[triangle]], feet)
    face = mesh.face[triangle]
    points, uv = mesh.brep.project(feet, face, np.einsum("ij,ijk->ik", weights, mesh.uv[triangle]))
    reached = mesh.brep.inside(face, uv) & (np.linalg.norm(points - feet, axis=1) < size)
    over = np.flatnonzero(~reached)
    border = nearest_on_segments(feet[over], *lines.ends(slice(None)), size / 4)
    bounded = border.segment >= 0
    over, segment, share = over[bounded], border.segment[bounded], border.share[bounded]

    other = lines.across(segment, face[over])
    beyond, beyond_uv = mesh.brep.project(feet[over], other, lines.parameters(segment, share, other))
    reached = mesh.brep.inside(other, beyond_uv) & (np.linalg.norm(beyond - feet[over], axis=1) < size)
    there, left = over[reached], over[~reached]
    points[there], uv[there], face[there] = beyond[reached], beyond_uv[reached], other[reached]

    to_border = nearest_on_segments(feet, *lines.ends(slice(None)), size / 4).distance
    near = np.flatnonzero(to_border < _NEAR * size)
    for k in near[~mesh.brep.clearly_inside(face[near], uv[near])].tolist():
        points[k] = mesh.brep.owned(int(face[k]), uv[k])

    result = Placed(points, mesh.brep.normals_at(face, uv), face, np.zeros(len(nodes), dtype=bool))
    _assign(result, left, lines.at_segments(segment[~reached], share[~reached], feet[left], _SLIDE * size))
    return result


def _barycentric(corners: Floats, points: Floats) -> Floats:
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    area2 = np.maximum((normal**2).sum(axis=1), 1e-300)
    beta = (np.cross(points - a, c - a) * normal).sum(axis=1) / area2
    gamma = (np.cross(b - a, points - a) * normal).sum(axis=1) / area2
    return np.clip(np.stack([1 - beta - gamma, beta, gamma], axis=1), 0.0, 1.0)
