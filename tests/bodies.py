"""Bodies with flat sides, points around them, and what brute force says of both."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from inspect3d.nominal.surface import Surface


def grid_box():
    """Return a box of 4 x 4 x 4 mm with corners at whole numbers, two triangles to a side."""
    return trimesh.creation.box((4.0, 4.0, 4.0))


def square(turn=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
    """Return a square of 10 x 10 mm of 50 triangles, facing up before it is turned."""
    x, y = np.meshgrid(np.arange(6) * 2.0, np.arange(6) * 2.0, indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(36)])
    a = (np.arange(5)[:, None] * 6 + np.arange(5)).ravel()
    triangles = np.concatenate([np.column_stack([a, a + 6, a + 7]), np.column_stack([a, a + 7, a + 1])])
    return Surface(vertices @ np.transpose(turn), triangles)


def turned(mesh, seed):
    """Return vertices and triangles of a mesh, turned and shifted at random."""
    rng = np.random.default_rng(seed)
    rotation = Rotation.random(rng=rng).as_matrix()
    return np.asarray(mesh.vertices) @ rotation.T + rng.normal(size=3) * 30, np.asarray(mesh.faces, dtype=np.int64)


def wedge(angle):
    """Return a knife: 80 mm long, 20 mm high, with an edge of `angle` degrees."""
    half = 20 * np.tan(np.radians(angle) / 2)
    profile = np.array([[0, 0], [20, half], [20, -half]])
    vertices = np.concatenate([np.column_stack([np.full(3, x), profile]) for x in (-40.0, 40.0)])
    return convex(vertices)


def convex(vertices):
    """Return the hull with long, thin triangles as they come."""
    return trimesh.convex.convex_hull(np.asarray(vertices, dtype=float), qhull_options="QbB Pp Qt")


def star():
    """Return a body with spikes and pits: every vertex and edge is convex, concave or a saddle."""
    mesh = trimesh.creation.icosphere(subdivisions=1, radius=20.0)
    mesh.vertices = mesh.vertices * (1 + 0.8 * np.sin(7 * mesh.vertices[:, [0]]) * np.cos(5 * mesh.vertices[:, [1]]))
    return mesh


def tube():
    """Return a thin pipe of needles: walls of 0.05 mm, triangles 100 mm long and 0.8 mm wide."""
    return trimesh.creation.annulus(r_min=3.0, r_max=3.05, height=100.0, sections=24)


CLOSED = {
    "box": lambda: trimesh.creation.box((10.0, 20.0, 30.0)),
    "star": star,
    "torus": lambda: trimesh.creation.torus(30.0, 4.0, major_sections=10, minor_sections=8),
    "foil of 1 um": lambda: trimesh.creation.box((100.0, 60.0, 1e-3)),
    "foil of 1 nm": lambda: trimesh.creation.box((100.0, 60.0, 1e-6)),
    "knife of 10 degrees": lambda: wedge(10.0),
    "knife of 0.1 degrees": lambda: wedge(0.1),
    "tube": tube,
}


def scattered(vertices, triangles, count, seed):
    """Return points at distances of 1 pm to 0.1 m around faces, edges and vertices alike."""
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet((1, 1, 1), count)
    weights[count // 3 :, 0] = 0
    weights[2 * count // 3 :, 1] = 0
    weights /= weights.sum(axis=1, keepdims=True)
    on = np.einsum("nk,nkj->nj", weights, vertices[triangles[rng.integers(len(triangles), size=count)]])
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return on + directions * 10 ** rng.uniform(-9, 2, (count, 1))


def dots(u, v):
    return np.einsum("...i,...i->...", u, v)


def to_segments(points, starts, ends):
    """Return the distances (n, m) from points to segments."""
    edges, arms = ends - starts, points[:, None] - starts
    along = np.clip(dots(arms, edges) / np.maximum(dots(edges, edges), 1e-300), 0, 1)
    return np.sqrt(((arms - along[..., None] * edges) ** 2).sum(axis=2))


def brute_distances(points, vertices, triangles):
    """Return the unsigned distances (n,) from points to triangles, each tried, in extended precision."""
    a, b, c = (vertices[triangles[:, k]].astype(np.longdouble) for k in range(3))
    normals = np.cross(b - a, c - a)
    normals -= dots(normals, b - a)[:, None] * (b - a) / np.maximum(dots(b - a, b - a), 1e-300)[:, None]
    normals /= np.maximum(np.sqrt(dots(normals, normals)), 1e-300)[:, None]
    least = np.empty(len(points))
    for start in range(0, len(points), 1000):
        part = points[start : start + 1000].astype(np.longdouble)
        distances = np.abs(dots(part[:, None] - a, normals))
        for p, q in ((a, b), (b, c), (c, a)):
            distances[dots(np.cross(q - p, part[:, None] - p), normals) <= 0] = np.inf
        for p, q in ((a, b), (b, c), (c, a)):
            distances = np.minimum(distances, to_segments(part, p, q))
        least[start : start + 1000] = distances.min(axis=1)
    return least


def brute_inside(points, vertices, triangles):
    """Tell which points lie inside a closed surface, by its solid angle (Van Oosterom, Strackee 1983).

    A foil of 1 nm is told apart in extended precision only.
    """
    vertices = vertices.astype(np.longdouble)
    inside = np.empty(len(points), dtype=bool)
    for start in range(0, len(points), 1000):
        a, b, c = (vertices[triangles[:, k]] - points[start : start + 1000, None] for k in range(3))
        u, v, w = (np.sqrt(dots(x, x)) for x in (a, b, c))
        volume = dots(a, np.cross(b, c))
        angles = 2 * np.arctan2(volume, u * v * w + dots(a, b) * w + dots(b, c) * u + dots(c, a) * v)
        inside[start : start + 1000] = angles.sum(axis=1) > 2 * np.pi
    return inside


def brute_hits(origins, directions, vertices, triangles):
    """Return how far rays go, each triangle tried (Moeller, Trumbore 1997), with a hair's breadth of tolerance."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    p = np.cross(directions[:, None], c - a)
    scale = 1 / dots(p, b - a)
    arms = origins[:, None] - a
    q = np.cross(arms, b - a)
    u, v, t = dots(arms, p) * scale, dots(directions[:, None], q) * scale, dots(c - a, q) * scale
    return np.where((u >= -1e-12) & (v >= -1e-12) & (u + v <= 1 + 1e-12) & (t > 0), t, np.inf).min(axis=1)
