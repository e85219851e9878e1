"""Scans: point clouds that a scanner has already measured."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from inspect3d.files.cloud import CloudFile, read_cloud
from inspect3d.measure import Cloud, Files, Measurement
from inspect3d.nominal.nominal import Nominal
from inspect3d.recipe_types import Unit

Frames = Literal["one", "separate"]
_MILLIMETRES: dict[str, float] = {"um": 0.001, "mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}


@dataclass(frozen=True, eq=False)
class ScanSource:
    """The clouds of the files, in mm; its `str` is one line."""

    clouds: tuple[Cloud, ...]
    remarks: tuple[str, ...]

    def __str__(self) -> str:
        points = sum(len(cloud) for cloud in self.clouds)
        low = np.min([cloud.points.min(axis=0) for cloud in self.clouds], axis=0)
        high = np.max([cloud.points.max(axis=0) for cloud in self.clouds], axis=0)
        extents = " x ".join(f"{length:.5g}" for length in high - low)
        names = ", ".join(cloud.name for cloud in self.clouds)
        return f"{points} points, {extents} mm ({names})"


@dataclass(frozen=True)
class Scan:
    """Read scan files; the points are the measurement.

    Parameters
    ----------
    units : of the coordinates in the files; decisive, also where a format fixes its unit
    noise : standard uncertainty of a point along the surface normal, mm; None: estimated from the cloud
    noise_length : mm, over which the noise of neighbouring points is alike, exp(-r² / 2 L²); wants `noise`
    frames : "one": the files share a frame and are one cloud; "separate": each file is aligned by itself
    """

    units: Unit = "mm"
    noise: float | None = None
    noise_length: float = 0.0
    frames: Frames = "one"

    def __post_init__(self) -> None:
        if self.units not in get_args(Unit):
            raise ValueError(f"units = {self.units!r} is not known: choose one of {', '.join(get_args(Unit))}")
        if self.frames not in get_args(Frames):
            raise ValueError(f"frames = {self.frames!r} is not known: choose one of {', '.join(get_args(Frames))}")
        if self.noise is not None and not _is_noise(self.noise):
            raise ValueError(f"noise = {self.noise!r} is not a standard noise: give a positive number in mm, or none")
        if self.noise_length and not _is_noise(self.noise_length):
            raise ValueError(f"noise_length = {self.noise_length!r} is no length: give a positive number, mm, or none")
        if self.noise_length and self.noise is None:
            raise ValueError("noise_length wants noise too: what neighbours share does not show in their scatter")

    def open(self, files: Files) -> ScanSource:
        """Read all files of the key `files`.

        Raises
        ------
        InputError
            A file is missing, broken or no point cloud.
        """
        clouds: list[Cloud] = []
        remarks: list[str] = []
        for path in files["files"]:
            file = read_cloud(path)
            remarks += file.remarks
            if file.units not in (None, self.units):
                remarks.append(
                    f"{path.name} is in {file.units} by its format, and was read in {self.units} as the recipe says."
                )
            clouds.append(self._cloud(path.name, file))
        if self.frames == "one":
            clouds = [self._joined(clouds)]
        return ScanSource(tuple(clouds), tuple(remarks))

    def __call__(self, source: ScanSource, nominal: Nominal) -> Measurement:
        """Return the clouds as they were scanned, in the frame of the instrument."""
        alike = (
            f"Points share their noise over {self.noise_length:g} mm, as the recipe says: a node averages it little."
        )
        return Measurement(source.clouds, remarks=(*source.remarks, *([alike] if self.noise_length else [])))

    def _cloud(self, name: str, file: CloudFile) -> Cloud:
        return Cloud(
            name, file.points * _MILLIMETRES[self.units], file.normals, self.noise, noise_length=self.noise_length
        )

    def _joined(self, clouds: list[Cloud]) -> Cloud:
        """Return all points as one cloud; those of a file without normals get zero ones, if others have them."""
        if len(clouds) == 1:
            return clouds[0]
        normals = None
        if any(cloud.normals is not None for cloud in clouds):
            given = [np.zeros((len(cloud), 3)) if cloud.normals is None else cloud.normals for cloud in clouds]
            normals = np.concatenate(given)
        points = np.concatenate([cloud.points for cloud in clouds])
        return Cloud(
            ", ".join(cloud.name for cloud in clouds), points, normals, self.noise, noise_length=self.noise_length
        )


def _is_noise(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < math.inf
