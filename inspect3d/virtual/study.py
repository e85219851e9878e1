"""A virtual part measured by several instruments: their datasets side by side, and one recipe that compares them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from inspect3d.outcome import InputError
from inspect3d.virtual.dataset import Dataset
from inspect3d.virtual.part import Part
from inspect3d.virtual.picture_dataset import PictureDataset


@dataclass(frozen=True, eq=False)
class Study:
    """Datasets of one part, each in a folder of its own, with its truth, where it can be inspected alone too.

    Parameters
    ----------
    part : as designed
    datasets : by the name of the folder; all of this part
    recipe : text of recipe.toml; it names part.step, and the files of a dataset as folder/file
    """

    part: Part
    datasets: Mapping[str, Dataset | PictureDataset]
    recipe: str

    def write(self, folder: Path, seed: int) -> None:
        """Measure with every instrument, and write the folders, part.step and recipe.toml; existing ones are replaced.

        Raises
        ------
        InputError
            The folder cannot be written.
        """
        for name, dataset in self.datasets.items():
            dataset.write(folder / name, seed)
        try:
            (folder / "recipe.toml").write_text(self.recipe, encoding="utf-8")
        except OSError as error:
            raise InputError(f"{folder} cannot be written: {error.strerror}. Choose another folder.") from error
        self.part.write_step(folder / "part.step")
