"""Imports point backwards along the pipeline, and what is heavy is loaded where it is used."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

PIPELINE = (
    {
        "__init__",
        "arrays",
        "outcome",
        "pose",
        "camera",
        "camera_kernel",
        "progress",
        "terminal",
        "system",
        "readable",
        "file_name",
        "figure",
        "threads",
    },
    {"files"},
    {"nominal"},
    {"measure"},
    {"register"},
    {"deviate"},
    {"complaint", "recipe_types", "recipe_alignment", "recipe_feature", "recipe"},
    {"compare"},
    {"record"},
    {"report"},
    {"setting", "registry", "listing", "summary"},
    {"alignment_choice"},
    {"job"},
    {"results_folder"},
    {"inspection"},
    {"comparing"},
    {"doctor", "demo"},
    {"cli"},
    {"__main__"},
)
"""The modules of inspect3d in the order of the pipeline; a module imports from its own stage and from earlier ones."""

ASIDE = {
    "virtual": "deviate",
    "web": "comparing",
    "correlation": "deviate",
    "starting": "deviate",
    "triangulation": "deviate",
}
"""Packages beside the pipeline, which no stage before this one's successors imports."""

BESIDE_PLUGINS = {"correlation", "triangulation", "recipe", "recipe_types", "recipe_alignment"}
"""What a plugin may import beyond the stage of measuring: an engine, and the values that a recipe holds."""

HEAVY = {
    "open3d",
    "pyvista",
    "vtk",
    "vtkmodules",
    "pymeshlab",
    "pycolmap",
    "OCP",
    "numba",
    "trimesh",
    "cv2",
    "matplotlib",
    "typst",
    "pyarrow",
}


def rank(module: str) -> int:
    """Return where a module of inspect3d stands in the pipeline."""
    stage = ASIDE.get(module, module)
    return next(place for place, stages in enumerate(PIPELINE) if stage in stages)


def imported(tree: ast.AST) -> Iterator[str]:
    """Yield the dotted names a module imports when it runs; those for annotations only are left out."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        yield from imported(node)


def sources(folder: str) -> list[Path]:
    """Return the Python files of a package."""
    return sorted((ROOT / folder).rglob("*.py"))


@pytest.mark.parametrize("path", sources("inspect3d"), ids=lambda path: str(path.relative_to(ROOT)))
def test_a_module_imports_only_from_its_own_stage_and_earlier_ones(path):
    here = path.relative_to(ROOT / "inspect3d").with_suffix("").parts[0]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    stages = {name.split(".")[1] for name in imported(tree) if name.startswith("inspect3d.")}
    forward = {stage for stage in stages - {"__version__"} if rank(stage) > rank(here)}
    assert not forward, f"{here} imports from the later {forward}"


@pytest.mark.parametrize("path", sources("plugins"), ids=lambda path: path.name)
def test_a_plugin_imports_nothing_that_comes_after_measuring(path):
    names = imported(ast.parse(path.read_text(encoding="utf-8")))
    stages = {name.split(".")[1] for name in names if name.startswith("inspect3d.")}
    assert all(rank(stage) <= rank("measure") or stage in BESIDE_PLUGINS for stage in stages), stages


HELP = """
import sys
sys.argv = ["inspect3d", "--help"]
from inspect3d.cli import main
try:
    main()
except SystemExit:
    pass
"""


@pytest.mark.parametrize(
    "code",
    [
        "import inspect3d",
        "import inspect3d.recipe, inspect3d.registry, inspect3d.record",
        HELP,
    ],
    ids=["import inspect3d", "import the values", "inspect3d --help"],
)
def test_nothing_heavy_is_loaded_before_it_is_used(code):
    listing = f"{code}\nimport sys; print(*sorted({{name.split('.')[0] for name in sys.modules}}), file=sys.stderr)"
    ended = subprocess.run([sys.executable, "-c", listing], capture_output=True, text=True, check=True)
    assert not HEAVY & set(ended.stderr.split())


def test_importing_inspect3d_loads_no_package_at_all():
    code = "import sys; before = set(sys.modules); import inspect3d; print(*(set(sys.modules) - before))"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {name.split(".")[0] for name in ended.stdout.split()} <= {"inspect3d", "__future__"}
