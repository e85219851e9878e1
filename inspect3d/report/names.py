"""What the files of a measurement are called, whatever characters its name holds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

FORBIDDEN = frozenset('<>:"/\\|?*%')
LONGEST = 180
"""Bytes of a stem; with the suffixes a file name stays below the 255 that file systems allow."""


@dataclass(frozen=True)
class Stem:
    """The beginning of the file names of one measurement.

    Parameters
    ----------
    text : the measurement's name, with characters that a file name cannot hold as %XX
    cloud : the same for the measured points
    """

    text: str
    cloud: str

    def map_file(self, folder: Path) -> Path:
        """Return where the map lies."""
        return folder / f"{self.text}.vtp"

    def cloud_file(self, folder: Path) -> Path:
        """Return where the measured points lie."""
        return folder / f"{self.cloud}.vtp"

    def picture(self, what: str) -> str:
        """Return the file name of a picture."""
        return f"{self.text}_{what}.png"


def stems(names: Iterable[str]) -> dict[str, Stem]:
    """Return for each measurement the stem of its files; no two files are called alike.

    A plain name is its own stem. Where `a` has points and another measurement is called `a_points`, the map of the
    latter keeps the name and the points of the former are called `a%5Fpoints`.
    """
    texts = {name: _safe(name) for name in names}
    maps = set(texts.values())
    return {
        name: Stem(text, f"{text}%5Fpoints" if f"{text}_points" in maps else f"{text}_points")
        for name, text in texts.items()
    }


def _safe(name: str) -> str:
    text = "".join(character if _plain(character) else _escaped(character) for character in name)
    if text[:1] in (".", " ") or not text:
        text = _escaped(text[:1]) + text[1:]
    if text[-1:] in (".", " "):
        text = text[:-1] + _escaped(text[-1])
    if len(text.encode()) <= LONGEST:
        return text
    kept = text.encode()[: LONGEST - 20].decode(errors="ignore")
    return f"{kept}%{sha256(name.encode()).hexdigest()[:16]}"


def _plain(character: str) -> bool:
    return character not in FORBIDDEN and character.isprintable()


def _escaped(characters: str) -> str:
    return "".join(f"%{byte:02X}" for byte in characters.encode()) or "%"
