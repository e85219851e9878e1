"""Truths about the parts of the virtual rig, judged by closed formulas and by OpenCASCADE's own projections."""

from math import pi

import numpy as np
import pytest

from inspect3d.outcome import InputError
from inspect3d.virtual.bracket import BracketSizes, bracket
from inspect3d.virtual.freeform import FreeformSizes, freeform, freeform_patch
from inspect3d.virtual.milled import MilledSizes, milled
from inspect3d.virtual.patch import Patch

PARTS = {"bracket": bracket(), "freeform": freeform(), "milled": milled()}


@pytest.fixture(scope="module", params=PARTS)
def part(request):
    return PARTS[request.param]


@pytest.fixture(scope="module")
def surfaces():
    return {name: part.surface() for name, part in PARTS.items()}


def step_shape(path):
    from OCP.STEPControl import STEPControl_Reader

    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    return reader.OneShape()


def volume_and_area(shape):
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    volume, area = GProp_GProps(), GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, volume)
    BRepGProp.SurfaceProperties_s(shape, area)
    return volume.Mass(), area.Mass()


def distance_to(shape, point):
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.gp import gp_Pnt
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer

    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*map(float, point))).Vertex()
    explorer, nearest = TopExp_Explorer(shape, TopAbs_FACE), np.inf
    while explorer.More():
        nearest = min(nearest, BRepExtrema_DistShapeShape(vertex, explorer.Current()).Value())
        explorer.Next()
    return nearest


def test_the_bracket_has_the_volume_of_its_primitives():
    s = BracketSizes()
    base = s.length * s.width * s.thickness
    wall = s.thickness * s.width * (s.height - s.thickness)
    boss = pi * s.boss[2] ** 2 * s.boss[3]
    spandrel = 1 - pi / 4
    corner = spandrel * s.corner**2 * s.width
    rounded = spandrel * (s.rounding[0] ** 2 + s.rounding[1] ** 2) * s.thickness
    centroid = s.boss[2] + s.boss_foot * (10 - 3 * pi) / (12 - 3 * pi)
    foot = 2 * pi * centroid * spandrel * s.boss_foot**2
    holes = pi * (s.base_hole[2] ** 2 + s.wall_hole[2] ** 2) * s.thickness
    assert volume_and_area(bracket().shape())[0] == pytest.approx(
        base + wall + boss + corner + foot - rounded - holes, rel=1e-9
    )


def test_a_step_file_gives_the_part_back(part, tmp_path):
    part.write_step(tmp_path / "part.step")
    assert volume_and_area(step_shape(tmp_path / "part.step")) == pytest.approx(volume_and_area(part.shape()), rel=1e-9)


def test_the_same_part_gives_the_same_step_file(part, tmp_path, capfd):
    part.write_step(tmp_path / "one.step")
    part.write_step(tmp_path / "two.step")
    assert (tmp_path / "one.step").read_bytes() == (tmp_path / "two.step").read_bytes()
    assert capfd.readouterr() == ("", "")


def test_a_step_file_that_cannot_be_written_is_an_error(tmp_path):
    with pytest.raises(InputError, match="could not be written"):
        freeform().write_step(tmp_path / "nowhere" / "part.step")


def test_sampled_points_lie_on_the_exact_part_within_the_chord(part, surfaces):
    points, _ = surfaces[part.name].sample(150, np.random.default_rng(1))
    shape = part.shape()
    assert max(distance_to(shape, point) for point in points) <= 2e-4


def test_curved_edges_are_left_by_less_than_the_chord(surfaces):
    s = BracketSizes()
    points, normals = surfaces["bracket"].sample(300_000, np.random.default_rng(2))
    radius = np.hypot(points[:, 0] - s.base_hole[0], points[:, 1] - s.base_hole[1])
    on_top = (np.abs(points[:, 2] - s.thickness) < 1e-9) & (normals[:, 2] > 0.999)
    assert radius[on_top].min() > s.base_hole[2] - 2e-4


def test_points_of_a_hole_lie_on_its_cylinder_to_rounding(surfaces):
    s = BracketSizes()
    points, normals = surfaces["bracket"].sample(200_000, np.random.default_rng(3))
    axis = points[:, :2] - np.array(s.base_hole[:2])
    radius = np.hypot(*axis.T)
    inside = (radius < s.base_hole[2] + 0.5) & (np.abs(normals[:, 2]) < 0.5)
    assert np.count_nonzero(inside) > 1000
    np.testing.assert_allclose(radius[inside], s.base_hole[2], atol=1e-10)
    np.testing.assert_allclose(normals[inside, :2], -axis[inside] / s.base_hole[2], atol=1e-9)


@pytest.mark.parametrize("name", ["bracket", "milled"])
def test_normals_point_out_of_the_material(name, surfaces):
    from OCP.BRepClass3d import BRepClass3d_SolidClassifier
    from OCP.gp import gp_Pnt
    from OCP.TopAbs import TopAbs_IN, TopAbs_OUT, TopAbs_SOLID
    from OCP.TopExp import TopExp_Explorer

    solid = TopExp_Explorer(PARTS[name].shape(), TopAbs_SOLID).Current()
    points, normals = surfaces[name].sample(200, np.random.default_rng(4))
    classifier = BRepClass3d_SolidClassifier(solid)
    for sign, state in ((0.01, TopAbs_OUT), (-0.01, TopAbs_IN)):
        for point in points + sign * normals:
            classifier.Perform(gp_Pnt(*point.tolist()), 1e-6)
            assert classifier.State() == state


def test_triangles_turn_the_way_their_faces_look(part, surfaces):
    surface = surfaces[part.name]
    count = len(surface.triangles)
    _, normals = surface.at(np.arange(count), np.full((count, 3), 1 / 3))
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    assert (np.einsum("ni,ni->n", np.cross(b - a, c - a), normals) > 0).all()


def test_samples_spread_by_area(surfaces):
    s = BracketSizes()
    surface = surfaces["bracket"]
    points, _ = surface.sample(400_000, np.random.default_rng(5))
    on_boss = np.abs(points[:, 2] - s.thickness - s.boss[3]) < 1e-9
    on_boss &= np.hypot(points[:, 0] - s.boss[0], points[:, 1] - s.boss[1]) < s.boss[2] + 1e-3
    expected = 400_000 * pi * s.boss[2] ** 2 / volume_and_area(bracket().shape())[1]
    assert np.count_nonzero(on_boss) == pytest.approx(expected, abs=4 * np.sqrt(expected))


def test_the_freeform_sheet_has_its_size_and_relief(surfaces):
    sizes = FreeformSizes()
    vertices = surfaces["freeform"].vertices
    np.testing.assert_allclose(vertices.min(axis=0), 0.0, atol=0.01)
    np.testing.assert_allclose(vertices.max(axis=0), [sizes.length, sizes.width, sizes.relief], atol=0.01)


def test_a_patch_of_a_circle_is_a_circle():
    arc = np.array([[1, 0, 0, 1], [1, 1, 0, 1], [0, 1, 0, 1]]) * np.array([[1], [np.sqrt(0.5)], [1]])
    cylinder = Patch(np.stack([arc, arc + arc[:, 3:] * [0, 0, 2, 0]], axis=1), [0, 0, 0, 1, 1, 1], [0, 0, 1, 1])
    at = np.random.default_rng(6).random((500, 2))
    points, normals = cylinder(at)
    np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), 1.0, rtol=1e-14)
    np.testing.assert_allclose(points[:, 2], 2 * at[:, 1], rtol=1e-14)
    np.testing.assert_allclose(normals[:, :2], points[:, :2], atol=1e-14)


def test_the_derivatives_of_a_patch_are_those_of_its_points():
    patch, h = freeform_patch(FreeformSizes()), 1e-6
    at = np.random.default_rng(7).uniform(0.01, 0.99, (200, 2))
    _, along_u, along_v = patch.derivatives(at)
    for slope, step in ((along_u, [h, 0]), (along_v, [0, h])):
        central = (patch(at + step)[0] - patch(at - step)[0]) / (2 * h)
        np.testing.assert_allclose(slope, central, atol=1e-5)


def test_the_facets_of_the_milled_block_are_planes_of_their_slopes(surfaces):
    sizes = MilledSizes()
    points, normals = surfaces["milled"].sample(50_000, np.random.default_rng(8))
    borders = sizes.facet_borders
    for left, right, slope in zip(borders[:-1], borders[1:], np.radians(sizes.slopes), strict=True):
        on_facet = (points[:, 0] > left) & (points[:, 0] < right) & (normals[:, 2] > 0.5)
        expected = np.array([-np.sin(slope), 0.0, np.cos(slope)])
        np.testing.assert_allclose(normals[on_facet] - expected, 0.0, atol=1e-12)
