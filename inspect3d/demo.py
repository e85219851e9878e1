"""The virtual parts that `inspect3d demo` inspects."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

import inspect3d
from inspect3d.progress import Progress


class Demo(StrEnum):
    """What there is to see; the value is what the user types."""

    MILLED = "milled"
    SMOOTH = "smooth"
    BRACKET = "bracket"

    @property
    def dataset(self) -> str:
        """Return the name of its virtual dataset."""
        return {Demo.MILLED: "milled-study", Demo.SMOOTH: "smooth-nurbs", Demo.BRACKET: "bracket"}[self]


def demo_recipe(demo: Demo, folder: Path, progress: Progress) -> Path:
    """Return the recipe of a demo: the repository's dataset, or where there is none one made anew.

    Parameters
    ----------
    folder : where a dataset is made; what an earlier demo left there is replaced
    """
    shipped = Path(inspect3d.__file__).parents[1] / "datasets" / demo.dataset / "recipe.toml"
    if shipped.exists():
        return shipped
    from inspect3d.virtual.datasets import make_dataset

    with progress.stage(f"making the dataset {folder}"):
        make_dataset(demo.dataset, folder)
    return folder / "recipe.toml"
