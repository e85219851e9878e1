"""What `inspect3d view` shows: the maps of one or more finished inspections, and the flags that go into the recipe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from threading import RLock
from typing import Any

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.compare.compare import Compare
from inspect3d.compare.comparison import Comparison
from inspect3d.compare.measured_map import MeasuredMap
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.errors_file import read_errors
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.nominal.sharp import sides_of
from inspect3d.outcome import InputError, Status
from inspect3d.recipe import Recipe, load_recipe
from inspect3d.report.colours import BACK, UNMEASURED, ColourScale, band_scale, en_classes, en_scale
from inspect3d.report.finished import Finished, FinishedMap, open_results
from inspect3d.report.screenshot import field_scale
from inspect3d.web.coarse import coarse_triangles
from inspect3d.web.page import Answer, Page, Request
from inspect3d.web.pairs import is_number
from inspect3d.web.palettes import palettes
from inspect3d.web.recipe_text import change_recipe, report_table, set_rows

ASSETS = ("view.html", "view.js", "server.js", "profile.js", "surface.js", "pane.js", "pane.css", "page.css")
SHOWN = ("deviation", "sigma", "verdict", "residual")
"""Fields in the order of the page; others follow, and `observed` and `crease` are shown as what has no value."""
AGAINST = ("difference", "en")
"""Fields of a map against the first one, in one alignment with it."""
HIDDEN = ("observed", "crease", "Normals")
TITLES = {"deviation": "deviation", "sigma": "uncertainty (k = 1)", "verdict": "verdict"}
SHARP = np.radians(30.0)


@dataclass(frozen=True, eq=False)
class Shown:
    """A map on the page: its inspection and the name of the measurement."""

    finished: Finished
    name: str


@dataclass(eq=False)
class View:
    """The maps of finished inspections, read when they are asked for.

    Parameters
    ----------
    finished : the inspections
    recipe : the recipe that flags go into; None where none is known
    """

    finished: Sequence[Finished]
    recipe: Path | None
    _maps: dict[int, FinishedMap] = field(default_factory=dict)
    _comparisons: dict[int, Comparison] = field(default_factory=dict)
    _lock: RLock = field(default_factory=RLock)

    @cached_property
    def shown(self) -> list[Shown]:
        """Return the maps that can be shown, in the order of the page."""
        return [Shown(each, name) for each in self.finished for name in each.with_map if name not in each.damaged]

    @property
    def damaged(self) -> list[str]:
        """Return what is wrong with maps that cannot be shown, a sentence each."""
        return [words for finished in self.finished for words in finished.damaged.values()]

    @property
    def page(self) -> Page:
        """Return the page for the server."""
        get = {"maps": self.maps, "map": self.map, "geometry": self.geometry, "lines": self.lines, "field": self.field}
        return Page("view", ASSETS, {**get, "alive": lambda _: Answer.json({})}, {"labels": self.save_labels})

    def maps(self, request: Request) -> Answer:
        """Return what there is to see, without the numbers."""
        several = len(self.finished) > 1
        part = self.finished[0].values["part"]
        return Answer.json(
            {
                "part": part["name"],
                "cad": part["cad"],
                "tolerance": part["tolerance"],
                "centre": self._centre.tolist(),
                "unmeasured": UNMEASURED,
                "back": BACK,
                "palettes": palettes(),
                "limits": self._limits(),
                "maps": [_words(each, several) for each in self.shown],
                "without": [
                    {"name": name, "reason": finished.damaged.get(name, each["reason"]) or Status(each["status"]).words}
                    for finished in self.finished
                    for name, each in finished.values["measurements"].items()
                    if name not in finished.with_map or name in finished.damaged
                ],
                "recipe": self.recipe.name if self.recipe else None,
                "labels": self._labels(),
            }
        )

    def map(self, request: Request) -> Answer:
        """Return the fields of a map, and which mesh it is on: the first map with the same one stands for it."""
        index = request.index("map", len(self.shown))
        mesh = self._map(index).mesh
        same = (k for k in range(index) if _same(self._map(k).mesh, mesh))
        return Answer.json({"geometry": next(same, index), "fields": self._fields(index)})

    def geometry(self, request: Request) -> Answer:
        """Return nodes about the common centre, triangles and normals of a mesh; fewer triangles for turning it."""
        mesh = self._map(request.index("map", len(self.shown))).mesh
        return Answer.arrays(
            nodes=(mesh.nodes - self._centre).astype(np.float32),
            triangles=mesh.triangles.astype(np.uint32),
            normals=np.round(127 * mesh.normals).astype(np.int8),
            crease=mesh.crease.astype(np.uint8),
            coarse=coarse_triangles(mesh.nodes, mesh.triangles, mesh.normals).astype(np.uint32),
        )

    def lines(self, request: Request) -> Answer:
        """Return the sharp edges of a map's mesh."""
        mesh = self._map(request.index("map", len(self.shown))).mesh
        edges = sides_of(mesh.nodes, mesh.triangles).sharp(SHARP)
        return Answer.arrays(edges=edges.astype(np.uint32))

    def field(self, request: Request) -> Answer:
        """Return the values of a field at the nodes; NaN, or 0 for classes, where there is none."""
        index = request.index("map", len(self.shown))
        names = self._names(index)
        name = names[request.index("field", len(names))]
        return Answer.arrays(values=self._values(index, name).astype(np.float32))

    def save_labels(self, request: Request) -> Answer:
        """Put flags into the recipe.

        Raises
        ------
        InputError
            No recipe is known, a flag is none, or the recipe cannot be written.
        """
        if self.recipe is None:
            raise InputError("Nothing was saved: name the recipe when you start, with --recipe.")
        rows = [{"name": name, "point": point} for name, point in _flags(request.body)]
        change_recipe(self.recipe, lambda document: set_rows(report_table(document), "labels", rows))
        words = f"{len(rows)} flag{'s' * (len(rows) != 1)} saved in {self.recipe.name}; the next run reports them."
        return Answer.json({"words": words})

    @property
    def _centre(self) -> Floats:
        return np.mean(np.array(self.finished[0].values["part"]["bounds"], dtype=np.float64), axis=0)

    def _map(self, index: int) -> FinishedMap:
        with self._lock:
            if index not in self._maps:
                each = self.shown[index]
                self._maps[index] = each.finished.map(each.name)
            return self._maps[index]

    def _comparison(self, index: int) -> Comparison:
        """Return the comparison of a map with the first one."""
        with self._lock:
            if index not in self._comparisons:
                mesh = self._map(0).mesh
                self._comparisons[index] = Compare().pair(self._measured(index), self._measured(0), mesh)
            return self._comparisons[index]

    def _measured(self, index: int) -> MeasuredMap:
        each, found = self.shown[index], self._map(index)
        errors = read_errors(each.finished.folder / f"{each.name}_errors.npz")
        deviation = Deviation(found.field("deviation"), found.field("sigma"), found.field("observed") > 0)
        return MeasuredMap(each.name, deviation, errors.covariance, errors.sources)

    def _names(self, index: int) -> list[str]:
        """Return the fields of a map in the order of the page; `tolerance` is the verdict with its side."""
        found = self._map(index)
        names = [name for name in SHOWN if name in found.fields]
        names += [name for name in found.fields if name not in (*SHOWN, *HIDDEN)]
        if not found.fields["verdict"].any():
            names.remove("verdict")
        elif self.finished[0].values["part"]["tolerance"]:
            names.insert(names.index("verdict"), "tolerance")
        return names + list(AGAINST if index and _same(found.mesh, self._map(0).mesh) else ())

    def _values(self, index: int, name: str) -> Floats:
        found = self._map(index)
        if name in AGAINST:
            comparison = self._comparison(index)
            if name == "difference":
                return comparison.difference
            if comparison.en is None:
                raise InputError(comparison.reason)
            return np.nan_to_num(en_classes(comparison.en))
        if name != "tolerance":
            return found.field(name)
        verdict, deviation = found.field("verdict"), found.field("deviation")
        middle = np.mean(self.finished[0].values["part"]["tolerance"])
        return np.where(verdict == 0, 0, 3 + np.where(deviation < middle, -1, 1) * (verdict - 1))

    def _fields(self, index: int) -> list[dict[str, Any]]:
        return [_described(name, self._scale(index, name), self.shown[0].name) for name in self._names(index)]

    def _scale(self, index: int, name: str) -> ColourScale:
        if name == "tolerance":
            return band_scale()
        if name == "en":
            return en_scale()
        found = self._map(index)
        known = "deviation" if name == "difference" else name
        return field_scale(known, found.field(known), found.mesh)

    def _limits(self) -> list[float] | None:
        recipe = self._loaded()
        return list(recipe.report.limits) if recipe and recipe.report.limits else None

    def _labels(self) -> list[dict[str, Any]]:
        recipe = self._loaded()
        if recipe is not None:
            return [{"name": label.name, "point": list(label.point)} for label in recipe.report.labels]
        found = {
            label["name"]: label["point"]
            for each in self.finished[0].values["measurements"].values()
            for label in each.get("labels", [])
        }
        return [{"name": name, "point": point} for name, point in found.items()]

    def _loaded(self) -> Recipe | None:
        return load_recipe(self.recipe) if self.recipe else None


def view_of(folders: Sequence[Path], recipe: Path | None) -> View:
    """Return the maps of folders of results.

    Parameters
    ----------
    folders : what `inspect3d run` wrote
    recipe : the recipe that flags go into; None: looked for near the first folder

    Raises
    ------
    InputError
        A folder holds no inspection, none holds a map that can be shown, or the recipe is wrong.
    """
    finished = [open_results(folder) for folder in folders]
    if all(len(each.damaged) == len(each.with_map) for each in finished):
        next((each for each in finished if each.with_map), finished[0]).map()
    if recipe is not None:
        load_recipe(recipe)
    return View(finished, recipe or _recipe_of(finished[0]))


def _recipe_of(finished: Finished) -> Path | None:
    """Return the recipe of an inspection, if it lies where the command runs or above its results."""
    inputs, part = finished.values.get("inputs") or [], finished.values["part"]["name"]
    if not inputs:
        return None
    name = Path(inputs[0]["path"]).name
    folder = finished.folder.resolve()
    for place in (Path.cwd(), folder, *folder.parents[:2]):
        try:
            if load_recipe(place / name).part.name == part:
                return place / name
        except InputError:
            continue
    return None


def _words(shown: Shown, several: bool) -> dict[str, str]:
    found = shown.finished.values["measurements"][shown.name]
    name = f"{shown.finished.folder.resolve().name}: {shown.name}" if several else shown.name
    status = Status(found["status"])
    return {"name": name, "method": found["method"], "words": "" if status is Status.OK else status.words}


def _same(a: InspectionMesh, b: InspectionMesh) -> bool:
    return np.array_equal(a.nodes, b.nodes) and np.array_equal(a.triangles, b.triangles)


def _described(name: str, scale: ColourScale, first: str) -> dict[str, Any]:
    against = {"difference": f"difference to {first}", "en": f"Eₙ against {first}"}
    return {
        "key": name,
        "title": (TITLES | against).get(name, name),
        "unit": scale.unit,
        "limits": list(scale.limits),
        "signed": scale.limits[0] < 0,
        "classes": list(scale.classes),
        "colours": scale.colours.tolist() if scale.classes else [],
    }


def _flags(body: Any) -> list[tuple[str, list[float]]]:
    rows = body.get("labels") if isinstance(body, dict) else None
    if not isinstance(rows, list):
        raise InputError("The page sent no flags.")
    flags = []
    for row in rows:
        point = row.get("point") if isinstance(row, dict) else None
        if not (isinstance(point, list) and len(point) == 3 and all(map(is_number, point))):
            raise InputError("The page sent a flag without a point.")
        flags.append((str(row.get("name", "")).strip(), [round(float(x), 4) for x in point]))
    return flags
