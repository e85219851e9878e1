"""What the pages compute: places to snap to, pairs that do not fit, coarse meshes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import trimesh

from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.outcome import InputError
from inspect3d.pose import Pose
from inspect3d.register.landmarks import pose_from_landmarks
from inspect3d.virtual.bracket import bracket
from inspect3d.web.coarse import WANTED, coarse_triangles
from inspect3d.web.pairs import pairs_of
from inspect3d.web.snap_cad import snap_targets
from inspect3d.web.snap_picture import corner_near, ellipse_near
from inspect3d.web.standout import standing_out

FINE = 8
"""Samples per pixel and direction of a picture drawn exactly."""


def drawn(inside, size=160):
    """Return a picture that is bright where inside(x, y), px, is true; every pixel the mean of its area."""
    step = (np.arange(size * FINE) + 0.5) / FINE - 0.5
    x, y = np.meshgrid(step, step)
    share = inside(x, y).reshape(size, FINE, size, FINE).mean(axis=(1, 3))
    grey = cv2.GaussianBlur(60.0 + 140.0 * share, (0, 0), 0.8)
    return grey + np.random.default_rng(0).normal(0, 2.0, grey.shape)


@pytest.fixture(scope="module")
def targets(tmp_path_factory):
    path = tmp_path_factory.mktemp("bracket") / "part.step"
    bracket().write_step(path)
    return snap_targets(load_nominal(path, element_size=2.5).mesh)


def test_the_circles_of_the_cad_have_their_centres_and_radii(targets):
    body = trimesh.creation.cylinder(6.0, 10.0, sections=64)
    nodes, count = np.array([1, 2, 3]) + body.vertices, len(body.vertices)
    mesh = InspectionMesh(nodes, body.faces, body.vertex_normals, np.ones(count, bool), np.full(count, -1))
    found = snap_targets(mesh).circles
    found = found[np.argsort(found[:, 2])]
    assert np.allclose(found[:, :3], [[1, 2, -2], [1, 2, 8]], atol=1e-9)
    assert np.allclose(found[:, 6], 6.0)
    assert np.allclose(np.abs(found[:, 3:6]), [0, 0, 1], atol=1e-9)
    holes = targets.circles
    assert len(holes) >= 4
    assert np.allclose(np.linalg.norm(holes[:, 3:6], axis=1), 1.0)


def test_the_corners_of_the_cad_are_where_its_edges_meet():
    box = trimesh.creation.box((30, 20, 10))
    vertices, faces = trimesh.remesh.subdivide_to_size(box.vertices, box.faces, max_edge=4)
    body = trimesh.Trimesh(vertices, faces)
    on = np.isclose(np.abs(body.vertices), [15, 10, 5]).sum(axis=1)
    mesh = InspectionMesh(body.vertices, body.faces, body.vertex_normals, on > 1, np.full(len(on), -1))
    found = snap_targets(mesh)
    assert len(found.corners) == 8
    assert np.allclose(np.abs(found.corners), [15, 10, 5])
    length = np.linalg.norm(np.diff(found.edges, axis=1), axis=2).sum()
    assert length == pytest.approx(4 * 60)
    assert len(found.circles) == 0


def test_a_click_on_a_corner_of_a_picture_snaps_to_it_within_three_tenths_of_a_pixel():
    for x, y, turn in ((80.3, 78.6, 0.3), (75.0, 83.5, 1.1)):
        grey = drawn(
            lambda u, v, x=x, y=y, t=turn: (
                ((u - x) * np.cos(t) + (v - y) * np.sin(t) > 0) & ((v - y) * np.cos(t) - (u - x) * np.sin(t) > 0)
            )
        )
        found = corner_near(grey, x + 4, y - 3)
        assert np.hypot(found.x - x, found.y - y) < 0.3


def test_a_click_into_an_ellipse_snaps_to_its_centre_within_a_tenth_of_a_pixel():
    for x, y, sign in ((81.4, 77.7, 1), (79.0, 80.25, -1)):
        grey = drawn(lambda u, v, x=x, y=y, s=sign: s * (1 - ((u - x) / 11) ** 2 - ((v - y) / 7) ** 2) > 0)
        found = ellipse_near(grey, x + 3, y + 2)
        assert np.hypot(found.x - x, found.y - y) < 0.1
        assert sorted(found.ellipse[:2]) == pytest.approx([14, 22], abs=1.0)


def test_where_there_is_nothing_a_click_snaps_to_nothing():
    grey = 100 + np.random.default_rng(1).normal(0, 2.0, (160, 160))
    assert ellipse_near(grey, 80, 80) is None
    for beside in ((-500, -500), (1e9, 80)):
        assert corner_near(grey, *beside) is None
        assert ellipse_near(grey, *beside) is None
    edge = drawn(lambda u, v: u > 80)
    found = corner_near(edge, 20, 20)
    assert found is None or np.hypot(found.x - 20, found.y - 20) <= 12


def fitted(measured, cad, fair=0.1):
    return standing_out(
        len(cad),
        3,
        lambda kept: pose_from_landmarks(measured[kept], cad[kept]),
        lambda pose: np.linalg.norm(pose(measured) - cad, axis=1)[:, None],
        fair,
    )


@pytest.mark.parametrize("wrong", range(6))
def test_the_one_pair_that_is_wrong_stands_out_and_has_no_part_in_the_fit(wrong):
    random = np.random.default_rng(wrong)
    cad = random.uniform(-50, 50, (6, 3))
    pose = Pose.small(np.array([0.4, -0.2, 1.0, 5, 6, 7]), np.zeros(3))
    measured = pose.inverse()(cad + random.normal(0, 0.02, cad.shape))
    assert fitted(measured, cad).outlier is None
    measured[wrong] += [3.0, -2.0, 4.0]
    found = fitted(measured, cad)
    assert found.outlier == wrong
    assert found.errors[wrong, 0] == pytest.approx(np.sqrt(29), abs=0.2)
    assert found.rms < 0.05


def test_with_one_pair_more_than_needed_none_is_accused():
    cad = np.array([[0, 0, 0], [50, 0, 0], [0, 50, 0], [0, 0, 50.0]])
    measured = cad.copy()
    measured[0] += 5.0
    assert fitted(measured, cad).outlier is None


def test_unfinished_pairs_are_left_out_and_nonsense_is_refused():
    whole = {"name": "P1", "cad": [1, 2, 3], "shown": [[4, 5], [6, 7]]}
    found = pairs_of({"pairs": [{"cad": None, "shown": [None, None]}, whole, {**whole, "shown": [[4, 5], None]}]}, 2, 2)
    assert (found.numbers, found.names) == ((1,), ("P1",))
    assert found.shown.tolist() == [[[4, 5], [6, 7]]]
    assert pairs_of({"pairs": []}, 2, 2).shown.shape == (0, 2, 2)
    wrong = (
        {"shown": [[4, 5]]},
        {"cad": [1, 2]},
        {"cad": [1, 2, float("nan")]},
        {"cad": [1, 2, True]},
        {"cad": [1, 2, 10**400]},
        {"shown": [["4", 5], [6, 7]]},
    )
    for body in (None, [], {}, {"pairs": [1]}, *({"pairs": [{**whole, **each}]} for each in wrong)):
        with pytest.raises(InputError):
            pairs_of(body, 2, 2)


def test_a_coarse_mesh_keeps_near_the_surface_on_fewer_triangles():
    body = trimesh.creation.icosphere(7, 50.0)
    coarse = coarse_triangles(body.vertices, body.faces, body.vertex_normals)
    assert 0.3 * WANTED < len(coarse) < 2 * WANTED
    middle = body.vertices[coarse].mean(axis=1)
    assert np.abs(np.linalg.norm(middle, axis=1) - 50).max() < 0.5
    thin = trimesh.Trimesh(body.vertices * [1, 1, 0.001], body.faces)
    sides = np.sign(thin.vertices[:, 2][coarse_triangles(thin.vertices, thin.faces, thin.vertex_normals)])
    assert np.mean(np.abs(sides.sum(axis=1)) < 3) < 0.05


def test_a_mesh_of_few_triangles_needs_no_coarse_one():
    body = trimesh.creation.icosphere(2, 50.0)
    assert len(coarse_triangles(body.vertices, body.faces, body.vertex_normals)) == 0
