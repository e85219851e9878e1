"""What a surface is made of, what it refuses to be made of, and that the compiler changes nothing."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from bodies import scattered, square, wedge

from inspect3d.nominal.surface import Surface


def test_areas_add_up_to_the_body_and_a_closed_one_faces_nowhere():
    mesh = trimesh.creation.box((10.0, 20.0, 30.0))
    surface = Surface(mesh.vertices, mesh.faces)
    assert surface.areas.sum() == pytest.approx(2200.0)
    np.testing.assert_allclose(surface.areas @ surface.face_normals, 0, atol=1e-9)
    np.testing.assert_allclose(surface.bounds, [[-5, -10, -15], [5, 10, 15]])
    assert surface.diagonal == pytest.approx(np.sqrt(1400.0))
    np.testing.assert_allclose(surface.vertex_normals, np.sign(mesh.vertices) / np.sqrt(3), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("vertices", "triangles", "words"),
    [
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.empty((0, 3), int), "at least one triangle"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]], "does not exist"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, -1]], "does not exist"),
        ([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]], "not finite"),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], "area"),
        ([[0, 0, 0], [1e200, 0, 0], [0, 1e200, 0]], [[0, 1, 2]], "digits"),
        ([[0, 0], [1, 0], [2, 0]], [[0, 1, 2]], "shape"),
    ],
)
def test_what_is_no_surface_is_refused(vertices, triangles, words):
    with pytest.raises(ValueError, match=words):
        Surface(vertices, triangles)


def test_points_that_are_no_points_are_refused():
    with pytest.raises(ValueError, match="not finite"):
        square().closest([[0, 0, np.inf]])
    with pytest.raises(ValueError, match="shape"):
        square().closest([[0, 0]])


def test_the_kernels_say_the_same_without_the_compiler(tmp_path):
    """Run in a process of its own, where numba is off from the start."""
    script = """
import sys
import numpy as np
from inspect3d.nominal.surface import Surface
given = np.load(sys.argv[1])
surface = Surface(given["vertices"], given["triangles"])
feet, hits = surface.closest(given["points"]), surface.first_hit(given["points"], -given["points"])
np.savez(sys.argv[2], distance=feet.distance, normals=feet.normals, triangle=feet.triangle, hit=hits.distance)
"""
    mesh = wedge(10.0)
    vertices = np.concatenate([mesh.vertices, mesh.vertices[mesh.faces[0, :2]].mean(axis=0, keepdims=True)])
    triangles = np.concatenate([mesh.faces, [[mesh.faces[0, 0], mesh.faces[0, 1], len(vertices) - 1]]])
    points = scattered(mesh.vertices, mesh.faces, 200, seed=15)
    np.savez(tmp_path / "given.npz", vertices=vertices, triangles=triangles, points=points)
    for switch in ("0", "1"):
        subprocess.run(
            [sys.executable, "-c", script, tmp_path / "given.npz", tmp_path / f"{switch}.npz"],
            env={**os.environ, "NUMBA_DISABLE_JIT": switch},
            check=True,
        )
    compiled, interpreted = np.load(tmp_path / "0.npz"), np.load(tmp_path / "1.npz")
    for name in compiled.files:
        np.testing.assert_allclose(interpreted[name], compiled[name], rtol=1e-12, atol=1e-12)


def test_a_surface_alone_does_not_load_the_compiler():
    script = "import sys; import inspect3d.nominal.surface; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
