"""Small nominal parts in closed form, for tests of registration and deviation."""

from __future__ import annotations

import numpy as np

from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.surface import Surface

WIDTH, DEPTH = 60.0, 45.0


def wave(x, y):
    """Height of a wavy sheet without symmetry, mm."""
    return 4 * np.sin(x / 11 + 0.3) * np.cos(y / 9) + 0.002 * x * y


def wave_normals(x, y):
    """Unit normals of the wavy sheet, by the closed formula."""
    slope_x = 4 / 11 * np.cos(x / 11 + 0.3) * np.cos(y / 9) + 0.002 * y
    slope_y = -4 / 9 * np.sin(x / 11 + 0.3) * np.sin(y / 9) + 0.002 * x
    normals = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=1)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def plane(x, y):
    """Height of a plane, mm."""
    return np.zeros_like(x)


def plane_normals(x, y):
    """Unit normals of the plane."""
    return np.tile([0.0, 0.0, 1.0], (len(x), 1))


def grid(height, edge):
    """Nodes and triangles of a sheet."""
    x, y = np.arange(0, WIDTH + edge / 2, edge), np.arange(0, DEPTH + edge / 2, edge)
    xx, yy = (a.ravel() for a in np.meshgrid(x, y, indexing="ij"))
    i = (np.arange(len(x) - 1)[:, None] * len(y) + np.arange(len(y) - 1)).ravel()
    n = len(y)
    triangles = np.concatenate([np.stack([i, i + n, i + n + 1], 1), np.stack([i, i + n + 1, i + 1], 1)])
    return np.stack([xx, yy, height(xx, yy)], axis=1), triangles


def sheet(height=wave, normals=wave_normals, edge=3.0, fine=0.3):
    """Return a sheet as a nominal part; its inspection nodes and normals are exact."""
    nodes, triangles = grid(height, edge)
    n = len(nodes)
    mesh = InspectionMesh(nodes, triangles, normals(nodes[:, 0], nodes[:, 1]), np.zeros(n, bool), np.full(n, -1))
    return Nominal("sheet", Surface(*grid(height, fine)), mesh)


def scanned(random, count, height=wave, normals=wave_normals, deviation=lambda x, y: 0 * x, noise=0.0):
    """Return points on a sheet with a deviation and normal noise, in the CAD frame, and their normals."""
    x, y = random.uniform(0, WIDTH, count), random.uniform(0, DEPTH, count)
    along = normals(x, y)
    offset = deviation(x, y) + random.normal(0, noise, count) if noise else deviation(x, y)
    return np.stack([x, y, height(x, y)], axis=1) + along * offset[:, None], along
