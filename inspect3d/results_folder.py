"""The folder of results: written beside its place, and put there once all is well."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from inspect3d.outcome import InputError


@contextmanager
def replaced(out: Path) -> Iterator[Path]:
    """Give a new folder beside `out` to write into, and put it in the place of `out` once the block has ended well.

    Raises
    ------
    InputError
        `out` is there and is no folder of results, or cannot be written.
    """
    out = Path(os.path.abspath(out))
    if out.exists() and not _may_be_replaced(out):
        raise InputError(f"{out} is not a folder of results: choose another one, or remove it yourself.")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror}. Choose another folder.") from error
    try:
        folder.chmod(0o755)
        yield folder
        if out.exists():
            former = folder.with_name(folder.name + "-former")
            out.rename(former)
            folder.rename(out)
            shutil.rmtree(former)
        else:
            folder.rename(out)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _may_be_replaced(out: Path) -> bool:
    """Tell whether `out` is a folder that is empty or holds the results of an earlier run."""
    return out.is_dir() and (not any(out.iterdir()) or (out / "results.json").is_file())
