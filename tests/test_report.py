"""What a run leaves behind: files that keep the contract, and say what was measured and nothing else."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import pyvista
import trimesh

from inspect3d.compare.tolerances import tolerances
from inspect3d.compare.verdict import verdict
from inspect3d.deviate.deviation import Deviation
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.surface import Surface
from inspect3d.outcome import InputError, Status
from inspect3d.pose import Pose
from inspect3d.recipe import Label, Recipe
from inspect3d.record import InputFile, MeasuredPart, Record
from inspect3d.register.alignment import Alignment, Candidate, FreeMotion
from inspect3d.report.bands import bands
from inspect3d.report.finished import open_results
from inspect3d.report.reading import readings
from inspect3d.report.results import as_json, results, verdict_shares
from inspect3d.report.screenshot import screenshot
from inspect3d.report.verdict_words import verdict_words
from inspect3d.report.write import write_report

CHECK = Path(__file__).parents[1].parent / "shared" / "tools" / "check_contract.py"
NASTY = 'Ring <script>alert("x")</script> & Größe 支架 $a$'
MOMENT = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)


def box_mesh(edge=2.5):
    """Return a box of 30 x 20 x 10 mm with nodes `edge` mm apart."""
    vertices, faces = trimesh.remesh.subdivide_to_size(*_box(), max_edge=edge)
    body = trimesh.Trimesh(vertices, faces)
    sharp = body.face_adjacency_edges[body.face_adjacency_angles > np.radians(30)].ravel()
    crease = np.isin(np.arange(len(body.vertices)), sharp)
    return InspectionMesh(body.vertices, body.faces, body.vertex_normals, crease, np.full(len(body.vertices), -1))


def _box():
    body = trimesh.creation.box((30.0, 20.0, 10.0))
    return body.vertices, body.faces


def recipe(**changes):
    part = {"name": NASTY, "cad": "ring.step", "tolerance": [-0.1, 0.1]} | changes.pop("part", {})
    names = ("laser", "wrong", "peg 2% ß")
    measurements = [{"name": name, "method": "scan", "files": ["a.ply"]} for name in names]
    labels = [{"name": "P1", "point": [0, 0, 5]}, {"name": "below", "point": [0, 0, -5]}]
    return Recipe.model_validate(
        {"schema": 1, "part": part, "measurements": measurements, "report": {"labels": labels} | changes}
    )


def a_record(value=0.05, sigma=0.01, **changes):
    """Return a record with a map of the upper half (constant deviation), a failed and an ambiguous measurement."""
    mesh, table = box_mesh(), recipe(**changes)
    observed = ~mesh.crease & (mesh.nodes[:, 2] > -4.9)
    deviation = Deviation(np.where(observed, value, np.nan), np.where(observed, sigma, np.nan), observed)
    limits = tolerances(table.part, mesh)
    pose = Pose(trimesh.transformations.euler_matrix(0.3, 0.2, 0.1)[:3, :3], np.array([1.0, 2.0, 3.0]))
    candidate = Candidate(pose, 1.0, 0.02)
    covariance = np.diag([1e-10, 1e-10, 0.0, 1e-6, 1e-6, 4e-6])
    free = (FreeMotion("turn about the axis along (0, 0, 1)", np.array([0, 0, 1.0, 0, 0, 0])),)
    aligned = Alignment(pose, 1.0, 0.02, covariance, np.zeros(3), np.ones(900, bool), Status.FREE_MOTIONS, free)
    points = mesh.nodes[observed]
    laser = MeasuredPart(
        "laser", "scan", "Scan(units='mm')", Status.FREE_MOTIONS, alignments=(aligned,), deviation=deviation,
        verdict=None if limits is None else verdict(deviation, limits, 0.95), points_cad=points,
        point_deviation=np.where(np.arange(len(points)) % 7 == 0, np.nan, value), noise=0.02,
        seconds={"registering": 1.5}, remarks=("The noise was estimated.",),
    )  # fmt: skip
    wrong = MeasuredPart("wrong", "scan", "Scan()", Status.FAILED, reason="It does not <fit>.", candidates=(candidate,))
    peg = MeasuredPart("peg 2% ß", "scan", "Scan()", Status.AMBIGUOUS, reason="Two poses.", candidates=(candidate,) * 2)
    nominal = Nominal(NASTY, Surface(mesh.nodes, mesh.triangles), mesh, 0.003)
    files = (InputFile("ring.step", "ab" * 32),)
    return Record(table, nominal, (laser, wrong, peg), files, {"inspect3d": "0.1.0"}, ("No PDF <yet>.",))


@pytest.fixture(scope="module")
def record():
    return a_record(formats=["html", "pdf"])


@pytest.fixture(scope="module")
def out(record, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    write_report(record, folder, moment=MOMENT)
    return folder


@pytest.mark.skipif(not CHECK.exists(), reason="the contract checker is not beside the repository")
def test_the_folder_keeps_the_contract(out):
    check = subprocess.run([sys.executable, CHECK, out], capture_output=True, text=True, check=False)
    assert check.returncode == 0, check.stdout


def test_the_map_has_the_nodes_and_values_of_the_record_bit_for_bit(record, out):
    polydata = pyvista.read(out / "laser.vtp")
    mesh, deviation = record.nominal.mesh, record.parts[0].deviation
    assert polydata.points.dtype == np.float64
    assert np.array_equal(polydata.points, mesh.nodes)
    assert np.array_equal(polydata.regular_faces, mesh.triangles)
    assert np.array_equal(polydata["deviation"], deviation.value, equal_nan=True)
    assert np.array_equal(polydata["sigma"], deviation.sigma, equal_nan=True)
    kinds = {name: polydata[name].dtype for name in ("observed", "crease", "verdict")}
    assert kinds == {"observed": np.uint8, "crease": np.uint8, "verdict": np.int8}
    assert polydata["Normals"] == pytest.approx(mesh.normals)


def test_the_cloud_keeps_the_order_of_the_files_and_marks_points_without_deviation(record, out):
    polydata = pyvista.read(out / "laser_points.vtp")
    assert np.array_equal(polydata.points, record.parts[0].points_cad)
    assert np.array_equal(polydata["deviation"], record.parts[0].point_deviation, equal_nan=True)


def test_measurements_without_an_answer_leave_their_reason_and_candidates_and_no_map(out):
    values = json.loads((out / "results.json").read_text("utf-8"))["measurements"]
    assert values["wrong"]["status"] == "failed"
    assert values["wrong"]["reason"] == "It does not <fit>."
    assert len(values["peg 2% ß"]["alignment"]["candidates"]) == 2
    assert values["wrong"]["deviation"] is None
    assert values["wrong"]["alignment"]["matrix"] is None
    assert sorted(path.name for path in out.glob("*.vtp")) == ["laser.vtp", "laser_points.vtp"]


def test_results_are_the_same_text_for_the_same_record(record, out):
    assert as_json(results(a_record(formats=["html", "pdf"]))) == (out / "results.json").read_text("utf-8")


def test_json_holds_null_for_what_is_not_a_number():
    assert json.loads(as_json({"a": np.nan, "b": [np.inf, 1.0], "c": np.float64(2), "d": {}})) == {
        "a": None, "b": [None, 1.0], "c": 2.0, "d": {},
    }  # fmt: skip


def test_a_constant_deviation_has_that_mean_and_no_spread(record):
    figures = results(record)["measurements"]["laser"]["deviation"]
    assert (figures["mean"], figures["min"], figures["p95"]) == pytest.approx((0.05,) * 3)
    assert figures["std"] == pytest.approx(0.0, abs=1e-12)
    assert figures["observed"] == int(record.parts[0].deviation.observed.sum())


def test_each_file_aligned_by_itself_is_listed(record):
    two = replace(record.parts[0], alignments=record.parts[0].alignments * 2)
    alignment = results(replace(record, parts=(two,)))["measurements"]["laser"]["alignment"]
    assert len(alignment["files"]) == 2
    assert alignment["matrix"] == alignment["files"][0]["matrix"]


def test_verdict_shares_are_those_of_the_area_with_a_tolerance_and_sum_to_one(record):
    shares = verdict_shares(record, record.parts[0])
    mesh, observed = record.nominal.mesh, record.parts[0].deviation.observed
    assert shares["conform"] == pytest.approx(mesh.areas[observed].sum() / mesh.areas.sum())
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-12)
    assert verdict_shares(a_record(part={"tolerance": None}), a_record(part={"tolerance": None}).parts[0]) is None


@pytest.mark.parametrize(
    ("value", "kind", "band"),
    [
        (0.05, "undecided", 3),
        (0.3, "nonconform", 5),
        (-0.3, "nonconform", 1),
        (0.1, "undecided", 4),
        (-0.1, "undecided", 2),
    ],
)
def test_the_verdict_names_the_side_and_never_calls_conform_what_was_not_measured(value, kind, band):
    record = a_record(value)
    part = record.parts[0]
    assert verdict_words(record, part).kind == kind
    found = bands(record.recipe.part, record.nominal.mesh, part)
    assert set(found[part.deviation.observed]) == {band}
    assert set(found[~part.deviation.observed]) == {0}


def test_a_part_measured_all_over_and_within_its_tolerance_conforms(record):
    mesh = record.nominal.mesh
    observed = ~mesh.crease
    deviation = Deviation(np.where(observed, 0.0, np.nan), np.where(observed, 0.01, np.nan), observed)
    part = replace(record.parts[0], deviation=deviation, verdict=observed.astype(int))
    assert verdict_words(record, part).kind == "conform"


def test_the_page_shows_every_name_as_text_and_asks_for_no_network(out):
    html = (out / "report.html").read_text("utf-8")
    assert "<script>alert" not in html
    assert "&lt;script&gt;alert(&#34;x&#34;)&lt;/script&gt; &amp; Größe 支架" in html
    assert "It does not &lt;fit&gt;." in html
    assert "No PDF &lt;yet&gt;." in html
    assert "2026-03-01 12:00 UTC" in html
    without_data = re.sub(r'"data:[^"]*"', '"data:"', html)
    assert not re.search(r'https?://|@import|url\(|(href|src)="(?!data:|#)', without_data)
    assert "default-src 'none'" in html


def test_the_data_of_the_3d_view_cannot_end_their_script_element(out):
    html = (out / "report.html").read_text("utf-8")
    data = re.search(r'id="viewer-data">(.*?)</script>', html, re.DOTALL).group(1)
    assert "<" not in data
    assert [each["name"] for each in json.loads(data)["maps"]] == ["laser"]


def test_every_picture_shows_the_measured_side(out):
    names = {path.name for path in (out / "pictures").glob("*.png")}
    assert {"part.png", "laser_deviation_1.png", "laser_tolerance_1.png", "laser_sigma_1.png"} <= names
    assert "laser_histogram.png" in names
    html = (out / "report.html").read_text("utf-8")
    assert not re.search(r"Deviation from the CAD model, seen from −z", html)


def test_a_named_point_is_not_read_on_the_other_side_of_a_thin_wall(record):
    mesh, part = record.nominal.mesh, record.parts[0]
    thin = InspectionMesh(mesh.nodes * [1, 1, 0.1], mesh.triangles, mesh.normals, mesh.crease, mesh.face)
    labels = (Label(name="top", point=(0, 0, 0.5)), Label(name="below", point=(0, 0, -0.5)))
    top, below = readings(thin, part, labels)
    assert (top.value, top.verdict) == (0.05, 1)
    assert below.node is None


def test_a_record_without_any_map_still_makes_a_report(record, tmp_path):
    write_report(replace(record, parts=record.parts[1:]), tmp_path, moment=MOMENT)
    assert (tmp_path / "pictures" / "part.png").exists()
    assert "viewer-data" not in (tmp_path / "report.html").read_text("utf-8")


def test_a_map_without_any_observed_node_makes_a_report_without_figures(tmp_path):
    record = a_record()
    none = np.zeros(len(record.nominal.mesh), bool)
    nothing = Deviation(np.full(len(none), np.nan), np.full(len(none), np.nan), none)
    part = replace(record.parts[0], deviation=nothing, verdict=np.zeros(len(none), int), points_cad=None)
    write_report(replace(record, parts=(part,)), tmp_path, moment=MOMENT)
    values = json.loads((tmp_path / "results.json").read_text("utf-8"))["measurements"]["laser"]
    assert values["deviation"]["mean"] is None
    assert values["verdict"]["unmeasured"] == 1.0


def test_a_screenshot_has_the_asked_size_and_the_same_bytes_each_time(out, tmp_path):
    for file in ("a.png", "b.png"):
        screenshot(out, tmp_path / file, field="sigma", view=(30, 20), size=(640, 400))
    assert pyvista.read(tmp_path / "a.png").dimensions[:2] == (640, 400)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    ("wrong", "hint"),
    [
        ({"name": "lazer"}, "'laser'"),
        ({"name": "wrong"}, "failed"),
        ({"field": "devation"}, "deviation, sigma"),
        ({"view": "north"}, "iso"),
        ({"size": (3, 3)}, "px"),
        ({"limits": (1.0, 0.0)}, "rise"),
    ],
)
def test_a_screenshot_that_cannot_be_made_is_refused_with_what_is_possible(out, tmp_path, wrong, hint):
    with pytest.raises(InputError, match=hint):
        screenshot(out, tmp_path / "a.png", **wrong)


def test_a_screenshot_of_something_else_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no inspection"):
        screenshot(tmp_path, tmp_path / "a.png")
    with pytest.raises(InputError, match=r"\.png"):
        screenshot(tmp_path, tmp_path / "a.jpg")


@pytest.mark.parametrize(
    "change",
    [
        lambda values: values.clear(),
        lambda values: values.pop("inputs"),
        lambda values: values["part"].pop("bounds"),
        lambda values: values.update(measurements=[]),
        lambda values: values["measurements"].update({"../b": next(iter(values["measurements"].values()))}),
        lambda values: next(iter(values["measurements"].values())).update(status="fine"),
    ],
)
def test_results_of_another_version_or_program_are_refused(out, tmp_path, change):
    values = json.loads((out / "results.json").read_text("utf-8"))
    change(values)
    (tmp_path / "results.json").write_text(json.dumps(values), "utf-8")
    with pytest.raises(InputError, match="of another version of inspect3d: run it again"):
        open_results(tmp_path)
