"""The pieces of a report: digits, colours, viewpoints, flags."""

import base64

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.outcome import InputError
from inspect3d.pose import Pose
from inspect3d.register.alignment import Alignment
from inspect3d.report.colour_bar import tick_words, ticks
from inspect3d.report.colours import deviation_scale, rounded_up, symmetric_limits
from inspect3d.report.compass import round_length
from inspect3d.report.detail import Detail
from inspect3d.report.digits import decimals, measured, number, significant
from inspect3d.report.flags import spread
from inspect3d.report.scene import scene
from inspect3d.report.uncertainty import pose_sigma
from inspect3d.report.viewer import NOTHING, quantised, sharp_edges
from inspect3d.report.viewpoint import Viewpoint, around
from inspect3d.report.views import Views


def box_mesh():
    """Return a box of 30 x 20 x 10 mm with nodes 2.5 mm apart at most."""
    box = trimesh.creation.box((30.0, 20.0, 10.0))
    body = trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(box.vertices, box.faces, max_edge=2.5))
    sharp = body.face_adjacency_edges[body.face_adjacency_angles > np.radians(30)].ravel()
    crease = np.isin(np.arange(len(body.vertices)), sharp)
    return InspectionMesh(body.vertices, body.faces, body.vertex_normals, crease, np.full(len(body.vertices), -1))


MESH = box_mesh()


@pytest.mark.parametrize(
    ("value", "sigma", "words"),
    [
        (0.12345, 0.0055, "+0.123 ± 0.011 mm"),
        (-0.0188, 0.0046, "−0.0188 ± 0.0092 mm"),
        (1.5, 0.05, "+1.50 ± 0.10 mm"),
        (0.00004, 0.0055, "0.000 ± 0.011 mm"),
        (123.4, 20.0, "+123 ± 40 mm"),
        (np.nan, np.nan, "not measured"),
    ],
)
def test_a_value_has_the_digits_its_uncertainty_warrants(value, sigma, words):
    assert measured(value, sigma) == words


def test_an_uncertainty_rounded_up_to_a_power_of_ten_keeps_two_digits():
    assert decimals(0.0999) == 2
    assert decimals(0.0123) == 3
    assert number(-0.0, 2, sign=True) == "0.00"
    assert significant(1.2e-7) == "1.2 × 10^−7"


@given(st.floats(1e-6, 1e6))
def test_round_limits_hold_the_value_and_waste_little(value):
    assert value <= rounded_up(value) * (1 + 1e-9) <= 1.34 * value
    assert value / 2.6 <= round_length(value) <= value * (1 + 1e-9)


@given(st.floats(-10, 10), st.floats(1e-4, 10))
def test_ticks_lie_within_the_limits_and_their_words_differ(low, span):
    values = ticks((low, low + span))
    assert 3 <= len(values) <= 11
    assert (values >= low - 1e-6 * span).all()
    assert (values <= low + span * (1 + 1e-6)).all()
    assert len(set(tick_words(values))) == len(values)


def test_zero_has_the_neutral_colour_wherever_it_lies():
    even, uneven = deviation_scale((-0.2, 0.2)), deviation_scale((-0.1, 0.3))
    assert uneven.colours[64] == pytest.approx(even.colours[128], abs=6)


def test_limits_show_the_height_of_a_defect_but_not_of_a_blunder():
    noise = np.full(10_000, 0.02)
    defect, blunder = noise.copy(), noise.copy()
    defect[:40], blunder[:40] = 0.055, 5.0
    assert symmetric_limits(defect, np.ones(10_000)) == (-0.06, 0.06)
    assert symmetric_limits(blunder, np.ones(10_000)) == (-0.06, 0.06)


def test_the_26_viewpoints_are_right_handed_and_point_outwards():
    for viewpoint in around():
        right, up, near = viewpoint.axes
        assert np.cross(right, up) == pytest.approx(near, abs=1e-12)
        assert Viewpoint.of(viewpoint.name).direction == pytest.approx(viewpoint.direction)


def test_azimuth_and_elevation_name_the_axes():
    assert Viewpoint.of((0, 0)).direction == pytest.approx([1, 0, 0], abs=1e-12)
    assert Viewpoint.of("90,0").direction == pytest.approx([0, 1, 0], abs=1e-12)
    assert Viewpoint.of((0, -90)).direction == pytest.approx([0, 0, -1], abs=1e-12)
    assert Viewpoint.of("front").direction == pytest.approx([0, -1, 0])
    for wrong in ("", "+w", "+x+x", "1,2,3", "0,95", "nan,0"):
        with pytest.raises(InputError, match=r"view"):
            Viewpoint.of(wrong)


def test_a_box_is_seen_on_the_faces_turned_to_the_eye_and_nowhere_else():
    nothing = np.full(len(MESH), np.nan)
    inner = ~MESH.crease
    with scene(MESH.nodes, MESH.triangles, nothing, None, (400, 300)) as window:
        for viewpoint in (Viewpoint.of("+z"), Viewpoint.of("iso"), Viewpoint.of("-x-y")):
            seen = window.sight(viewpoint).sees(MESH.nodes, MESH.normals)
            assert np.array_equal(seen[inner], (MESH.normals @ viewpoint.direction > 0.1)[inner])


def test_the_picture_shows_the_part_where_the_sight_says():
    nothing = np.full(len(MESH), np.nan)
    with scene(MESH.nodes, MESH.triangles, nothing, None, (400, 300)) as window:
        image, sight = window.draw(Viewpoint.of("+z"))
    column, row = np.argwhere((image < 240).all(axis=2)).T[::-1]
    corners = sight.pixels(np.array([[-15.0, 10, 5], [15, -10, 5]]))
    assert (column.min(), row.min()) == pytest.approx(corners[0], abs=1.5)
    assert (column.max(), row.max()) == pytest.approx(corners[1], abs=1.5)


def test_pictures_are_taken_of_the_measured_side_and_of_every_marked_node():
    views = Views.of(MESH)
    top = ~MESH.crease & (MESH.nodes[:, 2] > 4.9)
    assert [view.name for view in views.showing(top, MESH.areas)] == ["+z"]
    below = int(np.flatnonzero(~MESH.crease & (MESH.nodes[:, 2] < -4.9))[0])
    marked = views.showing(top, MESH.areas, [below])
    assert any(view.direction[2] < 0 for view in marked)
    everything = views.showing(np.ones(len(MESH), bool), MESH.areas)
    assert 2 <= len(everything) <= 4


@given(st.lists(st.floats(0, 100), min_size=1, max_size=8))
def test_flags_keep_their_order_and_their_distance(wanted):
    wanted = np.sort(wanted)
    places = spread(wanted, 10.0, 0.0, 100.0)
    assert (np.diff(places) >= 10.0 - 1e-9).all()
    assert (places >= -1e-9).all()
    assert (places <= 100.0 + 1e-9).all()


def test_a_box_has_the_edges_of_a_box():
    edges = sharp_edges(MESH)
    length = np.linalg.norm(MESH.nodes[edges[:, 0]] - MESH.nodes[edges[:, 1]], axis=1).sum()
    assert length == pytest.approx(4 * (30 + 20 + 10))


def test_an_uncertain_height_is_that_of_the_top_and_nothing_on_the_sides():
    covariance = np.diag([0, 0, 0, 0, 0, 0.01**2])
    alignment = Alignment(Pose.identity(), 1.0, 0.02, covariance, np.zeros(3), np.ones(3, bool))
    sigma = pose_sigma(MESH, alignment)
    inner = ~MESH.crease
    assert sigma[inner] == pytest.approx(0.01 * np.abs(MESH.normals[inner, 2]))


def test_an_uncertain_turn_grows_with_the_distance_from_its_axis():
    covariance = np.diag([0, 1e-3**2, 0, 0, 0, 0])
    alignment = Alignment(Pose.identity(), 1.0, 0.02, covariance, np.zeros(3), np.ones(3, bool))
    top = ~MESH.crease & (MESH.nodes[:, 2] > 4.9)
    assert pose_sigma(MESH, alignment)[top] == pytest.approx(1e-3 * np.abs(MESH.nodes[top, 0]), abs=1e-12)


def test_a_view_with_less_detail_shows_true_nodes_and_the_same_surface():
    box = trimesh.creation.box((30.0, 20.0, 10.0))
    fine = trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(box.vertices, box.faces, max_edge=0.6))
    n = len(fine.vertices)
    crease = np.isin(np.arange(n), fine.face_adjacency_edges[fine.face_adjacency_angles > 0.5])
    mesh = InspectionMesh(fine.vertices, fine.faces, fine.vertex_normals, crease, np.full(n, -1))
    kept = [5, n - 7]
    detail = Detail.of(mesh, kept, most=1500)
    assert 500 < len(detail.nodes) <= 1500
    assert set(kept) <= set(detail.nodes)
    assert np.array_equal(detail.place[detail.nodes], np.arange(len(detail.nodes)))
    shown = trimesh.Trimesh(mesh.nodes[detail.nodes], detail.triangles, process=False)
    assert shown.area == pytest.approx(fine.area, rel=0.02)
    assert np.linalg.norm(mesh.nodes - mesh.nodes[detail.nodes][detail.place], axis=1).max() < 4 * 1.5
    assert "of" in detail.words
    assert Detail.of(mesh).words == ""


def test_values_packed_into_two_bytes_keep_their_gaps_and_their_size():
    values = np.array([-0.5, np.nan, 0.123456, 0.5])
    packed = quantised(values)
    codes = np.frombuffer(base64.b64decode(packed["codes"]), "<u2")
    assert codes[1] == NOTHING
    assert packed["low"] + packed["step"] * codes[[0, 2, 3]] == pytest.approx(values[[0, 2, 3]], abs=1e-5)
    assert np.frombuffer(base64.b64decode(quantised(np.full(2, np.nan))["codes"]), "<u2").tolist() == [NOTHING] * 2
