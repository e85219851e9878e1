"""Whether this machine has everything an inspection needs."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

import inspect3d
from inspect3d.outcome import InspectionError
from inspect3d.registry import GROUP, method, method_names
from inspect3d.system import LIBRARIES, missing_libraries

PATIENCE = 120.0
"""Seconds a trial may take."""


MODULES = {
    "cadquery-ocp-novtk": "OCP",
    "opencv-python-headless": "cv2",
    "pillow": "PIL",
    "vtk": "vtkmodules",
}
"""The packages that are imported under another name than their own."""

_IMPORT = """
from inspect3d.system import import_open3d, imported
import_open3d() if {module!r} == "open3d" else imported({module!r})
"""

_RENDER = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.set_background("white")
plotter.add_mesh(pyvista.Sphere(), color="red", lighting=False)
picture = plotter.screenshot(return_img=True)
middle, corner = picture[32, 32].tolist(), picture[1, 1].tolist()
assert middle == [255, 0, 0] and corner == [255, 255, 255], f"a red ball came out as {middle} on {corner}"
print("draws through", plotter.render_window.GetClassName())
"""

_CACHE = """
from inspect3d.nominal.closest_kernel import closest
print("writes to", closest.stats.cache_path)
"""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at: what, whether all is well, and the details in words."""

    what: str
    well: bool
    words: str


def examine() -> list[Finding]:
    """Return what was found about Python, packages, libraries, rendering, caches, methods and cores.

    Whatever might crash is tried in a process of its own.
    """
    trials = [partial(_package, name) for name in _needed()]
    trials += [partial(_tried, "off-screen rendering", _RENDER), partial(_tried, "numba's cache", _CACHE)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        tried = [waiting.result() for waiting in [pool.submit(trial) for trial in trials]]
    libraries = _libraries() if sys.platform == "linux" else []
    return [_python(), *tried, *libraries, *_methods(), _cores()]


def _tried(what: str, code: str) -> Finding:
    """Run Python code in a process of its own; its last line says how it went."""
    try:
        ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        return Finding(what, False, f"no answer within {PATIENCE:.0f} s")
    if ended.returncode < 0:
        return Finding(what, False, f"crashed with signal {-ended.returncode}")
    lines = (ended.stderr if ended.returncode else ended.stdout).strip().splitlines()
    words = re.sub(r"^[\w.]+(Error|Exception): ", "", lines[-1]) if lines else "no answer"
    return Finding(what, ended.returncode == 0, words)


def _needed() -> list[str]:
    """Return the names of the packages inspect3d depends on, extras left out."""
    lines = (line for line in requires("inspect3d") or () if "extra ==" not in line)
    return [re.split(r"[^\w-]", line, maxsplit=1)[0] for line in lines]


def _package(name: str) -> Finding:
    try:
        release = version(name)
    except PackageNotFoundError:
        return Finding(name, False, "not installed: run `make setup`, or `pip install inspect3d`, again")
    found = _tried(name, _IMPORT.format(module=MODULES.get(name, name.replace("-", "_"))))
    return Finding(name, True, release) if found.well else found


def _python() -> Finding:
    release = sys.version_info[:2]
    return Finding("Python", (3, 11) <= release < (3, 14), f"{sys.version.split()[0]}; 3.11 to 3.13 are supported")


def _libraries() -> list[Finding]:
    missing = missing_libraries()
    advice = {
        library: f"missing: install it with `sudo apt-get install {package}`" for library, package in missing.items()
    }
    return [Finding(library, library not in missing, advice.get(library, "found")) for library in LIBRARIES]


def _methods() -> list[Finding]:
    """Compare the methods that can be loaded with those the project file declares, where the repository is at hand."""
    installed = method_names()
    findings = [_method(name) for name in installed]
    project = Path(inspect3d.__file__).parents[1] / "pyproject.toml"
    if not project.exists():
        return findings
    declared = tomllib.loads(project.read_text(encoding="utf-8"))["project"]["entry-points"][GROUP]
    lost = sorted(set(declared) - set(installed))
    stale = "not registered: remove inspect3d.egg-info and run `make setup` again"
    return [*findings, *(Finding(f"method {name}", False, stale) for name in lost)]


def _method(name: str) -> Finding:
    try:
        plugin = method(name)
    except InspectionError as error:
        return Finding(f"method {name}", False, str(error))
    return Finding(f"method {name}", True, f"{plugin.__module__}.{plugin.__qualname__}")


def _cores() -> Finding:
    return Finding("processor", True, f"{os.cpu_count()} cores")
