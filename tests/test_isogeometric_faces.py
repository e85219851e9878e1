"""Faces of a B-rep as NURBS: exact, and what their control points do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nurbs import Nurbs
from inspect3d.nominal.nurbs_face import nurbs_of
from inspect3d.nominal.step_iges import read_brep
from inspect3d.outcome import MeasurementError
from inspect3d.registry import build
from inspect3d.virtual.bracket import bracket
from inspect3d.virtual.freeform import FreeformSizes, freeform, freeform_patch

DATA = Path(__file__).parents[2] / "shared" / "data" / "step_freeform"
FEW = 40  # faces of a file that are looked at; benchmarks/isogeometric.py looks at all


def sheet(poles=(17, 4), degrees=(8, 3)):
    """Return a sheet as this package and as the virtual rig evaluate it."""
    patch = freeform_patch(FreeformSizes(poles=poles, degrees=degrees))
    return Nurbs(patch.poles[..., :3], patch.poles[..., 3], patch.knots_u, patch.knots_v), patch


def places(count=200, seed=0):
    """Return parameters all over the unit square, its corners among them."""
    inner = np.random.default_rng(seed).uniform(0, 1, (count, 2))
    return np.concatenate([inner, [[0, 0], [0, 1], [1, 0], [1, 1.0]]])


def worst_gap(part, number, random, count=12):
    """Return how far points of a face, trimmed or not, lie off its NURBS surface at most, mm."""
    surface, nurbs = part.surfaces[number - 1], nurbs_of(part, number)
    low = [surface.FirstUParameter(), surface.FirstVParameter()]
    high = [surface.LastUParameter(), surface.LastVParameter()]
    points = part.points_at(np.full(count, number), random.uniform(low, high, (count, 2)))
    return float(np.linalg.norm(nurbs.points(nurbs.parameters(points)) - points, axis=1).max())


def test_points_and_normals_are_those_of_another_evaluation():
    nurbs, patch = sheet()
    points, normals = patch(places())
    np.testing.assert_allclose(nurbs.points(places()), points, atol=1e-11)
    np.testing.assert_allclose(nurbs.normals(places()), normals, atol=1e-11)


def test_the_functions_add_up_to_one_and_the_closest_points_are_found():
    nurbs, _ = sheet()
    np.testing.assert_allclose(np.asarray(nurbs.functions(places()).sum(axis=1)), 1.0, atol=1e-13)
    lifted = nurbs.points(places()) + 0.3 * nurbs.normals(places())
    found = nurbs.parameters(lifted)
    np.testing.assert_allclose(nurbs.points(found), nurbs.points(places()), atol=1e-7)


def test_every_face_of_the_bracket_converts_exactly(tmp_path):
    bracket().write_step(tmp_path / "part.step")
    part, random = read_brep(tmp_path / "part.step"), np.random.default_rng(0)
    assert max(worst_gap(part, number, random) for number in range(1, len(part.faces) + 1)) < 1e-9


def test_refining_and_raising_the_degree_leave_surface_and_part_as_they_are(tmp_path):
    freeform().write_step(tmp_path / "part.step")
    part = read_brep(tmp_path / "part.step")
    plain, fine = nurbs_of(part, 1), nurbs_of(part, 1, refine=2, degree=5)
    assert plain.weights.shape == nurbs_of(part, 1).weights.shape == (10, 8)
    assert fine.degrees == (5, 5)
    assert fine.size > 16 * plain.size
    np.testing.assert_allclose(fine.points(places()), plain.points(places()), atol=1e-10)


def test_a_surface_written_as_step_is_read_back(tmp_path):
    from inspect3d.nominal.nurbs_face import write_step

    nurbs, _ = sheet()
    moved = nurbs.moved(np.random.default_rng(0).normal(0, 0.1, (nurbs.size, 3)))
    write_step((moved,), tmp_path / "measured.step")
    again = nurbs_of(read_brep(tmp_path / "measured.step"), 1)
    np.testing.assert_allclose(again.points(places()), moved.points(places()), atol=1e-9)


@pytest.mark.data
@pytest.mark.parametrize("name", ["pythonocc_splinecage.stp", "bladex_lower.iges", "occt_screw.step"])
def test_faces_of_real_files_evaluate_to_the_points_of_their_b_rep(name):
    if not DATA.exists():
        pytest.skip("the real data are not beside the repository")
    part, random = read_brep(DATA / name), np.random.default_rng(0)
    numbers = np.unique(np.linspace(1, len(part.faces), min(FEW, len(part.faces))).astype(int)).tolist()
    assert max(worst_gap(part, number, random) for number in numbers) < 1e-6


@pytest.mark.data
@pytest.mark.parametrize("name", ["bladex_lower.iges", "pythonocc_surf114.igs"])
def test_edges_of_real_files_lie_on_their_faces_within_the_tolerance_of_the_model(name):
    if not DATA.exists():
        pytest.skip("the real data are not beside the repository")
    part = read_brep(DATA / name)
    faces = {number: nurbs_of(part, number) for number in range(1, len(part.faces) + 1)}
    for curve, numbers, tolerance in zip(part.curves, part.edge_faces, part.edge_tolerance, strict=True):
        at = np.linspace(curve.FirstParameter(), curve.LastParameter(), 7)
        points = np.array([curve.Value(t).Coord() for t in at.tolist()])
        for number in numbers:
            feet = faces[number].points(faces[number].parameters(points))
            assert np.linalg.norm(feet - points, axis=1).max() < tolerance


def soup(count=40):
    """Return tetrahedra that hang together nowhere, 3 (4 n) corners (12 n, 3) mm."""
    random = np.random.default_rng(0)
    corners = random.uniform(0, 60, (count, 1, 3)) + random.uniform(-4, 4, (count, 4, 3))
    return corners[:, [0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0]].reshape(-1, 3)


def holed(side=13, pitch=4.0):
    """Return the facets of a flat sheet with a hole in it, as corners (3 m, 3) mm."""
    i, j = np.stack(np.meshgrid(range(side), range(side), indexing="ij"), axis=-1).reshape(-1, 2).T
    kept = np.hypot(i - side / 2, j - side / 2) > 2.5
    low = np.stack([i, j, 0 * i], axis=1)[kept] * pitch
    x, y = pitch * np.eye(3)[:2]
    return np.stack([low, low + x, low + x + y, low, low + x + y, low + y], axis=1).reshape(-1, 3)


@pytest.mark.parametrize("corners", [soup(), holed()], ids=["a soup of tetrahedra", "a sheet with a hole"])
def test_models_that_are_only_meshes_are_refused_in_a_sentence(corners, tmp_path):
    faces = np.arange(len(corners)).reshape(-1, 3)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    (tmp_path / "part.obj").write_text("\n".join(lines), encoding="utf-8")
    nominal = load_nominal(tmp_path / "part.obj", element_size=4.0)
    with pytest.raises(MeasurementError, match="give the STEP or IGES file"):
        build("isogeometric", {})(None, nominal)
