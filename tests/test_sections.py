"""A section follows the part in its plane, and says of it what the map says."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from test_report import MOMENT, a_record, box_mesh

from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.section import section
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.report.sections import magnification
from inspect3d.report.write import write_report

BOX = box_mesh()


def sphere():
    body = trimesh.creation.icosphere(subdivisions=4, radius=10.0)
    n = len(body.vertices)
    return InspectionMesh(body.vertices, body.faces, body.vertices / 10.0, np.zeros(n, bool), np.full(n, -1))


@pytest.mark.parametrize(
    ("normal", "perimeter"), [((0, 1, 0), 2 * (30 + 10)), ((0, 0, -3), 2 * (30 + 20)), ((1, 0, 0), 2 * (20 + 10))]
)
def test_a_box_is_cut_in_one_closed_rectangle(normal, perimeter):
    (piece,) = section(BOX, np.zeros(3), np.array(normal))
    assert piece.length[-1] == pytest.approx(perimeter)
    assert piece.points[0] == pytest.approx(piece.points[-1])
    assert piece.points @ normal == pytest.approx(0, abs=1e-6)


def test_a_plane_beside_the_part_cuts_nothing_and_one_through_two_bodies_cuts_two():
    assert section(BOX, np.array([0, 0, 99.0]), np.array([0, 0, 1.0])) == ()
    n = len(BOX)
    two = InspectionMesh(
        np.vstack([BOX.nodes, BOX.nodes + np.array([100, 0, 0])]), np.vstack([BOX.triangles, BOX.triangles + n]),
        np.tile(BOX.normals, (2, 1)), np.tile(BOX.crease, 2), np.full(2 * n, -1),
    )  # fmt: skip
    assert len(section(two, np.zeros(3), np.array([0.0, 1.0, 0.0]))) == 2


def test_an_open_surface_is_cut_in_an_open_piece():
    top = BOX.triangles[(BOX.nodes[BOX.triangles][..., 2] > 4.9).all(axis=1)]
    sheet = InspectionMesh(BOX.nodes, top, BOX.normals, BOX.crease, BOX.face)
    (piece,) = section(sheet, np.zeros(3), np.array([0.0, 1.0, 0.0]))
    assert piece.length[-1] == pytest.approx(30)
    assert sorted(np.abs(piece.points[[0, -1], 0])) == pytest.approx([15, 15])


@given(st.floats(-0.9, 0.9), st.floats(-1, 1), st.floats(-1, 1))
def test_a_sphere_grown_by_h_has_a_profile_grown_by_h(offset, a, b):
    ball, normal = sphere(), np.array([a, b, 1.0]) / np.linalg.norm([a, b, 1.0])
    (piece,) = section(ball, 10 * offset * normal, normal)
    everywhere = Deviation(np.full(len(ball), 0.5), np.full(len(ball), 0.1), np.ones(len(ball), bool))
    value, sigma = piece.along(everywhere)
    assert value == pytest.approx(0.5)
    assert sigma == pytest.approx(0.1)
    outward = piece.normals(ball, normal)
    assert outward @ normal == pytest.approx(0, abs=1e-9)
    radial = piece.points - 10 * offset * normal
    cosine = np.einsum("ij,ij->i", outward, radial) / np.linalg.norm(radial, axis=1)
    assert cosine.min() > 0.999


def test_what_was_not_measured_is_a_gap():
    seen = ~BOX.crease & (BOX.nodes[:, 2] > 4.9)
    height = np.where(seen, BOX.nodes[:, 0] / 100, np.nan)
    (piece,) = section(BOX, np.array([0, 0.3, 0]), np.array([0.0, 1.0, 0.0]))
    value, sigma = piece.along(Deviation(height, np.where(seen, 0.01, np.nan), seen))
    told = np.isfinite(value)
    assert np.isfinite(sigma).tolist() == told.tolist()
    assert piece.points[told][:, 2] == pytest.approx(5.0)
    assert np.abs(value[told] - piece.points[told][:, 0] / 100).max() < 0.013


@given(st.floats(1e-4, 10), st.floats(1, 1000))
def test_a_deviation_is_magnified_to_a_visible_size_and_never_reduced(largest, size):
    factor = magnification(largest, size)
    assert factor >= 1
    assert factor == 1 or 0.027 * size <= factor * largest <= 0.071 * size


def test_sections_are_drawn_for_each_measurement_and_told_of_in_both_reports(tmp_path):
    planes = [{"point": [0, 0, 0], "normal": [0, 1, 0]}, {"point": [999, 0, 0], "normal": [1, 0, 0]}]
    write_report(a_record(sections=planes), tmp_path, moment=MOMENT)
    assert (tmp_path / "pictures" / "section_1_laser.png").stat().st_size > 10_000
    html = (tmp_path / "report.html").read_text("utf-8")
    assert "Section 1, laser: plane through (0.00, 0.00, 0.00) mm, normal (0.00, 1.00, 0.00)" in html
    assert "This plane does not meet the part." in html
