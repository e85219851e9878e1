"""The maps as tables, a row for each node: CSV for spreadsheets, Parquet for data tools."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from inspect3d.compare.tolerances import tolerances
from inspect3d.record import MeasuredPart, Record

if TYPE_CHECKING:
    from pyarrow import Table

VERDICTS = ("none", "conform", "undecided", "nonconform")


def node_table(record: Record, part: MeasuredPart) -> Table:
    """Return the map of a measurement, a row for each node in the order of the inspection mesh.

    `node` counts from 0; `x`, `y`, `z` (mm) and `normal_x`, `normal_y`, `normal_z` are the node and its outward normal
    in the CAD frame; `area` (mm²) is what it stands for; `deviation` and `sigma` (mm, k = 1) are null where nothing was
    measured; `observed` and `crease` are flags; `lower` and `upper` (mm) its tolerance, and `verdict` a word, where
    there is a tolerance; `residual` and `unresolved` where the method has them.

    Raises
    ------
    ValueError
        The measurement ended without a map.
    """
    import pyarrow

    if part.deviation is None:
        raise ValueError(f"{part.name} has no map")
    mesh, limits = record.nominal.mesh, tolerances(record.recipe.part, record.nominal.mesh)
    columns = {"node": pyarrow.array(np.arange(len(mesh)))}
    columns |= {axis: pyarrow.array(mesh.nodes[:, k]) for k, axis in enumerate("xyz")}
    columns |= {f"normal_{axis}": pyarrow.array(mesh.normals[:, k]) for k, axis in enumerate("xyz")}
    columns["area"] = pyarrow.array(mesh.areas)
    columns["deviation"] = pyarrow.array(part.deviation.value, from_pandas=True)
    columns["sigma"] = pyarrow.array(part.deviation.sigma, from_pandas=True)
    columns["observed"] = pyarrow.array(part.deviation.observed)
    columns["crease"] = pyarrow.array(mesh.crease)
    if limits is not None and part.verdict is not None:
        columns["lower"] = pyarrow.array(limits[:, 0], from_pandas=True)
        columns["upper"] = pyarrow.array(limits[:, 1], from_pandas=True)
        verdict = pyarrow.array(np.where(part.deviation.observed, part.verdict, 0).astype(np.int8))
        columns["verdict"] = pyarrow.DictionaryArray.from_arrays(verdict, list(VERDICTS))
    if part.residual is not None:
        columns["residual"] = pyarrow.array(part.residual, from_pandas=True)
    if part.unresolved is not None:
        columns["unresolved"] = pyarrow.array(part.deviation.observed & part.unresolved)
    notes = {"part": record.recipe.part.name, "measurement": part.name, "method": part.provenance, "units": "mm"}
    return pyarrow.table(columns, metadata=notes)


def write_tables(record: Record, part: MeasuredPart, folder: Path) -> None:
    """Write the map of a measurement as `NAME.csv` and `NAME.parquet`."""
    from pyarrow import csv, parquet

    table = node_table(record, part)
    csv.write_csv(table, folder / f"{part.name}.csv")
    parquet.write_table(table, folder / f"{part.name}.parquet", compression="zstd")
