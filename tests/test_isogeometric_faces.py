"""Faces of a B-rep as NURBS: exact, and what their control points do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from inspect3d.nominal.nurbs import Nurbs
from inspect3d.nominal.nurbs_face import nurbs_of
from inspect3d.nominal.step_iges import read_brep
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
