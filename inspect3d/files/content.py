"""What is in a file: its bytes, unpacked, and the format they are in."""

from __future__ import annotations

import bz2
import codecs
import gzip
import io
import re
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import IO

from inspect3d.outcome import InputError

FORMATS = {
    ".stl": "STL",
    ".ply": "PLY",
    ".obj": "OBJ",
    ".off": "OFF",
    ".3mf": "3MF",
    ".xyz": "text",
    ".asc": "text",
    ".txt": "text",
    ".csv": "text",
    ".pts": "PTS",
    ".ptx": "PTX",
    ".pcd": "PCD",
    ".e57": "E57",
    ".las": "LAS",
    ".laz": "LAS",
}
_HEAD = 4096
_LARGEST_UNPACKED = 2**30
_ENCODINGS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_SIGNATURES = (
    ("E57", re.compile(rb"ASTM-E57")),
    ("LAS", re.compile(rb"LASF")),
    ("PLY", re.compile(rb"ply[ \t]*[\r\n]")),
    ("PCD", re.compile(rb"\s*(#[^\n]*\n\s*)*(VERSION|FIELDS)\s")),
    ("OFF", re.compile(rb"\s*(#[^\n]*\n\s*)*(ST|C|N|4|n)*OFF\s")),
    ("STL", re.compile(rb"\s*solid\b.*?(facet\s+normal|endsolid)", re.DOTALL | re.IGNORECASE)),
)


@dataclass(frozen=True)
class Content:
    """A file that was opened.

    Parameters
    ----------
    path : as the user wrote it, for messages
    format : one of the values of FORMATS
    data : all bytes, unpacked; only the first ones for E57, whose library reads the file itself
    remarks : what the reader of the report must know about the file
    """

    path: Path
    format: str
    data: bytes
    remarks: tuple[str, ...] = ()

    def refused(self, what: str, advice: str = "Export it again.") -> InputError:
        """Return the error that says what is wrong with the file, as the rest of a sentence, and what to do."""
        return InputError(f"{self.path} {what}. {advice}")

    def text(self) -> bytes:
        """Return the bytes of a text file in UTF-8 without a byte order mark, lines ended by a newline."""
        data = self.data
        for mark, encoding in _ENCODINGS:
            if data.startswith(mark):
                try:
                    data = data.decode(encoding).encode()
                except UnicodeDecodeError as error:
                    raise self.refused(f"starts as {encoding} text and goes on otherwise") from error
                break
        return data if b"\n" in data else data.replace(b"\r", b"\n")


def opened(path: Path) -> Content:
    """Open a file, unpack it (.gz, .bz2, .zip with one file in it), and tell its format.

    The contents decide; the suffix does where they say nothing.

    Raises
    ------
    InputError
        There is no such file, it may not be read, it is empty, or its format is unknown.
    """
    if path.is_dir():
        raise InputError(f"{path} is a folder. Name a file in it.")
    if not path.exists():
        raise InputError(f"{path} does not exist. Check the path; a relative one starts at the folder of the recipe.")
    if not path.is_file():
        raise InputError(f"{path} is not a regular file. Save the data to a file first.")
    try:
        with path.open("rb") as stream:
            head = stream.read(_HEAD)
            if head.startswith(b"ASTM-E57"):
                return _told(path, path.name, head, path.stat().st_size)
            data = head + stream.read()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}. Check its permissions.") from error
    name, data = _unpacked(path, data)
    if not data[:_HEAD].strip() and not data.strip():
        raise InputError(f"{path} is empty. Export it again.")
    return _told(path, name, data, len(data))


def _told(path: Path, name: str, data: bytes, size: int) -> Content:
    suffix = PurePath(name).suffix.lower()
    by_name, by_contents = FORMATS.get(suffix), _signature(data, size)
    found = by_contents or by_name
    if found is None:
        raise InputError(f"{path} is of no known format. The known ones are {' '.join(FORMATS)}.")
    if by_name == found:
        return Content(path, found, data)
    return Content(path, found, data, (f"{path.name} is {found} by its contents and was read as such.",))


def _signature(data: bytes, size: int) -> str | None:
    head = data[:_HEAD]
    for name, pattern in _SIGNATURES:
        if pattern.match(head):
            return name
    if head.startswith(b"PK\x03\x04"):
        return "3MF"
    triangles = int.from_bytes(head[80:84], "little")
    return "STL" if triangles and size == 84 + 50 * triangles else None


def _unpacked(path: Path, data: bytes) -> tuple[str, bytes]:
    try:
        if data.startswith(b"\x1f\x8b"):
            return _stem(path, ".gz"), _limited(path, gzip.GzipFile(fileobj=io.BytesIO(data)))
        if data.startswith(b"BZh") and path.suffix.lower() not in FORMATS:
            return _stem(path, ".bz2"), _limited(path, bz2.BZ2File(io.BytesIO(data)))
        if data.startswith(b"PK\x03\x04"):
            return _only_member(path, data)
    except (OSError, EOFError, ValueError, zlib.error, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise InputError(f"{path} cannot be unpacked: {error}. Copy or pack it again.") from error
    return path.name, data


def _only_member(path: Path, data: bytes) -> tuple[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = [name for name in archive.namelist() if not name.startswith("__MACOSX/")]
        if any(name.lower().endswith(".model") for name in names):
            return path.name, data
        known = [name for name in names if PurePath(name).suffix.lower() in FORMATS]
        if len(known) != 1:
            raise InputError(f"{path} holds {len(known)} files of known formats. Unpack it and name one of them.")
        with archive.open(known[0]) as member:
            return known[0], _limited(path, member)


def _limited(path: Path, stream: io.BufferedIOBase | IO[bytes]) -> bytes:
    data = stream.read(_LARGEST_UNPACKED + 1)
    if len(data) > _LARGEST_UNPACKED:
        raise InputError(f"{path} is larger than 1 GiB when unpacked. Unpack it and name the file.")
    return bytes(data)


def _stem(path: Path, suffix: str) -> str:
    return path.stem if path.suffix.lower() == suffix else path.name
