"""Stage 1 on B-rep models made here: exact nodes, exact normals, creases, units, and files that are refused."""

from __future__ import annotations

import itertools
import os
import re
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from inspect3d.nominal.brep import Brep
from inspect3d.nominal.inspection_mesh import mesh_on_brep
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nominal import Nominal
from inspect3d.nominal.sharp import sides_of
from inspect3d.nominal.step_iges import read_brep, silence
from inspect3d.nominal.survived import survived
from inspect3d.nominal.tessellation import tessellated
from inspect3d.outcome import InputError


def box(*size: float) -> Any:
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox

    return BRepPrimAPI_MakeBox(*size).Shape()


def cylinder(radius: float, height: float) -> Any:
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder

    return BRepPrimAPI_MakeCylinder(radius, height).Shape()


def sphere(radius: float) -> Any:
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere

    return BRepPrimAPI_MakeSphere(radius).Shape()


def cone(radius: float, height: float) -> Any:
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCone

    return BRepPrimAPI_MakeCone(radius, 0.0, height).Shape()


def sheet() -> Any:
    """Return a quarter of a tube, 40 mm in radius, with walls of 0.2 mm: far thinner than an element."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut

    tube = BRepAlgoAPI_Cut(cylinder(40.0, 30.0), cylinder(39.8, 30.0)).Shape()
    return BRepAlgoAPI_Common(tube, box(50.0, 50.0, 30.0)).Shape()


def rounded_box(size: float, radius: float) -> Any:
    from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp
    from OCP.TopoDS import TopoDS
    from OCP.TopTools import TopTools_IndexedMapOfShape

    block = box(size, size, size)
    fillet, edges = BRepFilletAPI_MakeFillet(block), TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(block, TopAbs_ShapeEnum.TopAbs_EDGE, edges)
    for k in range(1, edges.Extent() + 1):
        fillet.Add(radius, TopoDS.Edge_s(edges.FindKey(k)))
    return fillet.Shape()


def saved(shape: Any, path: Path, unit: str = "MM") -> Path:
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    silence()
    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", unit)
    writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(path))
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    return path


def saved_iges(shape: Any, path: Path) -> Path:
    from OCP.IGESControl import IGESControl_Writer

    writer = IGESControl_Writer("MM", 0)
    writer.AddShape(shape)
    writer.ComputeModel()
    writer.Write(str(path))
    return path


def loaded(shape: Any, folder: Path, element_size: float | None = None) -> Nominal:
    return load_nominal(saved(shape, folder / "part.step"), element_size=element_size)


def distance_to_owner(nominal: Nominal, nodes: np.ndarray) -> np.ndarray:
    """Return what OpenCASCADE measures from nodes to the trimmed faces that own them."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.gp import gp_Pnt

    part, mesh = nominal.exact, nominal.mesh
    assert isinstance(part, Brep)
    vertices = (BRepBuilderAPI_MakeVertex(gp_Pnt(*mesh.nodes[k])).Vertex() for k in nodes)
    faces = (part.faces[mesh.face[k] - 1] for k in nodes)
    return np.array([BRepExtrema_DistShapeShape(v, f).Value() for v, f in zip(vertices, faces, strict=True)])


def test_nodes_of_a_ball_lie_on_it_and_their_normals_point_away_from_its_centre(tmp_path: Path) -> None:
    mesh = loaded(sphere(10.0), tmp_path).mesh
    radius = np.linalg.norm(mesh.nodes, axis=1)
    np.testing.assert_allclose(radius, 10.0, atol=1e-9)
    np.testing.assert_allclose(mesh.normals, mesh.nodes / 10.0, atol=1e-6)
    assert not mesh.crease.any()
    assert sides_of(mesh.nodes, mesh.triangles).uses.tolist() == [2] * (len(mesh) * 3 - 6)


def test_only_nodes_on_the_edges_of_a_box_are_creases_and_a_corner_looks_along_its_diagonal(tmp_path: Path) -> None:
    mesh = loaded(box(20.0, 30.0, 40.0), tmp_path).mesh
    on_faces = (np.isclose(mesh.nodes, 0.0, atol=1e-9) | np.isclose(mesh.nodes, (20.0, 30.0, 40.0), atol=1e-9)).sum(
        axis=1
    )
    assert (on_faces >= 1).all()
    np.testing.assert_array_equal(mesh.crease, on_faces >= 2)
    corners = on_faces == 3
    assert corners.sum() == 8
    np.testing.assert_allclose(np.abs(mesh.normals[corners]), 1 / np.sqrt(3), atol=1e-9)
    np.testing.assert_allclose(np.sort(np.abs(mesh.normals[on_faces == 2]), axis=1)[:, 1:], np.sqrt(0.5), atol=1e-9)


@pytest.mark.parametrize("size", [1.0, 3.0])
def test_the_edges_of_the_inspection_mesh_have_the_asked_length(tmp_path: Path, size: float) -> None:
    mesh = loaded(rounded_box(30.0, 6.0), tmp_path, size).mesh
    assert abs(mesh.edge_length / size - 1) < 0.2
    corners = mesh.nodes[mesh.triangles]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert np.percentile(area / sides.max(axis=1) ** 2, 1) > 0.2  # 0.43 is equilateral


def test_fillets_much_smaller_than_an_element_leave_no_node_off_the_part(tmp_path: Path) -> None:
    nominal = loaded(rounded_box(30.0, 0.1), tmp_path, 3.0)
    assert distance_to_owner(nominal, np.arange(len(nominal.mesh))).max() < 1e-6
    assert not nominal.mesh.crease.any(), "the faces of a rounded box meet smoothly"
    assert nominal.surface.closed


def test_nodes_of_a_curved_edge_lie_on_both_faces_beside_it(tmp_path: Path) -> None:
    mesh = loaded(cylinder(10.0, 20.0), tmp_path).mesh
    radius, height = np.linalg.norm(mesh.nodes[:, :2], axis=1), mesh.nodes[:, 2]
    on_side, on_end = np.abs(radius - 10.0) < 1e-9, np.minimum(np.abs(height), np.abs(height - 20.0)) < 1e-9
    assert (on_side | on_end).all()
    np.testing.assert_array_equal(mesh.crease, on_side & on_end)
    assert mesh.crease.sum() > 20
    np.testing.assert_allclose(np.abs(mesh.normals[mesh.crease, 2]), np.sqrt(0.5), atol=1e-9)


def test_the_tip_of_a_cone_is_a_crease_that_looks_along_the_axis(tmp_path: Path) -> None:
    mesh = loaded(cone(10.0, 10.0), tmp_path).mesh
    tip = np.argmax(mesh.nodes[:, 2])
    np.testing.assert_allclose(mesh.nodes[tip], (0.0, 0.0, 10.0), atol=1e-9)
    assert mesh.crease[tip]
    np.testing.assert_allclose(mesh.normals[tip], (0.0, 0.0, 1.0), atol=0.02)


def test_a_wall_much_thinner_than_an_element_keeps_its_two_sides_apart(tmp_path: Path) -> None:
    nominal = loaded(sheet(), tmp_path, 4.0)
    mesh = nominal.mesh
    assert distance_to_owner(nominal, np.arange(len(mesh))).max() < 1e-6
    radius = np.linalg.norm(mesh.nodes[:, :2], axis=1)
    radial = (mesh.normals[:, :2] * mesh.nodes[:, :2]).sum(axis=1) / radius
    flat = ~mesh.crease
    assert (np.sign(radial[flat]) == np.sign(radius[flat] - 39.9)).all()
    assert (sides_of(mesh.nodes, mesh.triangles).uses == 2).all()


def test_touching_bodies_stay_two(tmp_path: Path) -> None:
    from OCP.BRep import BRep_Builder
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Trsf, gp_Vec
    from OCP.TopoDS import TopoDS_Compound

    shift = gp_Trsf()
    shift.SetTranslation(gp_Vec(10.0, 0.0, 0.0))
    builder, pair = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(pair)
    builder.Add(pair, box(10.0, 10.0, 10.0))
    builder.Add(pair, BRepBuilderAPI_Transform(box(10.0, 10.0, 10.0), shift).Shape())
    nominal = loaded(pair, tmp_path, 2.0)
    assert set(nominal.mesh.face) == set(range(1, 13))
    assert (sides_of(nominal.mesh.nodes, nominal.mesh.triangles).uses == 2).all()
    touching = np.isclose(nominal.mesh.nodes[:, 0], 10.0, atol=1e-9) & ~nominal.mesh.crease
    assert {-1.0, 1.0} == set(np.round(nominal.mesh.normals[touching, 0], 9))


def test_a_step_file_in_inches_is_read_in_millimetres(tmp_path: Path) -> None:
    part = read_brep(saved(box(25.4, 50.8, 76.2), tmp_path / "part.stp", "INCH"))
    vertices = tessellated(part, 0.1).vertices
    np.testing.assert_allclose(np.ptp(vertices, axis=0), (25.4, 50.8, 76.2), atol=1e-6)


def test_the_faces_of_an_iges_file_are_sewn_and_turned_outside_out(tmp_path: Path) -> None:
    nominal = load_nominal(saved_iges(cylinder(10.0, 20.0), tmp_path / "part.IGS"))
    assert nominal.surface.closed
    assert (nominal.surface.closest(nominal.mesh.nodes + 0.1 * nominal.mesh.normals).distance > 0).all()


def test_flip_turns_an_open_sheet_and_leaves_a_solid_alone(tmp_path: Path) -> None:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.gp import gp_Pln

    sheet_file = saved(BRepBuilderAPI_MakeFace(gp_Pln(), 0.0, 20.0, 0.0, 10.0).Face(), tmp_path / "sheet.step")
    plain, flipped = (load_nominal(sheet_file, element_size=2.0, flip=flip) for flip in (False, True))
    np.testing.assert_allclose(plain.mesh.normals, np.tile((0.0, 0.0, 1.0), (len(plain.mesh), 1)), atol=1e-12)
    np.testing.assert_allclose(flipped.mesh.normals, np.tile((0.0, 0.0, -1.0), (len(flipped.mesh), 1)), atol=1e-12)
    assert any("open" in remark for remark in plain.remarks)
    solid = load_nominal(saved(box(5.0, 5.0, 5.0), tmp_path / "solid.step"), flip=True)
    assert (solid.mesh.normals * (solid.mesh.nodes - 2.5)).sum(axis=1).min() > 0
    assert any("closed" in remark for remark in solid.remarks)


def test_the_chord_bounds_the_distance_from_the_exact_part_to_the_surface(tmp_path: Path) -> None:
    nominal = loaded(rounded_box(30.0, 6.0), tmp_path)
    assert nominal.chord < 3e-5 * nominal.diagonal
    assert np.abs(nominal.surface.closest(nominal.mesh.nodes).distance).max() < 2 * nominal.chord


def test_projection_finds_the_nearest_point_of_a_face_whatever_the_guess() -> None:
    from inspect3d.nominal.step_iges import brep_of

    shape = cylinder(10.0, 20.0)
    part = brep_of(shape, _faces(shape))
    angle = np.linspace(0.0, 6.0, 25)
    points = np.stack([12.0 * np.cos(angle), 12.0 * np.sin(angle), np.full(25, 7.0)], axis=1)
    side = next(k for k, surface in enumerate(part.surfaces, 1) if "Cylinder" in str(surface.GetType()))
    face = np.full(25, side)
    for guess in (None, np.stack([angle + 1.0, np.full(25, 1.0)], axis=1)):
        feet, uv = part.project(points, face, guess)
        np.testing.assert_allclose(feet, points * (10 / 12, 10 / 12, 1.0), atol=1e-9)
        np.testing.assert_allclose(part.points_at(face, uv), feet)
        np.testing.assert_allclose(part.normals_at(face, uv), points * (1 / 12, 1 / 12, 0.0), atol=1e-9)


def test_loading_twice_gives_the_same_nodes(tmp_path: Path) -> None:
    part = read_brep(saved(rounded_box(20.0, 4.0), tmp_path / "part.step"))
    once, twice = (mesh_on_brep(tessellated(part, 0.05), 2.0)[0] for _ in range(2))
    np.testing.assert_array_equal(once.nodes, twice.nodes)
    np.testing.assert_array_equal(once.triangles, twice.triangles)


def test_regions_find_the_nodes_of_a_face_by_its_number(tmp_path: Path) -> None:
    mesh = loaded(box(10.0, 10.0, 10.0), tmp_path, 2.0).mesh
    found = np.concatenate([mesh.nodes_of([number]) for number in range(1, 7)])
    np.testing.assert_array_equal(np.sort(found), np.arange(len(mesh)))
    assert np.ptp(mesh.nodes[mesh.nodes_of([1])], axis=0).min() == 0, "one face of a box is flat"


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("part.step", lambda text: b"solid\n" + text[200:], "not a STEP file"),
        ("part.step", lambda text: text[: len(text) // 2], "cut off"),
        ("part.step", lambda text: b"", "not a STEP file"),
        ("part.step", lambda text: text.replace(b"ADVANCED_FACE", b"", 1).replace(b"#20 = ", b"#99999 = "), "damaged"),
        ("part.step", lambda text: text.replace(b" VECTOR(", b" DIRECTION(", 1), "wrong Line"),
        ("part.igs", lambda text: b"hello\n", "not an IGES file"),
        ("part.igs", lambda text: text[: len(text) // 2], "cut off"),
    ],
)
def test_what_is_not_step_or_iges_is_refused_by_name(tmp_path: Path, name: str, change: Any, says: str) -> None:
    path = tmp_path / name
    (saved_iges if name.endswith("igs") else saved)(box(1.0, 2.0, 3.0), path)
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(InputError, match=says) as refusal:
        load_nominal(path)
    assert name in str(refusal.value)


def test_a_step_file_that_crashes_opencascade_is_refused(tmp_path: Path) -> None:
    path = saved(cylinder(1.0, 2.0), tmp_path / "part.step")
    curve = re.compile(rb"(DEFINITIONAL_REPRESENTATION\('',)\((#\d+)\),(#\d+)")
    path.write_bytes(curve.sub(rb"\1(\3),\2", path.read_bytes(), count=1))
    with pytest.raises(InputError, match=r"part\.step is damaged: OpenCASCADE crashes or hangs"):
        load_nominal(path)


def test_a_crash_or_an_endless_loop_ends_the_child_only_and_an_exception_is_neither() -> None:
    assert not survived(lambda: os.kill(os.getpid(), signal.SIGSEGV), 20)
    assert not survived(lambda: all(itertools.repeat(True)), 1)
    assert survived(lambda: 1 // 0, 20)
    assert survived(lambda: None, 20)


def test_a_step_file_without_faces_is_refused(tmp_path: Path) -> None:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.gp import gp_Pnt

    edge = BRepBuilderAPI_MakeEdge(gp_Pnt(0, 0, 0), gp_Pnt(1, 0, 0)).Edge()
    with pytest.raises(InputError, match="no faces"):
        load_nominal(saved(edge, tmp_path / "line.step"))


def _faces(shape: Any) -> list[Any]:
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp
    from OCP.TopTools import TopTools_IndexedMapOfShape

    faces = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, TopAbs_ShapeEnum.TopAbs_FACE, faces)
    return [faces.FindKey(k) for k in range(1, faces.Extent() + 1)]
