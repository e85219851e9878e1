"""How the errors of a map hang together, as a file beside the map: what a later comparison needs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from inspect3d.arrays import Integers
from inspect3d.deviate.low_rank import LowRank, condensed
from inspect3d.deviate.map_covariance import MapCovariance
from inspect3d.outcome import InputError


@dataclass(frozen=True, eq=False)
class SavedErrors:
    """What an errors file holds.

    Parameters
    ----------
    covariance : of the map, condensed
    sources : the files it was measured from, name by SHA-256
    face : (n,) number of the B-rep face that owns each node of the mesh; -1 where there is none
    """

    covariance: MapCovariance
    sources: Mapping[str, str]
    face: Integers


def write_errors(path: Path, covariance: MapCovariance, sources: Mapping[str, str], face: Integers) -> None:
    """Write the errors of a map as .npz; see `SavedErrors`."""
    own = condensed(covariance.own)
    np.savez_compressed(
        path,
        node=covariance.node.astype(np.int32),
        rest=own.rest,
        modes=own.modes.astype(np.float32),
        pose=covariance.pose,
        coating=np.array(covariance.coating),
        calibration=np.array(covariance.calibration),
        refined=np.array(covariance.refined),
        scale_known=np.array(covariance.scale_known),
        weak=covariance.weak.astype(np.float32),
        sources=np.array(json.dumps(dict(sources))),
        face=face.astype(np.int32),
    )


def read_errors(path: Path) -> SavedErrors:
    """Return what `write_errors` wrote.

    Raises
    ------
    InputError
        The file is missing or broken.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            covariance = MapCovariance(
                node=file["node"],
                own=LowRank(file["rest"], file["modes"].astype(np.float64)),
                pose=file["pose"],
                coating=(float(file["coating"][0]), float(file["coating"][1])),
                calibration=float(file["calibration"]),
                refined=bool(file["refined"]),
                scale_known=bool(file["scale_known"]),
                weak=file["weak"].astype(np.float64),
            )
            return SavedErrors(covariance, json.loads(str(file["sources"])), file["face"].astype(np.int64))
    except (OSError, KeyError, ValueError, BadZipFile) as error:
        raise InputError(f"{path} is missing or broken: run the inspection again.") from error
