"""The machine under inspect3d: packages that need shared libraries, and which Debian package has them."""

from __future__ import annotations

import re
import sys
import warnings
from ctypes import CDLL, RTLD_GLOBAL
from importlib import import_module
from types import ModuleType

from inspect3d.outcome import InspectionError

LIBRARIES = {
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libOpenGL.so.0": "libopengl0",
    "libX11.so.6": "libx11-6",
    "libfontconfig.so.1": "libfontconfig1",
}
"""The shared libraries a machine must have, and the Debian and Ubuntu packages they come in."""

_SELDOM = {"libudev.so.1": "libudev1", "libgomp.so.1": "libgomp1", "libusb-1.0.so.0": "libusb-1.0-0"}
"""Libraries that come with nearly every system, or with a wheel."""

_MISSING = re.compile(r"(\S+\.so[.\d]*): cannot open shared object file")


def imported(name: str) -> ModuleType:
    """Return a package by its import name.

    Raises
    ------
    InspectionError
        It is not installed, or a shared library it needs is missing; says which one and where to get it.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise InspectionError(import_words(error)) from error


def import_open3d() -> ModuleType:
    """Return Open3D, silenced; its libusb comes from a wheel, so that no system package is needed for it.

    Raises
    ------
    InspectionError
        As `imported`.
    """
    libusb = imported("libusb_package").get_library_path()
    if libusb is not None:
        CDLL(str(libusb), mode=RTLD_GLOBAL)
    warnings.filterwarnings("ignore", "The TBB threading layer requires")  # numba does without the TBB Open3D brings
    open3d = imported("open3d")
    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    return open3d


def missing_libraries() -> dict[str, str]:
    """Return the shared libraries this machine lacks, with the packages they come in; Linux only."""
    return {library: LIBRARIES[library] for library in LIBRARIES if sys.platform == "linux" and not _loads(library)}


def _loads(library: str) -> bool:
    try:
        CDLL(library)
    except OSError:
        return False
    return True


def import_words(error: ImportError) -> str:
    """Say why a package could not be imported, and what to do."""
    found = _MISSING.search(str(error))
    if found is None:
        return f"A package cannot be imported ({error}): run `make setup`, or `pip install inspect3d`, again."
    library = found[1]
    package = {**LIBRARIES, **_SELDOM}.get(library)
    if package is None:
        return f"The system library {library} is missing ({error}): install the package that holds it."
    return f"The system library {library} is missing: install it with `sudo apt-get install {package}`."
