"""A virtual measurement as a folder: CAD, scan, truth and a recipe to run on them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inspect3d.outcome import InputError
from inspect3d.virtual.deviation_field import DeviationField
from inspect3d.virtual.laser_scanner import LaserScanner
from inspect3d.virtual.part import Part
from inspect3d.virtual.ply import write_ply
from inspect3d.virtual.truth import Truth


@dataclass(frozen=True, eq=False)
class Dataset:
    """What a virtual measurement consists of.

    Parameters
    ----------
    part : as designed
    deviation : how the real part differs from it
    scanner : how it is measured, and in which pose
    recipe : text of recipe.toml; it names part.step and scan.ply
    """

    part: Part
    deviation: DeviationField
    scanner: LaserScanner
    recipe: str

    def write(self, folder: Path, seed: int) -> Truth:
        """Measure, and write part.step, scan.ply, truth.json and recipe.toml into a folder; existing ones are replaced.

        Raises
        ------
        InputError
            The folder cannot be written.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
            scan = self.scanner(self.part.surface(), self.deviation, seed)
            truth = Truth(self.deviation, scan.scan_from_cad, scan.noise, np.flatnonzero(scan.foreign), seed)
            write_ply(folder / "scan.ply", scan.points_scan)
            truth.write(folder / "truth.json")
            (folder / "recipe.toml").write_text(self.recipe, encoding="utf-8")
        except OSError as error:
            raise InputError(f"{folder} cannot be written: {error.strerror}. Choose another folder.") from error
        self.part.write_step(folder / "part.step")
        return truth
