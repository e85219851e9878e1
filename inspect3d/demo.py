"""The part that `inspect3d demo` inspects."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import inspect3d


@contextmanager
def demo_recipe() -> Iterator[Path]:
    """Return the recipe of the bracket: the repository's data set, or where there is none the same one made anew.

    A data set made anew lasts as long as the block.
    """
    recipe = Path(inspect3d.__file__).parents[1] / "datasets" / "bracket" / "recipe.toml"
    if recipe.exists():
        yield recipe
        return
    from inspect3d.virtual.datasets import make_dataset

    with TemporaryDirectory(prefix="inspect3d-demo-") as folder:
        make_dataset("bracket", Path(folder))
        yield Path(folder) / "recipe.toml"
