"""The alignment is a choice: best fit, datums, reference points, locked motions, and what each makes of the map."""

import numpy as np
import pytest

from inspect3d.alignment_choice import choices, fitted_to, sensitivity_of
from inspect3d.deviate.deviate import Deviate
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.map_covariance import Independent
from inspect3d.deviate.nodes import DeviateNodes
from inspect3d.measure import Cloud, NodalMeasurement
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.surface import Surface
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from inspect3d.recipe_alignment import Start
from inspect3d.register.alignment import Alignment
from inspect3d.register.fit import Fit, ReferencePoint
from inspect3d.register.mobility import jacobian
from inspect3d.register.register import Register

FLOOR, WALL_X, WALL_Y, HOLE = range(4)
PLANES = tuple({"name": name, "faces": (face,)} for name, face in (("A", FLOOR), ("B", WALL_X), ("C", WALL_Y)))
MOTION = np.array([4e-4, -3e-4, 5e-4, 0.02, -0.03, 0.025])


def plate(u, v, origin, count):
    """Nodes and triangles of a plate spanned by u and v."""
    s, t = (a.ravel() for a in np.meshgrid(*[np.linspace(0, 1, n) for n in count], indexing="ij"))
    nodes = np.array(origin) + s[:, None] * np.array(u) + t[:, None] * np.array(v)
    i, n = (np.arange(count[0] - 1)[:, None] * count[1] + np.arange(count[1] - 1)).ravel(), count[1]
    return nodes, np.concatenate([np.stack([i, i + n, i + n + 1], 1), np.stack([i, i + n + 1, i + 1], 1)])


def corner():
    """Three plates at right angles that do not touch, and half a bore along z; faces numbered in that order."""
    plates = [
        plate((60, 0, 0), (0, 45, 0), (2, 2, 0), (21, 16)),
        plate((0, 45, 0), (0, 0, 30), (0, 2, 2), (16, 11)),
        plate((0, 0, 30), (60, 0, 0), (2, 0, 2), (11, 21)),
    ]
    angle, z = (a.ravel() for a in np.meshgrid(np.linspace(0, np.pi, 15), np.linspace(-20, -2, 7), indexing="ij"))
    bore = np.stack([30 + 8 * np.cos(angle), 25 + 8 * np.sin(angle), z], axis=1)
    plates.append((bore, plate((1, 0, 0), (0, 1, 0), (0, 0, 0), (15, 7))[1][:, ::-1]))
    along = [np.tile(axis, (len(nodes), 1)) for axis, (nodes, _) in zip(np.eye(3)[[2, 0, 1]], plates, strict=False)]
    along.append(-np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))
    starts = np.cumsum([0] + [len(nodes) for nodes, _ in plates])
    nodes = np.concatenate([nodes for nodes, _ in plates])
    triangles = np.concatenate([corners + start for (_, corners), start in zip(plates, starts, strict=False)])
    face = np.repeat(np.arange(4), [len(each) for each, _ in plates])
    return InspectionMesh(nodes, triangles, np.concatenate(along), np.zeros(len(nodes), bool), face)


MESH = corner()
EVERY = np.arange(len(MESH))


def on(face):
    """Tell which nodes a face has."""
    return MESH.face == face


def tilted(angle=1e-3):
    """A part whose wall at x = 0 leans by `angle`, and noise."""
    return np.where(on(WALL_X), angle * (MESH.nodes[:, 2] - 10), 0.0)


def moved(values, motion):
    """Return a map after a small motion about the origin."""
    return values + jacobian(MESH.nodes, MESH.normals, np.zeros(3)) @ motion


def test_three_planes_fix_three_two_and_one_motions():
    gauge = fitted_to(Start(fit="datum", datum=PLANES), MESH)(MESH, EVERY, moved(tilted(), MOTION))
    assert gauge.determined[:3] == [3, 2, 1]
    assert not len(gauge.free)


def test_plane_axis_and_point_fix_three_two_and_one_motions():
    datums = (*PLANES[:1], {"name": "axis", "faces": (HOLE,)}, {"name": "point", "box": ((-1, 20, 10), (1, 26, 16))})
    gauge = fitted_to(Start(fit="datum", datum=datums), MESH)(MESH, EVERY, tilted())
    assert gauge.determined[:3] == [3, 2, 1]


def test_the_first_datum_is_fitted_whatever_the_others_say():
    gauge = fitted_to(Start(fit="datum", datum=PLANES), MESH)(MESH, EVERY, moved(tilted(5e-3), MOTION))
    left = gauge(moved(tilted(5e-3), MOTION))
    assert np.abs(left[on(FLOOR)]).max() < 1e-9
    assert abs(left[on(WALL_X)].mean()) < 1e-9
    assert abs(left[on(WALL_Y)].mean()) < 1e-9
    assert np.ptp(left[on(WALL_X)]) > 0.1


def test_datum_alignment_and_best_fit_of_a_tilted_face_differ_by_a_rigid_motion_that_the_sensitivity_shows():
    random = np.random.default_rng(0)
    value = moved(tilted() + random.normal(0, 0.002, len(MESH)), MOTION)
    nominal = Nominal("corner", Surface(MESH.nodes, MESH.triangles), MESH)
    variances = np.full(len(MESH), 0.002**2)
    measured = NodalMeasurement(EVERY, value, np.ones(len(MESH), bool), Independent(variances), Pose.identity())
    start = Start(fit="datum", datum=PLANES)
    best = DeviateNodes()(measured, nominal, np.ones(len(MESH), bool))
    datum = DeviateNodes(fit=fitted_to(start, MESH))(measured, nominal, np.ones(len(MESH), bool))
    difference = best.deviation.value - datum.deviation.value
    rows = jacobian(MESH.nodes, MESH.normals, np.zeros(3))
    motion = np.linalg.lstsq(rows, difference, rcond=None)[0]
    np.testing.assert_allclose(rows @ motion, difference, atol=1e-12)
    assert np.abs(difference).max() > 0.003
    shown = sensitivity_of(start, datum.deviation, datum.alignment, MESH, scale_known=True)
    assert shown.chosen == "datums A, B, C in this order"
    (other,) = shown.others
    assert "best fit" in other.words
    np.testing.assert_allclose(other.shift, difference, atol=1e-4)
    np.testing.assert_allclose(shown.spread, np.abs(other.shift), atol=1e-12)


def test_the_covariance_in_the_datums_is_that_of_the_maps_they_make():
    random, sigma = np.random.default_rng(1), 0.003
    nominal = Nominal("corner", Surface(MESH.nodes, MESH.triangles), MESH)
    boxes = (((2, 2, -1), (20, 20, 1)), ((-1, 2, 2), (1, 20, 20)), ((2, -1, 2), (20, 1, 20)))
    fit = fitted_to(Start(fit="datum", datum=tuple({"box": box} for box in boxes)), MESH)
    z, variances = [], np.full(len(MESH), sigma**2)
    for _ in range(25):
        value = random.normal(0, sigma, len(MESH))
        measured = NodalMeasurement(EVERY, value, np.ones(len(MESH), bool), Independent(variances), Pose.identity())
        found = DeviateNodes(fit=fit)(measured, nominal, np.ones(len(MESH), bool)).deviation
        z.append(found.value / found.sigma)
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.08)
    assert found.sigma.max() > 1.5 * sigma  # far from the datums the map carries their uncertainty


def test_a_cloud_is_aligned_by_its_datums():
    random = np.random.default_rng(2)
    parts = []
    for face, (low, high, axis) in enumerate([((2, 2), (62, 47), 2), ((2, 2), (47, 32), 0), ((2, 2), (32, 62), 1)]):
        flat = random.uniform(low, high, (15_000, 2))
        points = np.insert(flat if axis != 1 else flat[:, ::-1], axis, random.normal(0, 0.005, 15_000), axis=1)
        if face == WALL_X:
            points[:, 0] += 2e-3 * (points[:, 2] - 10)
        parts.append(points)
    cloud = Cloud("corner", Pose.small(MOTION, np.zeros(3))(np.concatenate(parts)))
    flat = InspectionMesh(
        MESH.nodes[~on(HOLE)],
        MESH.triangles[~on(HOLE)[MESH.triangles].any(axis=1)],
        MESH.normals[~on(HOLE)],
        MESH.crease[~on(HOLE)],
        MESH.face[~on(HOLE)],
    )
    nominal = Nominal("corner", Surface(flat.nodes, flat.triangles), flat)
    alignment = Register(nominal, Pose.identity())(cloud)
    fit = fitted_to(Start(fit="datum", datum=PLANES), flat)
    found = Deviate(fit=fit)((cloud,), (alignment,), nominal, np.ones(len(flat), bool))
    value, seen = found.deviation.value, found.deviation.observed
    floor, wall = (seen & (flat.face == face) for face in (FLOOR, WALL_X))
    assert abs(np.polyfit(flat.nodes[floor, 0], value[floor], 1)[0]) < 3e-5
    assert np.polyfit(flat.nodes[wall, 2], value[wall], 1)[0] == pytest.approx(2e-3, abs=1e-4)


def test_dirt_on_a_datum_does_not_tilt_the_part():
    dirt = np.where(on(FLOOR) & (MESH.nodes[:, 0] > 50) & (MESH.nodes[:, 1] > 35), 0.5, 0.0)
    noise = np.random.default_rng(3).normal(0, 0.002, len(MESH))
    gauge = fitted_to(Start(fit="datum", datum=PLANES), MESH)(MESH, EVERY, dirt + noise)
    assert np.abs(gauge(dirt + noise) - dirt).max() < 0.01


def test_reference_points_have_no_deviation_left():
    places = [((5, 5, 0), "z"), ((55, 5, 0), "z"), ((30, 40, 0), "z"), ((0, 10, 10), "x"), ((0, 40, 10), "x")]
    places.append(((30, 0, 15), "y"))
    axes = dict(zip("xyz", np.eye(3), strict=True))
    points = tuple({"point": place, "direction": tuple(axes[axis])} for place, axis in places)
    value = moved(tilted(), MOTION)
    gauge = fitted_to(Start(fit="rps", rps=points), MESH)(MESH, EVERY, value)
    assert gauge.determined[0] == 6
    level = gauge.levels[0]
    np.testing.assert_allclose(level.readings @ gauge(value), 0, atol=1e-12)
    readings = level.readings @ MESH.nodes
    assert np.abs(readings - [place for place, _ in places]).max() < MESH.edge_length


def test_locked_motions_are_not_made():
    values = moved(tilted(), MOTION)
    for locked in (("tz",), ("rx", "ry"), ("tx", "ty", "rz")):
        gauge = Fit(locked=locked)(MESH, EVERY, values)
        motion = gauge.motion(values)
        shift = Pose.small(motion, gauge.origin)(np.zeros((1, 3)))[0]
        made = dict(zip(("rx", "ry", "rz", "tx", "ty", "tz"), [*motion[:3], *shift], strict=True))
        for name, size in made.items():
            assert (abs(size) < 1e-5) == (name in locked), (locked, name, size)


def test_what_the_datums_leave_open_is_best_fitted():
    value = moved(np.zeros(len(MESH)), MOTION)
    gauge = fitted_to(Start(fit="datum", datum=PLANES[:1]), MESH)(MESH, EVERY, value)
    assert gauge.determined == [3, 3]
    assert np.abs(gauge(value)).max() < 1e-9


def test_a_datum_that_adds_nothing_or_was_not_measured_is_refused():
    twice = ({"name": "A", "faces": (FLOOR,)}, {"name": "B", "faces": (FLOOR,)})
    with pytest.raises(MeasurementError, match="Datum B fixes no motion"):
        fitted_to(Start(fit="datum", datum=twice), MESH)(MESH, EVERY, tilted())
    with pytest.raises(MeasurementError, match="Datum A was observed at 0 nodes"):
        fitted_to(Start(fit="datum", datum=PLANES), MESH)(MESH, np.flatnonzero(~on(FLOOR)), tilted()[~on(FLOOR)])
    nowhere = Fit("rps", points=(ReferencePoint((200.0, 0.0, 0.0), (0.0, 0.0, 1.0)),))
    with pytest.raises(MeasurementError, match=r"Reference point 1 at \(200, 0, 0\) mm was not measured"):
        nowhere(MESH, EVERY, tilted())


def test_the_sensitivity_shows_every_choice_the_recipe_tells_and_the_pose_itself():
    marks = tuple(
        {"cad": tuple(p), "measured": tuple(q)}
        for p, q in zip(MESH.nodes[::90], Pose.small(MOTION, np.zeros(3))(MESH.nodes[::90]), strict=True)
    )
    start = Start(landmarks=marks, datum=PLANES)
    covariance = np.diag([0, 0, 0, 0, 0, 0.01**2])
    placed = Alignment(Pose.identity(), 1.0, 0.01, covariance, np.zeros(3), np.ones(4, bool))
    value = tilted()
    deviation = Deviation(value, np.full(len(MESH), 0.01), np.ones(len(MESH), bool))
    shown = sensitivity_of(start, deviation, placed, MESH, scale_known=True)
    assert [other.words for other in shown.others] == ["datums A, B, C in this order", f"{len(marks)} landmarks"]
    back = Pose.small(MOTION, np.zeros(3)).inverse()
    expected = ((back(MESH.nodes) - MESH.nodes) * MESH.normals).sum(axis=1)
    np.testing.assert_allclose(shown.others[1].shift, expected, atol=1e-4)
    np.testing.assert_allclose(shown.within, 0.01 * np.abs(MESH.normals[:, 2]), atol=1e-12)
    assert set(choices(start, MESH)) == {"best", "datum"}


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"fit": "datum"}, "datum = "),
        ({"fit": "rps"}, "rps = "),
        ({"fit": "landmarks"}, "3 landmarks"),
        ({"locked": ("tz",)}, "identity"),
        ({"start": "identity", "refine": False, "locked": ("tz",)}, "refine = false"),
        ({"fit": "datum", "datum": ({"faces": (1,), "tolerance": (-1.0, 1.0)},)}, "no tolerance"),
        ({"fit": "rps", "rps": ({"point": (0.0, 0.0, 0.0), "direction": (0.0, 0.0, 0.0)},)}, "not zero"),
    ],
)
def test_an_alignment_that_cannot_be_is_refused(table, words):
    with pytest.raises(ValueError, match=words):
        Start(**table)
