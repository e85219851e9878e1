"""Every CAD file of the real data gives an inspection mesh whose nodes keep to their faces."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from beside import beside, edges_at

from inspect3d.nominal.brep import Brep
from inspect3d.nominal.inspection_mesh import mesh_on_brep
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.nominal.step_iges import read_brep
from inspect3d.nominal.tessellation import tessellated

pytestmark = pytest.mark.data

STEP = [
    "step_freeform/occt_screw.step",
    "step_freeform/pythonocc_Ventilator.stp",
    "step_freeform/pythonocc_as1-oc-214.stp",
    "step_freeform/pythonocc_splinecage.stp",
    "step_freeform/trimesh_base_interface_AP203.STEP",
    "step_freeform/trimesh_base_interface_AP214.STEP",
    "step_freeform/trimesh_featuretype.STEP",
    "pawn_structured_light/PawnTargetv6.step",
    "pawn_structured_light/other_targets/FlatTargetv3.step",
    "pawn_structured_light/other_targets/RookTargetv12.step",
    "pawn_structured_light/other_targets/ShapesTargetv4.step",
]
IGES = ["bladex_lower.iges", "pythonocc_surf114.igs", "pyiges_impeller.igs"]
MESHES = [
    ("cranfield_realsense/cad/Base-Top_Plate.stl", "cm"),
    ("cranfield_realsense/cad/Pendulum.stl", "cm"),
    ("cranfield_realsense/cad/Round-Peg.stl", "cm"),
    ("cranfield_realsense/cad/Separator.stl", "cm"),
    ("cranfield_realsense/cad/Shaft-New.stl", "cm"),
    ("cranfield_realsense/cad/Square-Peg.stl", "cm"),
    ("step_freeform/bladex_lower.stl", "mm"),
    ("step_freeform/trimesh_featuretype.STL", "inch"),
    ("bunny_multiscan/bun_zipper.ply", "m"),
]


read = cache(read_brep)


@cache
def meshed(path: Path, elements: int = 25) -> tuple[Brep, InspectionMesh]:
    """Return the part and an inspection mesh of so many elements on its diagonal: 25 are quick, 60 the default."""
    part = read(path)
    size = part.diagonal / elements
    return part, mesh_on_brep(tessellated(part, size / 50), size)[0]


def distance(part: Brep, face: int, point: np.ndarray) -> float:
    """Return the distance from a point to a trimmed face as OpenCASCADE measures it.

    `BRepExtrema` forgets to bring the parameters of a torus into the range of the face and then measures to its edges;
    there the foot and whether the face contains it are asked for one by one.
    """
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.gp import gp_Pnt

    found = BRepExtrema_DistShapeShape(BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex(), part.faces[face - 1]).Value()
    if found < 1e-6 or "Torus" not in str(part.surfaces[face - 1].GetType()):
        return found
    feet, uv = part.project(point[None], np.array([face]))
    return float(np.linalg.norm(feet[0] - point)) if part.inside(np.array([face]), uv)[0] else found


@pytest.mark.parametrize("name", STEP)
def test_nodes_of_a_step_file_lie_on_the_face_that_owns_them(data: Path, name: str) -> None:
    part, mesh = meshed(data / name)
    assert max(distance(part, int(face), node) for face, node in zip(mesh.face, mesh.nodes, strict=True)) < 1e-6
    assert abs(mesh.edge_length / (part.diagonal / 25) - 1) < 0.2
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)


@pytest.mark.parametrize("elements", [25, 60])
@pytest.mark.parametrize("name", STEP)
def test_a_crease_is_within_the_tolerance_of_its_edge_of_every_face_beside(
    data: Path, name: str, elements: int
) -> None:
    part, mesh = meshed(data / name, elements)
    for face, node in zip(mesh.face[mesh.crease].tolist(), mesh.nodes[mesh.crease], strict=True):
        assert edges_at(part, face, node)
        assert all(found.off <= found.tolerance + 1e-9 for found in beside(part, face, node))


def test_so_is_a_node_on_a_smooth_edge(data: Path) -> None:
    part, mesh = meshed(data / "step_freeform/pythonocc_Ventilator.stp")
    smooth = zip(mesh.face[~mesh.crease].tolist(), mesh.nodes[~mesh.crease], strict=True)
    found = [one for face, node in smooth for one in beside(part, face, node, near=1.0)]
    assert len(found) > 50
    assert all(one.off <= one.tolerance + 1e-9 for one in found)


@pytest.mark.slow
@pytest.mark.parametrize("name", IGES)
def test_an_iges_file_gives_an_inspection_mesh(data: Path, name: str) -> None:
    part, mesh = meshed(data / "step_freeform" / name)
    assert max(distance(part, int(face), node) for face, node in zip(mesh.face, mesh.nodes, strict=True)) < 1e-6
    assert len(mesh) > 200


@pytest.mark.parametrize(("name", "units"), MESHES)
def test_a_mesh_file_gives_nodes_on_its_surface(data: Path, name: str, units: str) -> None:
    nominal = load_nominal(data / name, units=units)
    mesh = nominal.mesh
    assert np.abs(nominal.surface.closest(mesh.nodes).distance).max() < 1e-9 * nominal.diagonal
    assert abs(mesh.edge_length / nominal.diagonal * 60 - 1) < 0.2


def test_a_step_file_in_inches_and_its_mesh_in_inches_are_one_part(data: Path) -> None:
    exact = load_nominal(data / "step_freeform" / "trimesh_featuretype.STEP", element_size=8.0)
    mesh = load_nominal(data / "step_freeform" / "trimesh_featuretype.STL", units="inch", element_size=8.0)
    np.testing.assert_allclose(exact.surface.bounds, mesh.surface.bounds, atol=0.01)
    assert exact.diagonal == pytest.approx(146.1, abs=0.2)
