"""The contract of every installed method, and what is said of those that break it."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import FrozenInstanceError, dataclass, fields
from importlib.metadata import EntryPoint
from inspect import getdoc, signature
from pathlib import Path
from shutil import copytree

import pytest

import inspect3d.registry as registry
from inspect3d.measure import Files, Measure
from inspect3d.outcome import InputError
from inspect3d.registry import build, method, method_names, methods
from inspect3d.setting import settings_of

FOREIGN = Path(__file__).parent / "foreign_plugin"


@dataclass(frozen=True)
class Probe:
    """A method for these tests.

    Parameters
    ----------
    radius, length : of the probe, mm;
        both of them
    kind : of ball
    """

    radius: float
    length: float | None = None
    kind: str = "ruby"
    offsets: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.radius < 0:
            raise ValueError(f"the radius is not negative, as {self.radius} is")

    def open(self, files: Files) -> None:
        """Read nothing."""

    def __call__(self, source, nominal):
        """Measure nothing."""


@dataclass
class Thawed:
    """No method: its settings can change under way."""

    def open(self, files: Files) -> None:
        """Read nothing."""

    def __call__(self, source, nominal):
        """Measure nothing."""


@pytest.fixture
def offer(monkeypatch):
    """Return a function that makes other methods the installed ones."""

    def offering(**values: str) -> None:
        entries = [EntryPoint(name, value, registry.GROUP) for name, value in values.items()]

        def found(group, name=None):
            return [entry for entry in entries if name in (None, entry.name)]

        monkeypatch.setattr(registry, "entry_points", found)

    return offering


@pytest.mark.parametrize("name", method_names())
class TestEveryInstalledMethod:
    def test_is_a_documented_frozen_dataclass_with_the_two_calls_of_a_method(self, name):
        plugin = method(name)
        assert issubclass(plugin, Measure)
        assert getdoc(plugin)
        assert list(signature(plugin.open).parameters)[1:] == ["files"]
        assert list(signature(plugin.__call__).parameters)[1:] == ["source", "nominal"]

    def test_says_what_each_of_its_settings_means(self, name):
        assert not [setting.name for setting in settings_of(method(name)) if not setting.meaning]

    def test_can_be_built_from_nothing_and_built_again_from_its_provenance(self, name):
        plugin = method(name)
        built = build(name, {})
        assert eval(repr(built), {plugin.__name__: plugin}) == built

    def test_keeps_its_settings(self, name):
        built = build(name, {})
        for field in fields(built):
            with pytest.raises(FrozenInstanceError):
                setattr(built, field.name, None)
        assert hash(built) == hash(build(name, {}))

    def test_names_the_right_setting_where_one_is_misspelt(self, name):
        for setting in settings_of(method(name)):
            misspelt = f"{setting.name[:-1]}_"
            with pytest.raises(InputError, match=f"unknown key; did you mean {setting.name}"):
                build(name, {misspelt: 1}, "measurements['laser']")

    def test_refuses_a_setting_of_the_wrong_type(self, name):
        for setting in settings_of(method(name)):
            with pytest.raises(InputError, match=f"laser.*{setting.name}"):
                build(name, {setting.name: {"nonsense": True}}, "measurements['laser']")

    def test_says_which_file_key_is_missing(self, name, tmp_path):
        with pytest.raises(InputError, match="names no `"):
            build(name, {}).open(Files(tmp_path, {}))


def test_every_installed_method_can_be_had_by_its_name():
    assert set(methods()) == set(method_names())


def test_an_unknown_method_is_refused_with_the_nearest_name(offer):
    offer(scan=f"{__name__}:Probe", colmap=f"{__name__}:Probe")
    with pytest.raises(
        InputError, match=r"There is no method 'scna'; installed are colmap, scan\. Did you mean 'scan'\?"
    ):
        method("scna")


def test_a_machine_without_methods_is_told_to_install_again(offer):
    offer()
    with pytest.raises(InputError, match="install inspect3d again"):
        method("scan")


def test_a_method_that_cannot_be_imported_is_blamed_on_its_package(offer):
    offer(laser="surely_missing.module:Laser")
    with pytest.raises(InputError, match=r"'laser' of the package surely_missing.module cannot be loaded \(ModuleNotF"):
        method("laser")


@pytest.mark.parametrize("value", ["pathlib:Path", f"{__name__}:Thawed", "math:pi"])
def test_what_is_not_a_frozen_dataclass_with_both_calls_is_no_method(offer, value):
    offer(laser=value)
    with pytest.raises(InputError, match="is not a frozen dataclass with open"):
        method("laser")


def test_two_packages_that_offer_one_name_are_both_named(monkeypatch):
    entries = [EntryPoint("scan", "one:Scan", registry.GROUP), EntryPoint("scan", "other:Scan", registry.GROUP)]
    monkeypatch.setattr(registry, "entry_points", lambda group, name=None: entries)
    with pytest.raises(InputError, match="packages one and other both offer a method 'scan'"):
        method("scan")


def test_settings_are_told_with_their_meaning_from_the_docstring():
    radius, length, kind, offsets = settings_of(Probe)
    assert (radius.kind, radius.default, radius.meaning) == ("float", "needed", "of the probe, mm; both of them")
    assert (length.default, length.meaning) == ("None", radius.meaning)
    assert (kind.default, kind.meaning) == ("'ruby'", "of ball")
    assert offsets.meaning == ""


def test_settings_become_the_method(offer):
    offer(probe=f"{__name__}:Probe")
    assert build("probe", {"radius": 2, "offsets": (1, 2.5)}) == Probe(radius=2.0, offsets=(1.0, 2.5))


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({}, "laser.radius: missing"),
        ({"radius": "2"}, 'laser.radius: wants a number, not "2"'),
        ({"radius": -1}, "laser: the radius is not negative, as -1.0 is."),
        ({"radius": float("nan")}, "laser: a setting of the method 'probe' is not a finite number"),
        ({"radius": 1.0, "raidus": 1.0}, "laser.raidus: unknown key; did you mean radius?"),
        ({"radius": 1.0, "reech": 1.0}, "laser.reech: unknown key; did you mean reach?"),
        ({"radius": 1.0, "image": "a.png"}, "laser.image: unknown key; did you mean images?"),
        ({"radius": 1.0, "zzz": 1.0}, "laser.zzz: unknown key; known are alignment, cameras, coating"),
        ({"radius": 1.0, "offsets": (1.0, "x")}, "laser.offsets[no. 2]: wants a number"),
    ],
)
def test_a_wrong_setting_is_told_with_its_place(offer, settings, says):
    offer(probe=f"{__name__}:Probe")
    with pytest.raises(InputError) as caught:
        build("probe", settings, "laser")
    assert says in str(caught.value)


@pytest.fixture(scope="module")
def with_foreign_package(tmp_path_factory) -> dict[str, str]:
    """Install the example package into a folder of its own and return the environment that knows it."""
    folder = tmp_path_factory.mktemp("foreign")
    source = copytree(FOREIGN, folder / "source")
    pip = [sys.executable, "-m", "pip", "install", "-qq", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*pip, "--target", str(folder / "target"), str(source)], check=True)
    return {**os.environ, "PYTHONPATH": str(folder / "target")}


def test_a_foreign_method_is_listed_like_a_shipped_one(with_foreign_package):
    command = [sys.executable, "-m", "inspect3d", "methods"]
    listed = subprocess.run(command, env=with_foreign_package, capture_output=True, text=True, check=True).stdout
    assert "touched: Points touched with a probe" in listed
    assert "radius (float; 0.0): of the ball at the probe's tip, mm" in listed


def test_a_recipe_runs_a_foreign_method_like_a_shipped_one(with_foreign_package, tmp_path):
    cube = "OFF\n8 12 0\n" + "".join(f"{x} {y} {z}\n" for x in (0, 20) for y in (0, 20) for z in (0, 20))
    facets = ["013", "032", "064", "026", "451", "410", "567", "546", "237", "276", "715", "731"]
    (tmp_path / "cube.off").write_text(cube + "".join(f"3 {' '.join(facet)}\n" for facet in facets))
    grid = [1.0 + k for k in range(19)]
    (tmp_path / "top.csv").write_text("".join(f"{x},{y},21.5\n" for x in grid for y in grid))
    (tmp_path / "recipe.toml").write_text(
        """
        schema = 1
        [part]
        name = "Cube"
        cad = "cube.off"
        element_size = 4.0
        [[measurements]]
        name = "hand"
        method = "touched"
        files = "top.csv"
        radius = 1.0
        alignment = { start = "identity", refine = false }
        """
    )
    command = [sys.executable, "-m", "inspect3d", "run", str(tmp_path / "recipe.toml"), "-o", str(tmp_path / "out")]
    ended = subprocess.run(command, env=with_foreign_package, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert "mean +0.5000 mm" in ended.stdout
