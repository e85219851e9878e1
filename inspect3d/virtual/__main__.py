"""`python -m inspect3d.virtual NAME FOLDER [SEED]` makes a dataset."""

from __future__ import annotations

import sys
from pathlib import Path

from inspect3d.outcome import InputError
from inspect3d.virtual.datasets import DATASETS, make_dataset


def main(arguments: list[str]) -> None:
    """Make the dataset that the command line asks for."""
    if len(arguments) not in (2, 3) or not all(seed.isdigit() for seed in arguments[2:]):
        sys.exit(f"usage: python -m inspect3d.virtual {{{','.join(DATASETS)}}} FOLDER [SEED]")
    try:
        make_dataset(arguments[0], Path(arguments[1]), *map(int, arguments[2:]))
    except InputError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main(sys.argv[1:])
