"""A recipe as text: a page changes a key of it, and comments, order and all else stay as they are."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from inspect3d.outcome import InputError
from inspect3d.recipe import checked_recipe
from inspect3d.registry import build_for

Row = Mapping[str, Any]


def change_recipe(path: Path, change: Callable[[Any], None]) -> None:
    """Change a recipe; the new text is checked as a whole, and takes the place of the old one in one step.

    Parameters
    ----------
    path : the recipe
    change : given the document (tomlkit), changes it

    Raises
    ------
    InputError
        The recipe has become unreadable, the change makes it wrong, or the file cannot be written; it is as it was.
    """
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    try:
        document = tomlkit.parse(path.read_bytes().decode("utf-8-sig"))
    except (TOMLKitError, UnicodeDecodeError) as error:
        raise InputError(f"{path.name} is not valid TOML any more: {error}. Nothing was saved.") from error
    change(document)
    content = tomlkit.dumps(document).encode("utf-8")
    for table in checked_recipe(content, path).measurements:
        build_for(table)
    _replace(path.resolve(), content)


def _replace(target: Path, content: bytes) -> None:
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=".toml", dir=target.parent)
        fresh = Path(name)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            fresh.chmod(target.stat().st_mode & 0o777)
            fresh.replace(target)
        finally:
            fresh.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{target} cannot be written ({error.strerror}): nothing was saved.") from error


def measurement(document: Any, name: str) -> Any:
    """Return the table of a measurement in a document.

    Raises
    ------
    InputError
        There is none of that name.
    """
    for table in document.get("measurements", []):
        if table.get("name") == name:
            return table
    raise InputError(f"The recipe has no measurement {name!r} any more. Nothing was saved.")


def set_rows(table: Any, key: str, rows: Iterable[Row]) -> None:
    """Put rows under a key of a table: an array of inline tables, one on a line; no rows, no key.

    A key that is an array of tables, [[...]], becomes rows too: TOML writes the same thing in both ways.
    """
    import tomlkit

    array = tomlkit.array()
    for row in rows:
        inline = tomlkit.inline_table()
        for name, value in row.items():
            inline[name] = value
        array.append(inline)
    array.multiline(True)
    if len(array):
        table[key] = array
    elif key in table:
        del table[key]


def report_table(document: Any) -> Any:
    """Return the table [report] of a document, which is added where there is none."""
    import tomlkit

    if "report" not in document:
        document["report"] = tomlkit.table()
    return document["report"]
