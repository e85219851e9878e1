"""What is true about a virtual measurement, kept beside its files as truth.json."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inspect3d.arrays import Integers, integers
from inspect3d.outcome import InputError
from inspect3d.pose import Pose
from inspect3d.virtual.deviation_field import DeviationField, described, field_of


@dataclass(frozen=True, eq=False)
class Truth:
    """The truth about a dataset.

    Parameters
    ----------
    deviation : how the part differs from its CAD; at nodes (n, 3) mm of the inspection mesh, `deviation(nodes)` is
        the true map, (n,) mm
    scan_from_cad : the pose of the part before the instrument
    noise : mm, standard noise of a point
    foreign : indices of the points that are not of the part, in the order of the scan file
    seed : of the scan
    """

    deviation: DeviationField
    scan_from_cad: Pose
    noise: float
    foreign: Integers
    seed: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "foreign", integers(self.foreign, "foreign", None))

    @property
    def cad_from_scan(self) -> Pose:
        """Return the pose that an alignment should find."""
        return self.scan_from_cad.inverse()

    def write(self, path: Path) -> None:
        """Write the truth as JSON."""
        content = {
            "schema": 1,
            "cad_from_scan": self.cad_from_scan.matrix.tolist(),
            "scan_from_cad": self.scan_from_cad.matrix.tolist(),
            "deviation": described(self.deviation),
            "noise": self.noise,
            "seed": self.seed,
            "foreign": self.foreign.tolist(),
        }
        lines = (f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in content.items())
        path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> Truth:
        """Read what `write` wrote.

        Raises
        ------
        InputError
            The file is not there, or is no truth.
        """
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            return cls(
                deviation=field_of(content["deviation"]),
                scan_from_cad=Pose.from_matrix(np.array(content["scan_from_cad"])),
                noise=float(content["noise"]),
                foreign=np.array(content["foreign"], dtype=np.int64),
                seed=int(content["seed"]),
            )
        except (OSError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path} holds no truth of a virtual measurement: {error}") from error
