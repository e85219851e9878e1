"""The command line: what it prints, where, and how it exits."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import inspect3d
from inspect3d import cli
from inspect3d.deviate.deviation import Deviation
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.surface import Surface
from inspect3d.outcome import InputError, MeasurementError, Status
from inspect3d.progress import Progress
from inspect3d.recipe import Recipe
from inspect3d.record import MeasuredPart, Record
from inspect3d.summary import summary
from inspect3d.terminal import terminal

COMMANDS = ("run", "demo", "check", "methods", "screenshot", "pick", "view", "virtual", "doctor")


def inspect3d_command(*arguments: str, **options) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "inspect3d", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120, **options)


@pytest.fixture
def called(monkeypatch, capsys):
    """Return a function that runs the command line in this process: exit status, standard output, standard error."""

    def calling(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["inspect3d", *arguments])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        captured = capsys.readouterr()
        return ended.value.code, captured.out, captured.err

    return calling


def failing(error: BaseException):
    def command(*arguments, **options):
        raise error

    return command


def test_help_names_every_command_and_every_command_has_help(called):
    status, words, _ = called("--help")
    assert status == 0
    for command in COMMANDS:
        assert command in words
        status, help_words, _ = called(command, "--help")
        assert status == 0
        assert "Usage" in help_words


def test_the_version_is_that_of_the_package(called):
    assert called("--version") == (0, f"inspect3d {inspect3d.__version__}\n", "")


def test_help_takes_less_than_four_tenths_of_a_second_of_work():
    before = os.times()
    assert inspect3d_command("--help").returncode == 0
    after = os.times()
    work = after.children_user + after.children_system - before.children_user - before.children_system
    assert work < 0.4


@pytest.mark.parametrize("command", ["run", "check"])
def test_a_wrong_recipe_is_a_sentence_on_standard_error_and_status_2(command, tmp_path):
    (tmp_path / "recipe.toml").write_text("schema = 1\n[prat]\n")
    ended = inspect3d_command(command, str(tmp_path / "recipe.toml"))
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr == "recipe.toml: prat: unknown key; did you mean part?\n"


def test_debug_shows_the_traceback_wherever_it_stands(tmp_path):
    for arguments in (["--debug", "check"], ["check", "--debug"]):
        ended = inspect3d_command(*arguments, str(tmp_path / "none.toml"))
        assert "Traceback" in ended.stderr
        assert "InputError" in ended.stderr


def test_an_unknown_option_is_a_wrong_input(called):
    status, _, words = called("run", "--reech", "1")
    assert status == 2
    assert "--reech" in words


@pytest.mark.parametrize(
    ("error", "status", "says"),
    [
        (InputError("The file a.ply is empty."), 2, "The file a.ply is empty.\n"),
        (MeasurementError("The scan does not fit."), 1, "The scan does not fit.\n"),
        (PermissionError(13, "Permission denied", "/out"), 2, "/out: Permission denied.\n"),
        (MemoryError(), 1, "There is not enough memory; a larger element_size or fewer points need less.\n"),
        (ImportError("libGL.so.1: cannot open shared object file: No such file"), 1, "apt-get install libgl1`.\n"),
        (
            KeyError("pose"),
            70,
            "inspect3d made a mistake of its own (KeyError: 'pose'); please report it with --debug.\n",
        ),
        (KeyboardInterrupt(), 130, "Interrupted; earlier results are untouched.\n"),
    ],
)
def test_every_error_is_a_sentence_and_a_status(called, monkeypatch, error, status, says):
    monkeypatch.setattr("inspect3d.listing.listing", failing(error))
    code, out, words = called("methods")
    assert (code, out) == (status, "")
    assert words.endswith(says)
    assert words.count("\n") == 1


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signals to send")
def test_an_interrupted_command_says_so_and_exits_with_130(tmp_path):
    command = [sys.executable, "-m", "inspect3d", "virtual", "milled", "-o", str(tmp_path / "milled")]
    heeding = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a background job would inherit that it is ignored
    running = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=heeding)
    time.sleep(1.5)
    running.send_signal(signal.SIGINT)
    _, words = running.communicate(timeout=60)
    assert running.returncode == 130
    assert words.splitlines()[-1].startswith("Interrupted")
    assert "Traceback" not in words


def test_the_stages_of_each_measurement_add_up():
    progress = Progress()
    for _ in range(2):
        with progress.stage("registering", "laser"):
            progress.update(0.5)
            time.sleep(0.01)
    with pytest.raises(ValueError, match="gone wrong"), progress.stage("reading"):
        raise ValueError("gone wrong")
    assert set(progress.seconds) == {"laser", ""}
    assert progress.seconds["laser"]["registering"] >= 0.02
    assert "reading" in progress.seconds[""]


def test_only_a_long_stage_is_worth_a_line_in_a_log(monkeypatch):
    monkeypatch.setattr("inspect3d.terminal.PATIENCE", 0.05)
    log = io.StringIO()
    with terminal(log) as progress:
        with progress.stage("short"):
            pass
        with progress.stage("long", "laser"):
            progress.update(0.5)
            time.sleep(0.3)
    assert log.getvalue() == "laser: long ...\n"


def test_a_terminal_shows_running_stages_with_their_bar():
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Terminal()
    with terminal(screen) as progress, progress.stage("registering", "laser"):
        progress.update(0.5)
        time.sleep(0.3)
    assert "laser: registering" in screen.getvalue()


@pytest.fixture
def square() -> Nominal:
    """Return a square of two triangles, 2 mm wide."""
    nodes = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    up = np.tile([0.0, 0, 1], (4, 1))
    mesh = InspectionMesh(nodes, triangles, up, np.zeros(4, dtype=bool), np.full(4, -1))
    return Nominal("square", Surface(nodes, triangles), mesh)


def test_a_finished_inspection_is_summed_up_by_status_figures_and_report(square):
    recipe = Recipe.model_validate(
        {
            "schema": 1,
            "part": {"name": "square", "cad": "square.stl"},
            "measurements": [{"name": "laser", "method": "scan"}],
        }
    )
    value, sigma = np.array([0.1, 0.1, 0.1, np.nan]), np.array([0.02, 0.01, 0.03, np.nan])
    unseen = np.full(4, np.nan)
    parts = (
        MeasuredPart("laser", "scan", "Scan()", Status.OK, deviation=Deviation(value, sigma, np.isfinite(value))),
        MeasuredPart(
            "blind", "scan", "Scan()", Status.OK, deviation=Deviation(unseen, unseen, np.zeros(4, dtype=bool))
        ),
        MeasuredPart("lost", "scan", "Scan()", Status.FAILED, reason="The scan does not fit."),
    )
    record = Record(recipe, square, parts, (), {}, ("There is no PDF yet.",))
    assert list(summary(record, Path("out"))) == [
        f"laser (scan): {Status.OK.words}",
        "    mean +0.1000 mm, std 0.0000 mm, median sigma 0.0200 mm; 3 of 4 nodes observed",
        f"blind (scan): {Status.OK.words}",
        "    none of 4 nodes was observed",
        "lost (scan): The scan does not fit.",
        "warning: There is no PDF yet.",
        f"report: {Path('out') / 'report.html'}",
    ]


def test_a_picture_of_a_folder_without_results_is_refused(called, tmp_path):
    status, _, words = called("screenshot", str(tmp_path), "-o", str(tmp_path / "a.png"))
    assert status == 2
    assert str(tmp_path) in words


def test_the_demo_takes_the_recipe_of_the_repository_or_makes_it_anew(monkeypatch, tmp_path):
    from inspect3d.demo import Demo, demo_recipe
    from inspect3d.progress import Progress

    shipped = Path(inspect3d.__file__).parents[1] / "datasets" / "bracket" / "recipe.toml"
    assert demo_recipe(Demo.BRACKET, tmp_path / "data", Progress()) == shipped
    assert shipped.exists()
    made = []
    monkeypatch.setattr("inspect3d.virtual.datasets.make_dataset", lambda *what: made.append(what))
    assert demo_recipe(Demo.MILLED, tmp_path / "data", Progress()) == tmp_path / "data" / "recipe.toml"
    monkeypatch.setattr(inspect3d, "__file__", str(tmp_path / "inspect3d" / "__init__.py"))
    demo_recipe(Demo.BRACKET, tmp_path / "bracket", Progress())
    assert made == [("milled-study", tmp_path / "data"), ("bracket", tmp_path / "bracket")]


def test_every_demo_has_its_dataset():
    from inspect3d.demo import Demo
    from inspect3d.virtual.datasets import DATASETS

    assert {demo.dataset for demo in Demo} <= set(DATASETS)
