"""A finished inspection, read back from the folder that a run has left behind."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.file_name import file_name
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.outcome import InputError, Status

NO_MAP = "{} is not a map of inspect3d: run the inspection again."


@dataclass(frozen=True, eq=False)
class FinishedMap:
    """The map of a measurement.

    Parameters
    ----------
    name : of the measurement
    mesh : the inspection mesh; its faces are not known any more
    fields : (n,) each, of the nodes: deviation, sigma, verdict, ...
    """

    name: str
    mesh: InspectionMesh
    fields: Mapping[str, Floats]

    def field(self, name: str) -> Floats:
        """Return a field of the nodes, (n,).

        Raises
        ------
        InputError
            The map has no such field.
        """
        if name not in self.fields:
            raise InputError(f"The map of {self.name!r} has no field {name!r}; it has {', '.join(self.fields)}.")
        return self.fields[name]


@dataclass(frozen=True, eq=False)
class Finished:
    """A finished inspection.

    Parameters
    ----------
    folder : where the results lie
    values : what results.json holds
    """

    folder: Path
    values: Mapping[str, Any]

    @property
    def with_map(self) -> list[str]:
        """Return the names of the measurements that have a map."""
        return [name for name, each in self.values["measurements"].items() if Status(each["status"]).has_map]

    @property
    def damaged(self) -> dict[str, str]:
        """Return the measurements whose map is missing or broken, as far as can be told at once, and what is wrong."""
        found = {name: _damage(self.folder / f"{file_name(name)}.vtp") for name in self.with_map}
        return {name: words for name, words in found.items() if words}

    def map(self, name: str | None = None) -> FinishedMap:
        """Return the map of a measurement, by default of the first that has one.

        Raises
        ------
        InputError
            There is no such measurement, it has no map, or its file is missing or broken.
        """
        measurements, with_map = self.values["measurements"], self.with_map
        if not with_map:
            raise InputError(f"No measurement in {self.folder} has a map; results.json says why.")
        if name is None:
            name = with_map[0]
        if name not in measurements:
            known = ", ".join(map(repr, measurements))
            raise InputError(f"{self.folder} holds no measurement {name!r}; it holds {known}.")
        if name not in with_map:
            status = measurements[name]["status"]
            raise InputError(f"{name!r} has no map, as it ended {status}; results.json says why.")
        try:
            return _read(self.folder / f"{file_name(name)}.vtp", name)
        except ValueError as error:
            raise InputError(f"results.json in {self.folder} is not of inspect3d: {error}.") from error


def _damage(file: Path) -> str:
    """Return what is wrong with the file of a map at first sight, or nothing.

    VTK complains on standard error before it says that it cannot read a file, so it is not asked.
    """
    if not file.is_file():
        return f"{file} is missing: run the inspection again."
    with file.open("rb") as content:
        begin = content.read(200)
        content.seek(max(file.stat().st_size - 200, 0))
        whole = b"<VTKFile" in begin and content.read().rstrip().endswith(b"</VTKFile>")
    return "" if whole else NO_MAP.format(file)


def open_results(folder: Path) -> Finished:
    """Return a finished inspection.

    Parameters
    ----------
    folder : what `inspect3d run` wrote

    Raises
    ------
    InputError
        The folder holds no inspection, or one of another version.
    """
    try:
        values = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        raise InputError(f"{folder} holds no inspection: name the folder that `inspect3d run` wrote.") from None
    if not _is_complete(values):
        raise InputError(f"{folder} holds an inspection of another version of inspect3d: run it again.")
    return Finished(folder, values)


def _is_complete(values: Any) -> bool:
    """Tell whether results.json says what everything that reads finished inspections asks of it."""
    try:
        part, inputs, measurements = values["part"], values["inputs"], values["measurements"]
        np.array(part["bounds"], dtype=np.float64).reshape(2, 3)
        for name, each in measurements.items():
            file_name(name)
            Status(each["status"])
        listed = all(isinstance(each["path"], str) for each in inputs)
        return (
            listed
            and {"name", "cad", "tolerance"} <= part.keys()
            and all({"method", "reason"} <= each.keys() for each in measurements.values())
        )
    except (KeyError, TypeError, ValueError, AttributeError):
        return False


def _read(file: Path, name: str) -> FinishedMap:
    import pyvista

    if words := _damage(file):
        raise InputError(words)
    polydata = pyvista.read(file)
    if not isinstance(polydata, pyvista.PolyData) or polydata.n_points == 0:
        raise InputError(NO_MAP.format(file))
    fields = {
        key: np.asarray(values, dtype=np.float64)
        for key, values in polydata.point_data.items()
        if np.asarray(values).ndim == 1
    }
    mesh = InspectionMesh(
        nodes=np.asarray(polydata.points, dtype=np.float64),
        triangles=np.asarray(polydata.regular_faces, dtype=np.int64),
        normals=np.asarray(polydata.point_data["Normals"], dtype=np.float64),
        crease=np.asarray(polydata.point_data["crease"], dtype=bool),
        face=np.full(polydata.n_points, -1, dtype=np.int64),
    )
    return FinishedMap(name, mesh, fields)
