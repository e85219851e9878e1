"""Stage 1 on mesh files: repair with a word for each thing done, the outside, and the inspection mesh on the input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.repair import repaired
from inspect3d.nominal.sharp import sides_of
from inspect3d.nominal.surface import Surface
from inspect3d.outcome import InputError


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def cube(size: float = 1.0, centre: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    body = trimesh.creation.box((size, size, size))
    return np.asarray(body.vertices) + centre, np.asarray(body.faces, dtype=np.int64)


def together(*bodies: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in bodies])
    return (
        np.concatenate([vertices for vertices, _ in bodies]),
        np.concatenate([triangles + start for (_, triangles), start in zip(bodies, starts, strict=False)]),
    )


def inside_out(body: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return body[0], body[1][:, ::-1]


def test_a_clean_mesh_is_left_as_it_is_without_a_word() -> None:
    vertices, triangles = cube()
    found = repaired("cube.stl", vertices, triangles)
    np.testing.assert_array_equal(found.vertices[found.triangles], vertices[triangles])
    assert found.remarks == ()


@pytest.mark.parametrize("seed", range(5))
def test_any_winding_of_a_closed_body_ends_outside_out(seed: int) -> None:
    vertices, triangles = cube(2.0, 5.0)
    turned = np.random.default_rng(seed).random(len(triangles)) < 0.5
    found = repaired("cube.stl", vertices, np.where(turned[:, None], triangles[:, ::-1], triangles))
    assert volume(found.vertices, found.triangles) == pytest.approx(8.0)


@pytest.mark.parametrize("wrong", [False, True])
def test_a_void_stays_a_void_even_if_the_whole_file_is_inside_out(wrong: bool) -> None:
    shell = together(cube(4.0), inside_out(cube(2.0)))
    found = repaired("shell.stl", *(inside_out(shell) if wrong else shell))
    assert volume(found.vertices, found.triangles) == pytest.approx(64.0 - 8.0)
    assert bool(found.remarks) == wrong


def test_bodies_side_by_side_are_each_turned_by_themselves() -> None:
    found = repaired("two.stl", *together(cube(), inside_out(cube(1.0, 3.0))))
    assert volume(found.vertices, found.triangles) == pytest.approx(2.0)
    assert found.remarks == ("12 triangles of closed bodies were turned outside out.",)


def test_an_open_mesh_keeps_the_winding_of_its_greater_part_and_flip_turns_it() -> None:
    vertices, triangles = cube()
    lid_off = triangles[:-1].copy()
    lid_off[0] = lid_off[0, ::-1]
    kept = repaired("open.stl", vertices, lid_off)
    turned = repaired("open.stl", vertices, lid_off, flip=True)
    np.testing.assert_array_equal(np.sort(kept.triangles[1]), np.sort(triangles[1]))
    assert volume(kept.vertices, kept.triangles) == pytest.approx(-volume(turned.vertices, turned.triangles))
    assert volume(kept.vertices, kept.triangles) > 0
    assert any("1 triangle was turned" in remark for remark in kept.remarks)
    assert any("3 rim edges" in remark for remark in kept.remarks)


def test_loose_degenerate_and_duplicate_triangles_are_mended_and_counted() -> None:
    vertices, triangles = cube()
    loose, corners = vertices[triangles].reshape(-1, 3), np.arange(36).reshape(-1, 3)
    spoilt = np.concatenate([corners, corners[:2], [[0, 0, 1], [2, 3, 2]]])
    found = repaired("cube.stl", loose, spoilt)
    assert len(found.vertices) == 8
    assert Surface(found.vertices, found.triangles).closed
    assert found.remarks == ("2 degenerate triangles were dropped.", "2 duplicate triangles were dropped.")


def test_a_one_sided_strip_is_allowed_and_named() -> None:
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    half = np.stack([np.cos(angle) * np.cos(angle / 2), np.sin(angle) * np.cos(angle / 2), np.sin(angle / 2)], axis=1)
    ring = 5 * np.stack([np.cos(angle), np.sin(angle), np.zeros(24)], axis=1)
    vertices = np.concatenate([ring - half, ring + half])
    a, b = np.arange(24), np.arange(24) + 24
    next_a, next_b = np.append(a[1:], b[0]), np.append(b[1:], a[0])
    triangles = np.concatenate([np.stack([a, next_a, b], axis=1), np.stack([b, next_a, next_b], axis=1)])
    assert any("Möbius" in remark for remark in repaired("strip.stl", vertices, triangles).remarks)


def test_three_walls_at_one_edge_are_allowed_and_named() -> None:
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], dtype=float)
    found = repaired("fins.stl", vertices, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]))
    assert any("more than two triangles" in remark for remark in found.remarks)


@pytest.mark.parametrize(
    ("vertices", "triangles", "says"),
    [
        (np.zeros((3, 3)), np.empty((0, 3), dtype=np.int64), "no triangles"),
        (np.array([[0, 0, np.nan], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]), "not finite"),
        (np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2]], dtype=float), np.array([[0, 1, 2]]), "degenerate"),
    ],
)
def test_what_cannot_be_mended_is_refused_by_name(vertices: np.ndarray, triangles: np.ndarray, says: str) -> None:
    with pytest.raises(InputError, match=says) as refusal:
        repaired("bad.stl", vertices, triangles)
    assert "bad.stl" in str(refusal.value)


def test_nodes_of_a_mesh_model_lie_on_it_and_its_edges_stay_sharp(tmp_path: Path) -> None:
    trimesh.creation.box((30.0, 20.0, 10.0)).export(tmp_path / "block.stl")
    mesh = load_nominal(tmp_path / "block.stl", element_size=2.0).mesh
    on_faces = np.isclose(np.abs(mesh.nodes), (15.0, 10.0, 5.0), atol=1e-9).sum(axis=1)
    assert (on_faces >= 1).all()
    np.testing.assert_array_equal(mesh.crease, on_faces >= 2)
    assert (on_faces == 3).sum() == 8
    assert abs(mesh.edge_length / 2.0 - 1) < 0.2
    assert (mesh.face == -1).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)


def test_a_thin_plate_keeps_its_two_sides_apart(tmp_path: Path) -> None:
    trimesh.creation.box((40.0, 30.0, 0.1)).export(tmp_path / "plate.ply")
    mesh = load_nominal(tmp_path / "plate.ply", element_size=3.0).mesh
    flat = ~mesh.crease
    np.testing.assert_allclose(np.abs(mesh.nodes[flat, 2]), 0.05, atol=1e-9)
    np.testing.assert_array_equal(np.sign(mesh.normals[flat, 2]), np.sign(mesh.nodes[flat, 2]))
    assert (sides_of(mesh.nodes, mesh.triangles).uses == 2).all()


@pytest.mark.parametrize(("units", "factor"), [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("um", 0.001), ("inch", 25.4)])
def test_units_scale_a_mesh_to_millimetres(tmp_path: Path, units: str, factor: float) -> None:
    trimesh.creation.box((3.0, 2.0, 1.0)).export(tmp_path / "block.stl")
    nominal = load_nominal(tmp_path / "block.stl", units=units)
    np.testing.assert_allclose(np.ptp(nominal.surface.vertices, axis=0), np.array([3.0, 2.0, 1.0]) * factor)
    assert nominal.diagonal == pytest.approx(np.sqrt(14) * factor)


@pytest.mark.parametrize("size", [1e-3, 1e-9, 1e-200])
def test_elements_too_small_for_any_computer_are_refused_before_they_are_made(tmp_path: Path, size: float) -> None:
    trimesh.creation.box((3.0, 2.0, 1.0)).export(tmp_path / "block.stl")
    with pytest.raises(InputError, match=r"5 million nodes: this part takes 0\.0023 mm or more"):
        load_nominal(tmp_path / "block.stl", element_size=size)


def test_wrong_arguments_are_refused_in_a_sentence(tmp_path: Path) -> None:
    trimesh.creation.box((3.0, 2.0, 1.0)).export(tmp_path / "block.stl")
    for settings in ({"units": "furlong"}, {"element_size": -1.0}, {"element_size": float("nan")}):
        with pytest.raises(InputError):
            load_nominal(tmp_path / "block.stl", **settings)
    for path in (tmp_path, tmp_path / "nothing.stl", tmp_path / "nothing.step"):
        with pytest.raises(InputError):
            load_nominal(path)
