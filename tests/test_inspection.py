"""From a recipe to the results on disk: the contract, the verdicts, the uncertainty, and what goes wrong."""

import json
import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from inspect3d.inspection import check, inspect, run
from inspect3d.nominal.load import load_nominal
from inspect3d.outcome import InputError, Status
from inspect3d.pose import Pose
from inspect3d.progress import Progress
from inspect3d.recipe import load_recipe
from inspect3d.register.gauge import best_fit
from inspect3d.register.symmetry import surface_points
from inspect3d.results_folder import replaced
from inspect3d.virtual.truth import Truth
from tests.notched import recipe_text, write_notched

ROOT = Path(__file__).parents[1]
BRACKET = ROOT / "datasets" / "bracket"
CHECKER = ROOT.parent / "shared" / "tools" / "check_contract.py"


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    """Return a folder with a block, part.step, and a scan of it in its place, scan.txt."""
    folder = tmp_path_factory.mktemp("block")
    write_notched(folder)
    return folder


def recipe(folder, block, part="", measurement="", rest=""):
    """Write a recipe for the block and return its path; the scan starts where it is, unless `measurement` says else."""
    known = f'files = [{json.dumps(str(block / "scan.txt"))}]\nalignment = {{ start = "identity" }}'
    table = f'[[measurements]]\nname = "laser"\nmethod = "scan"\n{measurement or known}\n{rest}'
    (folder / "recipe.toml").write_text(recipe_text(block / "part.step", part, table), encoding="utf-8")
    return folder / "recipe.toml"


@pytest.fixture(scope="module")
def bracket(tmp_path_factory):
    """The bracket inspected once, with its results."""
    out = tmp_path_factory.mktemp("bracket") / "out"
    return run(BRACKET / "recipe.toml", out), out


def test_the_results_keep_the_contract(bracket):
    if not CHECKER.exists():
        pytest.skip("the contract's checker is not beside the repository")
    checked = subprocess.run(
        [sys.executable, str(CHECKER), str(bracket[1])], capture_output=True, text=True, check=False
    )
    assert checked.returncode == 0, checked.stdout


def test_the_demo_tells_the_truth(bracket):
    record, _ = bracket
    part, mesh = record.parts[0], record.nominal.mesh
    seen = part.deviation.observed
    truth = Truth.read(BRACKET / "truth.json").deviation(mesh.nodes[seen])
    gauge = best_fit(mesh.nodes[seen], mesh.normals[seen], mesh.areas[seen], part.deviation.value[seen])
    z = (part.deviation.value[seen] - gauge(truth)) / part.deviation.sigma[seen]
    assert part.status is Status.OK
    assert 0.9 < np.sqrt(np.mean(z**2)) < 1.1
    assert 0.93 < np.mean(np.abs(z) < 1.96) < 0.97


def test_the_demo_finds_its_bump_and_little_else_out_of_tolerance(bracket):
    record, _ = bracket
    part, mesh = record.parts[0], record.nominal.mesh
    failed = mesh.nodes[part.verdict == 3]
    assert len(failed) > 10
    assert np.median(np.linalg.norm(failed - np.median(failed, axis=0), axis=1)) < 8


def test_inputs_are_hashed_and_relative(bracket):
    values = json.loads((bracket[1] / "results.json").read_text(encoding="utf-8"))
    assert {item["path"] for item in values["inputs"]} == {"recipe.toml", "part.step", "scan.ply"}


def one(path):
    """Return how the only measurement of a recipe ended."""
    return inspect(load_recipe(path), Progress()).parts[0]


def test_a_given_pose_that_is_not_refined_is_kept(tmp_path, block):
    rows = Pose.small(np.array([1e-4, -2e-4, 3e-4, 0.05, -0.04, 0.02]), np.zeros(3)).matrix.tolist()
    scan = f"files = [{json.dumps(str(block / 'scan.txt'))}]\n"
    path = recipe(
        tmp_path, block, measurement=scan + f'alignment = {{ start = "pose", matrix = {rows}, refine = false }}'
    )
    part = one(path)
    np.testing.assert_allclose(part.alignments[0].cad_from_measured.matrix, rows, atol=1e-9)
    assert part.deviation.observed.any()


def test_excluded_boxes_are_neither_measured_nor_judged(tmp_path, block):
    path = recipe(tmp_path, block, "tolerance = [-0.1, 0.1]\nexclude = [ { box = [[10, 5, -1], [30, 25, 30]] } ]")
    record = inspect(load_recipe(path), Progress())
    part, nodes = record.parts[0], record.nominal.mesh.nodes
    inside = ((nodes > [10, 5, -1]) & (nodes < [30, 25, 30])).all(axis=1)
    assert inside.any()
    assert not part.deviation.observed[inside].any()
    assert not (part.verdict[inside] > 0).any()


def test_a_warm_part_is_measured_as_at_twenty_degrees(tmp_path, block):
    cold = one(recipe(tmp_path, block))
    path = recipe(tmp_path, block, rest="[report]\nbudget = { temperature = 30.0, expansion = 24e-6 }")
    warm = one(path)
    assert any("20 °C" in remark for remark in warm.remarks)
    size_cold, size_warm = (np.ptp(np.percentile(p.points_cad, [5, 95], axis=0), axis=0) for p in (cold, warm))
    np.testing.assert_allclose(size_cold / size_warm, 1 + 24e-5, atol=5e-5)


def test_files_aligned_separately_have_an_alignment_each(tmp_path, block):
    scan = json.dumps(str(block / "scan.txt"))
    start = 'alignment = { start = "identity" }'
    path = recipe(tmp_path, block, measurement=f'files = [{scan}, {scan}]\nframes = "separate"\n{start}')
    assert len(one(path).alignments) == 2


def test_a_section_beside_the_part_is_warned_of(tmp_path, block):
    planes = "{ point = [999, 0, 0], normal = [1, 0, 0] }, { point = [30, 0, 0], normal = [1, 0, 0] }"
    lines = check(recipe(tmp_path, block, rest=f"[report]\nsections = [ {planes} ]"))
    assert [line for line in lines if "does not meet" in line] == [
        "The plane of report.sections[0] does not meet the part, so there is no profile of it."
    ]


def waves(name, box):
    """Return the table of a waviness in a box."""
    place = f"place = {{ box = {box} }}\nacross = [1, 0, 0]\nwavelength = 8.0"
    return f'[[part.features]]\nname = "{name}"\nkind = "waviness"\n{place}\n'


def test_a_feature_marked_where_nothing_is_or_nothing_was_measured_is_warned_of(tmp_path, block):
    boxes = {"beside": [[200, 0, 0], [210, 9, 9]], "beneath": [[-1, -1, -1], [99, 99, 0.01]]}
    above = [line for line in (block / "scan.txt").read_text("utf-8").splitlines() if float(line.split()[2]) > 1.0]
    (tmp_path / "scan.txt").write_text("\n".join(above), encoding="utf-8")
    start = 'files = "scan.txt"\nalignment = { start = "identity" }'
    path = recipe(tmp_path, block, measurement=start, part="".join(waves(name, box) for name, box in boxes.items()))
    beside = "No node of the part lies in the place marked for the feature 'beside': it may lie beside it."
    assert [line for line in check(path) if "feature" in line] == [beside]
    beneath = "laser observed no node in the place marked for the feature 'beneath'."
    assert inspect(load_recipe(path), Progress()).warnings == (beside, beneath)


def test_check_reads_everything_and_measures_nothing(tmp_path, block):
    count = len((block / "scan.txt").read_text("utf-8").splitlines())
    lines = check(recipe(tmp_path, block))
    assert any(f"laser: {count} points" in line for line in lines)


@pytest.mark.parametrize(
    ("text", "status", "words"),
    [
        ("", 2, "empty"),
        ("1 2 3\n4 5 6\n7 8 9\n", 1, "3 points"),
        ("nan nan nan\n" * 50, 2, "points"),
    ],
)
def test_clouds_with_nothing_in_them_end_in_a_sentence(tmp_path, block, text, status, words):
    (tmp_path / "scan.xyz").write_text(text, encoding="utf-8")
    path = recipe(tmp_path, block, measurement='files = ["scan.xyz"]')
    ended = subprocess.run(
        [sys.executable, "-m", "inspect3d", "run", str(path), "-o", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == status, ended.stderr
    told = ended.stderr if status == 2 else ended.stdout
    assert words in told
    assert "Traceback" not in ended.stderr
    assert (tmp_path / "out").exists() == (status == 1)


def test_an_interrupted_run_leaves_the_earlier_results_and_nothing_half_written(tmp_path, block, monkeypatch):
    out = tmp_path / "out"
    out.mkdir()
    (out / "results.json").write_text("{}", encoding="utf-8")

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("inspect3d.report.write.write_report", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run(recipe(tmp_path, block), out)
    assert (out / "results.json").read_text(encoding="utf-8") == "{}"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "recipe.toml"]


def test_a_folder_that_holds_something_else_is_not_replaced(tmp_path, block):
    out = tmp_path / "out"
    out.mkdir()
    (out / "thesis.txt").write_text("years of work", encoding="utf-8")
    with pytest.raises(InputError, match="not a folder of results"):
        run(recipe(tmp_path, block), out)
    assert (out / "thesis.txt").exists()


def test_points_of_the_cad_itself_want_their_noise_stated(tmp_path, block):
    points, _ = surface_points(load_nominal(block / "part.step", element_size=8.0).surface, 6000)
    np.savetxt(tmp_path / "scan.txt", points, fmt="%.17g")
    table = 'files = "scan.txt"\nalignment = { start = "identity" }\n'
    part = one(recipe(tmp_path, block, measurement=table))
    assert part.status is Status.FAILED
    assert "no scatter at all" in part.reason
    part = one(recipe(tmp_path, block, measurement=table + "noise = 0.005"))
    seen = part.deviation.observed
    assert np.abs(part.deviation.value[seen]).max() < 1e-9
    assert (part.deviation.sigma[seen] > 1e-4).all()


def written(out, words):
    """Return the block that writes results into `out`."""

    @contextmanager
    def writing():
        with replaced(out) as folder:
            yield
            (folder / "results.json").write_text(words, encoding="utf-8")

    return writing()


def test_of_two_runs_into_one_folder_at_once_the_later_one_stays_and_nothing_else(tmp_path):
    with written(tmp_path / "out", "later"), written(tmp_path / "out", "earlier"):
        pass
    assert (tmp_path / "out" / "results.json").read_text("utf-8") == "later"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_what_somebody_puts_into_the_folder_during_a_run_stays(tmp_path):
    def disturbed():
        with written(tmp_path / "out", "{}"):
            (tmp_path / "out").mkdir()
            (tmp_path / "out" / "thesis.txt").write_text("years of work", encoding="utf-8")

    with pytest.raises(InputError, match="not a folder of results"):
        disturbed()
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["thesis.txt"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_results_behind_a_link_are_replaced_where_they_lie(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "disk")
    for words in ("first", "second"):
        with written(tmp_path / "out", words):
            pass
        assert (tmp_path / "disk" / "results.json").read_text("utf-8") == words
    assert (tmp_path / "out").is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["disk", "out"]


def test_results_that_cannot_be_written_are_refused_before_anything_is_measured(tmp_path, block):
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    with pytest.raises(InputError, match=r"cannot be written: .*Choose another folder"):
        run(recipe(tmp_path, block), tmp_path / "file" / "out")
    if os.geteuid() != 0:  # root may write anywhere
        (tmp_path / "locked").mkdir(mode=0o555)
        with pytest.raises(InputError, match="Permission denied"):
            run(recipe(tmp_path, block), tmp_path / "locked" / "out")


@pytest.mark.parametrize(
    ("part", "measurement"),
    [
        ("exclude = [ { faces = [9999] } ]", ""),
        ("", 'alignment = { fit = "datum", datum = [ { faces = [9999] } ] }'),
    ],
)
def test_a_face_that_the_model_does_not_have_is_refused_before_measuring(tmp_path, block, part, measurement):
    scan = measurement and f"files = [{json.dumps(str(block / 'scan.txt'))}]\n{measurement}"
    with pytest.raises(InputError, match=r"part\.step has no face 9999; its faces are 0 to 9\."):
        check(recipe(tmp_path, block, part, scan))
