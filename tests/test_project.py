"""The project as a newcomer meets it: what the documents promise, what the wheel holds, what the pins pin."""

from __future__ import annotations

import ast
import os
import re
import shlex
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from shutil import copy, copytree, ignore_patterns

import pytest

from inspect3d.doctor import MODULES
from inspect3d.inspection import LIBRARIES
from inspect3d.recipe import load_recipe

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(document: Path, language: str) -> list[str]:
    """Return the code blocks of a language in a document."""
    return re.findall(rf"^```{language}\n(.*?)^```", document.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def commands(document: Path) -> list[list[str]]:
    """Return the words of every command in a document."""
    lines = "".join(blocks(document, "sh")).splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


@pytest.fixture
def bracket(tmp_path, monkeypatch) -> Path:
    """Return a folder with the bracket's CAD model and scan, which the documents speak of; work there."""
    for name in ("part.step", "scan.ply"):
        copy(ROOT / "datasets" / "bracket" / name, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_make_target_in_the_documents_exists():
    targets = {words[1] for document in DOCUMENTS for words in commands(document) if words[0] == "make"}
    assert {"demo", "test", "lint", "bench"} <= targets
    for target in targets:
        subprocess.run(["make", "--dry-run", target], cwd=ROOT, check=True, capture_output=True)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_recipe_in_a_document_is_right(document, bracket):
    for text in blocks(document, "toml"):
        if "schema" in text:
            (bracket / "recipe.toml").write_text(text, encoding="utf-8")
            assert load_recipe(bracket / "recipe.toml").part.name == "Bracket"
        else:
            tomllib.loads(text)


def test_the_reference_names_every_key_of_a_recipe():
    from inspect3d.recipe import Budget, Coating, MeasurementTable, Part, Recipe, Report
    from inspect3d.recipe_alignment import Start
    from inspect3d.recipe_types import Region

    text = (ROOT / "docs" / "recipe.md").read_text(encoding="utf-8")
    for table in (Part, Region, MeasurementTable, Coating, Start, Report, Budget):
        assert not [key for key in table.model_fields if key not in text]
    assert set(Recipe.model_fields) == {"schema_", "part", "measurements", "report"}


@pytest.mark.slow
def test_every_command_and_every_line_of_python_in_the_readme_works(bracket):
    readme = ROOT / "README.md"
    (bracket / "recipe.toml").write_text(blocks(readme, "toml")[0], encoding="utf-8")
    ran = [words for words in commands(readme) if words[0] == "inspect3d"]
    assert len(ran) >= 3
    for words in ran:
        subprocess.run([sys.executable, "-m", *words], check=True)
    for kept in ("out/report.html", "out/results.json", "out/laser.vtp", "out/pictures", "sigma.png"):
        assert (bracket / kept).exists()
    for code in blocks(readme, "python"):
        subprocess.run([sys.executable, "-c", code], check=True)


def test_every_link_into_the_repository_leads_somewhere():
    for document in [*DOCUMENTS, ROOT / "CHANGELOG.md"]:
        for target in re.findall(r"\]\(([^)]+)\)", document.read_text(encoding="utf-8")):
            assert target.startswith("https://") or (document.parent / target).exists(), target


def test_every_package_the_project_asks_for_is_pinned_exactly_once_and_without_an_address():
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    pinned = [re.fullmatch(r"([\w.-]+)==[\w.+!-]+", line)[1].lower().replace("_", "-") for line in lines]
    assert len(pinned) == len(set(pinned))
    extras = PROJECT["project"]["optional-dependencies"].values()
    asked = [line for group in (PROJECT["project"]["dependencies"], *extras) for line in group]
    names = {re.split(r"[^\w-]", line, maxsplit=1)[0].lower().replace("_", "-") for line in asked}
    assert names <= set(pinned)


def test_every_package_of_the_source_tree_is_declared():
    declared = set(PROJECT["tool"]["setuptools"]["packages"])
    found = {
        path.parent.relative_to(ROOT).as_posix().replace("/", ".") for path in ROOT.glob("inspect3d/**/__init__.py")
    }
    assert declared == found | {"inspect3d_plugins"}


def test_the_wheel_holds_packages_plugins_templates_and_entry_points(tmp_path):
    source = tmp_path / "source"
    skip = ignore_patterns("__pycache__")
    for name in ("inspect3d", "plugins"):
        copytree(ROOT / name, source / name, ignore=skip)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        copy(ROOT / name, source)
    pip = [sys.executable, "-m", "pip", "-qq", "--disable-pip-version-check"]
    wheel = [
        *pip,
        "wheel",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "--wheel-dir",
        str(tmp_path),
        str(source),
    ]
    subprocess.run(wheel, check=True)
    (path,) = tmp_path.glob("*.whl")
    held = set(zipfile.ZipFile(path).namelist())
    for package, folder in (("inspect3d", "inspect3d"), ("inspect3d_plugins", "plugins")):
        files = [file.relative_to(ROOT / folder) for file in (ROOT / folder).rglob("*") if file.is_file()]
        assert not [
            file for file in files if "__pycache__" not in file.parts and f"{package}/{file.as_posix()}" not in held
        ]
    target = tmp_path / "target"
    subprocess.run([*pip, "install", "--no-deps", "--no-index", "--target", str(target), str(path)], check=True)
    code = "import inspect3d_plugins, inspect3d.registry as r; print(inspect3d_plugins.__file__, *r.methods())"
    environment = {**os.environ, "PYTHONPATH": str(target)}
    ended = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    where, *names = ended.stdout.split()
    assert Path(where).is_relative_to(target)
    assert set(names) >= set(PROJECT["project"]["entry-points"]["inspect3d.measurements"])


BY_NAME = {"open3d", "libusb-package"}
"""Packages that `inspect3d.system` loads by their name."""

AHEAD = {"opencv-python-headless", "pycolmap"}
"""Packages of the stereo methods, which are on their way."""


def imported_packages(path: Path) -> set[str]:
    """Return the packages a module imports anywhere, by the names pip knows them under."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    foreign = {name.split(".")[0] for name in names} - sys.stdlib_module_names - {"inspect3d", "inspect3d_plugins"}
    distribution = {module: name for name, module in MODULES.items()}
    return {distribution.get(name, name.replace("_", "-")) for name in foreign}


def test_every_package_that_is_imported_is_declared_and_the_other_way_round():
    modules = [*(ROOT / "inspect3d").rglob("*.py"), *(ROOT / "plugins").rglob("*.py")]
    declared = {re.split(r"[^\w-]", line, maxsplit=1)[0] for line in PROJECT["project"]["dependencies"]}
    used = set().union(*map(imported_packages, modules)) - {"pydantic-core"} | BY_NAME | AHEAD
    assert used == declared
    assert set(LIBRARIES) <= declared
