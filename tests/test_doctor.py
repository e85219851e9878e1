"""The doctor finds what a machine lacks, and says what to do."""

from __future__ import annotations

from importlib.metadata import requires

import pytest

from inspect3d import doctor, system
from inspect3d.outcome import InspectionError
from inspect3d.registry import method_names


@pytest.mark.slow
def test_this_machine_is_well():
    findings = doctor.examine()
    assert [finding for finding in findings if not finding.well] == []
    looked_at = {finding.what for finding in findings}
    assert {"Python", "open3d", "pyvista", "off-screen rendering", "numba's cache", "processor"} <= looked_at
    assert {f"method {name}" for name in method_names()} <= looked_at


def test_every_package_is_looked_at_and_those_of_the_extras_are_not():
    needed = doctor._needed()
    assert "open3d" in needed
    assert "laspy" in needed
    assert "pytest" not in needed
    assert len(needed) == sum("extra ==" not in line for line in requires("inspect3d"))


@pytest.mark.parametrize(
    ("code", "well", "words"),
    [
        ("print('noise'); print('all is well')", True, "all is well"),
        ("raise ValueError('a red ball came out green')", False, "a red ball came out green"),
        ("import os; os.abort()", False, "crashed with signal 6"),
    ],
)
def test_a_trial_in_its_own_process_survives_whatever_happens_there(code, well, words):
    assert doctor._tried("trial", code) == doctor.Finding("trial", well, words)


def test_a_trial_that_hangs_is_given_up(monkeypatch):
    monkeypatch.setattr(doctor, "PATIENCE", 1.0)
    hanging = doctor._tried("trial", "import time; time.sleep(60)")
    assert hanging == doctor.Finding("trial", False, "no answer within 1 s")


def test_a_missing_system_library_is_named_with_its_package(monkeypatch):
    monkeypatch.setattr(system, "LIBRARIES", {"libsurely_missing.so.9": "libsurely9"})
    monkeypatch.setattr(doctor, "LIBRARIES", system.LIBRARIES)
    monkeypatch.setattr(system.sys, "platform", "linux")
    (finding,) = doctor._libraries()
    assert not finding.well
    assert "apt-get install libsurely9" in finding.words


@pytest.mark.parametrize(
    ("message", "says"),
    [
        ("libGL.so.1: cannot open shared object file: No such file or directory", "apt-get install libgl1`"),
        ("libfoo.so.3: cannot open shared object file: No such file or directory", "The system library libfoo.so.3"),
        ("No module named 'open3d'", "make setup"),
    ],
)
def test_an_import_that_fails_says_what_to_install(message, says):
    assert says in system.import_words(ImportError(message))


def test_a_package_that_is_not_there_is_an_error_in_words():
    with pytest.raises(InspectionError, match="No module named 'surely_missing'"):
        system.imported("surely_missing")


def test_a_method_that_is_declared_and_not_registered_is_blamed_on_stale_metadata(monkeypatch):
    monkeypatch.setattr(doctor, "method_names", lambda: ())
    assert "remove inspect3d.egg-info" in doctor._methods()[0].words


def test_open3d_comes_silenced_and_finds_libusb_in_its_wheel():
    open3d = system.import_open3d()
    assert open3d.utility.get_verbosity_level() == open3d.utility.VerbosityLevel.Error
