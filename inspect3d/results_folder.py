"""The folder of results: written beside its place, and put there once all is well."""

from __future__ import annotations

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
        `out` is there and is no folder of results, before the block or after it, or cannot be written.
    """
    out = out.resolve()
    _require_results(out)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror}. Choose another folder.") from error
    try:
        folder.chmod(0o755)
        yield folder
        _require_results(out)
        _put(folder, out)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _put(folder: Path, out: Path) -> None:
    """Give a folder the name `out`; what is there goes once it has it, and stays where that fails."""
    former = folder.with_name(folder.name + "-former")
    try:
        if out.exists():
            out.rename(former)
        folder.rename(out)
    finally:
        if former.exists() and not out.exists():
            former.rename(out)
    shutil.rmtree(former, ignore_errors=True)


def _require_results(out: Path) -> None:
    """Refuse a folder that is there and is neither empty nor holds the results of an earlier run."""
    if out.exists() and not (out.is_dir() and (not any(out.iterdir()) or (out / "results.json").is_file())):
        raise InputError(f"{out} is not a folder of results: choose another one, or remove it yourself.")
