"""Neighbouring faces keep together along their edges when control points move, as the CAD has it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inspect3d.correlation.attachment import Attachment
from inspect3d.correlation.continuity import joints, kept_together
from inspect3d.correlation.evaluation import evaluation_points
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.splines import telling
from inspect3d.nominal.borders import borders
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nurbs_face import nurbs_of
from inspect3d.register.mobility import jacobian
from inspect3d.virtual.milled import milled
from inspect3d.virtual.part import Part

LAND, SECTION, SIDE = 11, 12, 4
LIMIT = 45.0
EDGE = 4


def whole_scene(nominal, numbers):
    """Return all facets of some faces of a part, and their faces."""
    mesh = nominal.mesh
    face = nominal.surface_face[nominal.surface.closest(mesh.nodes[mesh.triangles].mean(axis=1)).triangle]
    kept = np.flatnonzero(np.isin(face, numbers))
    node, triangles = np.unique(mesh.triangles[kept], return_inverse=True)
    every, _ = evaluation_points(nominal, np.full(len(mesh.triangles), EDGE))
    there, starts = np.isin(every.facet, kept), EDGE**2 * np.arange(len(kept) + 1)
    return Scene(
        mesh.nodes[node],
        mesh.normals[node],
        triangles.reshape(-1, 3),
        replace(every, places=every.places[there], shapes=every.shapes[there], starts=starts),
        np.ones((len(kept), 2), dtype=bool),
        node,
        np.zeros(len(node), dtype=np.int64),
        np.ones(len(node), dtype=bool),
        kept,
        np.ones(len(node)),
    ), face[kept]


def attached(nominal, numbers, refine=0, limit=LIMIT):
    """Return the nodes' motions (n, c) by control points, the free motions (c, k), the patches and the scene."""
    scene, face = whole_scene(nominal, numbers)
    patches = {number: nurbs_of(nominal.exact, number, refine) for number in numbers}
    nodes = Attachment(nominal, scene, patches, face).space.nodes
    rows, shifts = joints(nominal.exact, patches, scene, face, limit)
    return nodes, kept_together(rows, shifts, nodes, scene) if len(rows) else None, patches, scene


def along_border(nominal, patches, motion, pair):
    """Return deviations (2, s) of two faces along the normals of their common edge, and the normals (2, s, 3)."""
    (border,) = (b for b in borders(nominal.exact, pair, 3.0) if set(b.faces) == set(pair))
    firsts = dict(zip(patches, np.cumsum([0, *(p.size for p in patches.values())]).tolist(), strict=False))
    found = []
    for number in border.faces:
        patch = patches[number]
        uv = patch.parameters(border.points)
        own = motion[firsts[number] : firsts[number] + patch.size]
        found.append((patch.along(uv, patch.normals(uv)) @ own, patch.normals(uv)))
    return np.array([d for d, _ in found]), np.array([n for _, n in found]), border.points


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    """Return the milled block."""
    path = tmp_path_factory.mktemp("block") / "part.step"
    milled().write_step(path)
    return load_nominal(path, element_size=5.0)


@pytest.fixture(scope="module")
def tube(tmp_path_factory):
    """Return a cylinder, whose side is one face that meets itself smoothly at a seam."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder

    path = tmp_path_factory.mktemp("tube") / "part.step"
    Part("cylinder", lambda: BRepPrimAPI_MakeCylinder(20.0, 40.0).Shape()).write_step(path)
    return load_nominal(path, element_size=6.0)


@pytest.mark.parametrize("refine", [0, 1])
def test_a_motion_less_its_best_fit_has_no_gap_where_faces_keep_together(block, refine):
    nodes, free, patches, scene = attached(block, (LAND, SECTION), refine)
    motion = free @ np.random.default_rng(0).normal(size=free.shape[1])
    rigid = np.linalg.pinv(jacobian(scene.nodes, scene.normals, scene.centre)) @ (nodes @ motion)
    deviations, normals, points = along_border(block, patches, motion, (LAND, SECTION))
    left = [d - jacobian(points, n, scene.centre) @ rigid for d, n in zip(deviations, normals, strict=True)]
    np.testing.assert_allclose(left[0], left[1], atol=0.02)
    assert np.std(deviations) > 0.2


def test_faces_beyond_the_limit_and_at_right_angles_move_by_themselves(block):
    assert attached(block, (LAND, SECTION), limit=30.0)[1] is None
    assert attached(block, (LAND, SIDE))[1] is None


def test_the_part_may_move_as_a_whole(block):
    nodes, free, _, scene = attached(block, (LAND, SECTION), refine=2)
    assert free.shape[1] < nodes.shape[1]
    moved, inside = nodes @ free, ~block.mesh.crease[scene.node]
    for field in jacobian(scene.nodes, scene.normals, scene.centre)[:, 3:].T:
        left = field[inside] - moved[inside] @ np.linalg.lstsq(moved[inside], field[inside], rcond=None)[0]
        assert np.sqrt(np.mean(left**2)) < 0.01


def test_a_seam_of_a_smooth_face_stays_smooth(tube):
    number = next(n for n in (1, 2, 3) if nurbs_of(tube.exact, n).size > 4)
    _, free, patches, _ = attached(tube, (number,))
    patch, (border,) = patches[number], borders(tube.exact, (number,), 5.0)
    motion = free @ np.random.default_rng(0).normal(size=free.shape[1])
    step = 0.01
    shifts = [np.cross(patch.normals(patch.parameters(border.points)), along) for along in border.along]
    values = []
    for k in (0, 1):
        places = [patch.parameters(border.points + m * step * shifts[k]) for m in (0.1, 1.1)]
        values.append([patch.along(uv, patch.normals(uv)) @ motion for uv in places])
    (here, inner), (there, beyond) = values
    np.testing.assert_allclose(here, there, atol=0.01)
    np.testing.assert_allclose(inner - here, there - beyond, atol=5e-4 * step)
    assert np.abs(inner - here).max() > 5e-3 * step


def test_in_all_directions_a_curved_face_follows_more_than_along_its_normals(block):
    scene, face = whole_scene(block, (SECTION,))
    nodes = Attachment(block, scene, {SECTION: nurbs_of(block.exact, SECTION)}, face, ways=3).space.nodes
    inside = ~block.mesh.crease[scene.node]
    aside = scene.normals[inside, 0]
    left = []
    for free in (np.eye(nodes.shape[1])[:, ::3], telling(nodes, 3)):
        moved = nodes[inside] @ free
        left.append(np.std(aside - moved @ np.linalg.lstsq(moved, aside, rcond=None)[0]))
    assert left[1] < 0.1 * left[0]
