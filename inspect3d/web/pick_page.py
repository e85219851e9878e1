"""What `inspect3d pick` shows: the CAD beside photographs or a cloud, to click on the same points of both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from inspect3d.inspection import nominal_of
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import InputError, Status
from inspect3d.pose import Pose
from inspect3d.recipe import MeasurementTable, Recipe, load_recipe
from inspect3d.registry import method
from inspect3d.report.colours import BACK
from inspect3d.report.finished import open_results
from inspect3d.setting import settings_of
from inspect3d.web.clouded import Clouded
from inspect3d.web.page import Answer, Page, Request
from inspect3d.web.pairs import Pairs, pairs_of
from inspect3d.web.pictured import Pictured
from inspect3d.web.recipe_text import change_recipe, measurement, set_rows
from inspect3d.web.snap_cad import snap_targets
from inspect3d.web.snap_picture import corner_near, ellipse_near

ASSETS = ("pick.html", "pick.js", "picture.js", "solid.js", "server.js", "surface.js", "pane.css", "page.css")
FINE = 300_000
"""Triangles of the fine surface up to which it is shown; else the inspection mesh is."""
PLAIN = (176, 188, 201)
SNAPS = {"corner": corner_near, "ellipse": ellipse_near}


@dataclass(frozen=True, eq=False)
class Job:
    """A measurement of the recipe whose points can be picked.

    Parameters
    ----------
    table : of the recipe
    source : its photographs, or its cloud
    candidates : poses CAD from measured (4 x 4) with residuals, where the last run could not choose
    reason : what the last run said about it
    """

    table: MeasurementTable
    source: Pictured | Clouded
    candidates: tuple[Mapping[str, Any], ...] = ()
    reason: str = ""

    def pairs(self, body: Any) -> Pairs:
        """Return the complete pairs that the page sends."""
        if isinstance(self.source, Pictured):
            return pairs_of(body, len(self.source.photographs), 2)
        return pairs_of(body, 1, 3)

    def known(self) -> list[dict[str, Any]]:
        """Return the pairs that the recipe has already."""
        if isinstance(self.source, Pictured):
            rows = self.table.settings.get("landmarks", ())
            return [{"name": row.get("name", ""), "cad": row["cad"], "shown": row["pixels"]} for row in rows]
        rows = self.table.alignment.landmarks
        return [{"name": row.name, "cad": row.cad, "shown": [row.measured]} for row in rows]


@dataclass(frozen=True, eq=False)
class Pick:
    """The measurements of a recipe whose points can be picked."""

    recipe: Path
    nominal: Nominal
    jobs: tuple[Job, ...]
    _lock: Lock = field(default_factory=Lock)

    @property
    def page(self) -> Page:
        """Return the page for the server."""
        get = {"jobs": self.about, "cad": self.cad, "picture": self.picture, "cloud": self.cloud, "snap": self.snap}
        get["candidate"] = self.candidate
        post = {"fit": self.fit, "save": self.save, "choose": self.choose}
        return Page("pick", ASSETS, {**get, "alive": lambda _: Answer.json({})}, post)

    def about(self, request: Request) -> Answer:
        """Return what there is to pick."""
        return Answer.json(
            {
                "part": self.nominal.name,
                "recipe": self.recipe.name,
                "centre": self._centre.tolist(),
                "plain": PLAIN,
                "back": BACK,
                "jobs": [
                    {
                        "name": job.table.name,
                        "method": job.table.method,
                        "pairs": job.known(),
                        "candidates": list(job.candidates),
                        "reason": job.reason,
                        **job.source.described(),
                    }
                    for job in self.jobs
                ],
            }
        )

    def cad(self, request: Request) -> Answer:
        """Return the part about its centre, and what a click may snap to."""
        surface, mesh, targets = self.nominal.surface, self.nominal.mesh, snap_targets(self.nominal.mesh)
        vertices, triangles = surface.vertices, surface.triangles
        if len(triangles) > FINE:
            vertices, triangles = mesh.nodes, mesh.triangles
        circles = targets.circles.copy()
        circles[:, :3] -= self._centre
        return Answer.arrays(
            nodes=(vertices - self._centre).astype(np.float32),
            triangles=triangles.astype(np.uint32),
            corners=targets.corners - self._centre,
            lines=(targets.edges - self._centre).astype(np.float32),
            circles=circles,
        )

    def picture(self, request: Request) -> Answer:
        """Return a photograph."""
        source = self._pictured(request)
        return source.picture(request.index("picture", len(source.photographs)))

    def cloud(self, request: Request) -> Answer:
        """Return the points of a cloud."""
        source = self._job(request.query.get("job")).source
        if not isinstance(source, Clouded):
            raise InputError("This measurement has no cloud.")
        return source.arrays()

    def snap(self, request: Request) -> Answer:
        """Return the corner or the ellipse near a place of a photograph; null where there is none."""
        source, snap = self._pictured(request), SNAPS.get(request.query.get("to", ""))
        if snap is None:
            raise InputError("A click snaps to a corner or an ellipse.")
        grey = source.photographs[request.index("picture", len(source.photographs))].grey
        found = snap(grey, request.number("x"), request.number("y"))
        return Answer.json(None if found is None else {"x": found.x, "y": found.y, "ellipse": found.ellipse})

    def candidate(self, request: Request) -> Answer:
        """Return where a candidate of an ambiguous start puts the CAD."""
        job = self._job(request.query.get("job"))
        chosen = job.candidates[request.index("candidate", len(job.candidates))]
        with self._lock:
            return Answer.json(job.source.shown_at(Pose.from_matrix(np.array(chosen["matrix"], dtype=np.float64))))

    def fit(self, request: Request) -> Answer:
        """Return what the pairs say."""
        job = self._job_of(request)
        pairs = job.pairs(request.body)
        with self._lock:
            found = job.source.answer(pairs)
        return Answer.json({**found, "numbers": pairs.numbers})

    def save(self, request: Request) -> Answer:
        """Put the complete pairs into the recipe as landmarks.

        Raises
        ------
        InputError
            There are too few, or the recipe cannot be written.
        """
        job = self._job_of(request)
        pairs, fewest = job.pairs(request.body), job.source.described()["fewest"]
        if len(pairs) < fewest:
            raise InputError(f"Nothing was saved: {fewest} complete pairs are needed, and there are {len(pairs)}.")

        def change(document: Any) -> None:
            table = measurement(document, job.table.name)
            set_rows(table, "landmarks", job.source.rows(pairs))
            if isinstance(job.source, Clouded):
                _align(table, "landmarks")

        change_recipe(self.recipe, change)
        return Answer.json({"words": f"{len(pairs)} landmarks saved. Next: inspect3d run {self.recipe.name}"})

    def choose(self, request: Request) -> Answer:
        """Put a candidate of an ambiguous start into the recipe as the pose to start from.

        Raises
        ------
        InputError
            There is no such candidate, or the recipe cannot be written.
        """
        job = self._job_of(request)
        number = request.body.get("candidate")
        if not (isinstance(number, int) and 0 <= number < len(job.candidates)):
            raise InputError("There is no such candidate.")
        matrix = np.array(job.candidates[number]["matrix"], dtype=np.float64).round(9).tolist()
        change_recipe(self.recipe, lambda document: _align(measurement(document, job.table.name), "pose", matrix))
        words = f"Start {number + 1} chosen for {job.table.name}. Next: inspect3d run {self.recipe.name}"
        return Answer.json({"words": words})

    @property
    def _centre(self) -> np.ndarray:
        nodes = self.nominal.mesh.nodes
        return np.asarray((nodes.min(axis=0) + nodes.max(axis=0)) / 2)

    def _job(self, name: Any) -> Job:
        for job in self.jobs:
            if job.table.name == name:
                return job
        raise InputError("There is no such measurement.")

    def _job_of(self, request: Request) -> Job:
        return self._job(request.body.get("job") if isinstance(request.body, dict) else None)

    def _pictured(self, request: Request) -> Pictured:
        source = self._job(request.query.get("job")).source
        if not isinstance(source, Pictured):
            raise InputError("This measurement has no photographs.")
        return source


def pick_of(path: Path, out: Path) -> Pick:
    """Return the measurements of a recipe whose points can be picked.

    Parameters
    ----------
    path : the recipe
    out : folder of the results of the last run, for the candidates of a start that was ambiguous; need not exist

    Raises
    ------
    InputError
        The recipe or one of its files is wrong, or there is nothing to pick.
    """
    recipe = load_recipe(path)
    tables = [table for table in recipe.measurements if not table.listed("images") or _takes_landmarks(table)]
    if not tables:
        raise InputError(f"{path.name} has no measurement whose method starts from landmarks.")
    nominal = nominal_of(recipe)
    return Pick(path, nominal, tuple(_job(recipe, table, nominal, out) for table in tables))


def _takes_landmarks(table: MeasurementTable) -> bool:
    return "landmarks" in [setting.name for setting in settings_of(method(table.method))]


def _job(recipe: Recipe, table: MeasurementTable, nominal: Nominal, out: Path) -> Job:
    source = (Pictured if table.listed("images") else Clouded).of(recipe, table, nominal)
    try:
        ended = open_results(out).values["measurements"].get(table.name)
    except InputError:  # there was no run yet, or one of another version: no candidates to choose from
        return Job(table, source)
    if ended is None or ended["status"] != Status.AMBIGUOUS:
        return Job(table, source)
    return Job(table, source, tuple(ended["alignment"]["candidates"]), ended["reason"])


def _align(table: Any, start: str, matrix: list[list[float]] | None = None) -> None:
    """Set how the alignment of a measurement starts, and leave its other keys as they are."""
    import tomlkit

    if "alignment" not in table:
        table["alignment"] = tomlkit.inline_table()
    alignment = table["alignment"]
    alignment["start"] = start
    for key, value in (("matrix", matrix), ("landmarks", None)):
        if value is not None:
            alignment[key] = value
        elif key in alignment:
            del alignment[key]
