"""The door every input file comes through."""

from __future__ import annotations

from pathlib import Path

from inspect3d.outcome import InputError

PICTURES = (".png", ".tif", ".tiff", ".jpg", ".jpeg")


def readable(path: Path, where: str) -> Path:
    """Return the path itself, if it is a file that can be read.

    Parameters
    ----------
    where : what names the file, to begin the error with; such as "part.cad"

    Raises
    ------
    InputError
        There is no such file, it is a folder or a device, or this user may not read it.
    """
    if not str(path).isprintable():
        raise InputError(f"{where}: {str(path)!r} holds control characters; no file is called so.")
    try:
        if path.is_dir():
            raise InputError(f"{where}: {path} is a folder; name a file in it.")
        if not path.exists():
            raise InputError(f"{where}: there is no file {path}.{_hint(path)}")
        if not path.is_file():
            raise InputError(f"{where}: {path} is not an ordinary file.")
        with path.open("rb"):
            return path
    except OSError as error:
        raise InputError(f"{where}: {path} cannot be read: {error.strerror}.") from error


def pictures_in(path: Path) -> tuple[Path, ...]:
    """Return the PNG, TIFF and JPEG files of a folder by name, or the path itself where it is no folder with such."""
    if not path.is_dir():
        return (path,)
    found = (each for each in path.iterdir() if each.suffix.lower() in PICTURES and each.is_file())
    return tuple(sorted(found)) or (path,)


def _hint(path: Path) -> str:
    from difflib import get_close_matches

    if not path.parent.is_dir():
        return f" Nor is there a folder {path.parent}."
    near = get_close_matches(path.name, [other.name for other in path.parent.iterdir() if other.is_file()], 1)
    return f" Did you mean {near[0]}?" if near else ""
