"""Names that become file names, on every system the results may be copied to."""

from __future__ import annotations

FORBIDDEN = frozenset('<>:"/\\|?*')
RESERVED = frozenset(["con", "prn", "aux", "nul", *(f"{port}{k}" for port in ("com", "lpt") for k in range(1, 10))])
"""Names of devices on Windows, with any ending."""


def file_name(name: str) -> str:
    """Return the name itself, if a file can be called so.

    Raises
    ------
    ValueError
        It holds a path separator or another character no file name may have, is empty, too long or reserved.
    """
    if not 1 <= len(name.encode(errors="replace")) <= 100:
        raise ValueError("it becomes a file name and has 1 to 100 letters")
    wrong = sorted({letter for letter in name if letter in FORBIDDEN or not letter.isprintable()})
    if wrong:
        raise ValueError(f"{name!r} becomes a file name and cannot hold {' '.join(map(repr, wrong))}")
    if name != name.strip(" ."):
        raise ValueError(f"{name!r} becomes a file name and cannot begin or end with a blank or a dot")
    if name.split(".")[0].casefold() in RESERVED:
        raise ValueError(f"{name!r} becomes a file name, and Windows reserves it for a device")
    return name
