"""What a page is to the server: files that never change, and answers to requests."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from inspect3d.outcome import InputError

KINDS = {
    "html": "text/html; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "css": "text/css; charset=utf-8",
}


@dataclass(frozen=True)
class Request:
    """What a page asks: a name such as "maps", its parameters, and for a POST the JSON it sends."""

    name: str
    query: Mapping[str, str]
    body: Any = None

    def index(self, key: str, count: int) -> int:
        """Return a parameter that chooses one of `count` things.

        Raises
        ------
        InputError
            It is missing, no number, or there is no such thing.
        """
        text = self.query.get(key, "")
        if not (text.isascii() and text.isdigit() and len(text) < 10 and int(text) < count):
            raise InputError(f"{key} = {text!r} chooses none of {count}.")
        return int(text)

    def number(self, key: str) -> float:
        """Return a parameter that is a finite number.

        Raises
        ------
        InputError
            It is none.
        """
        try:
            value = float(self.query[key])
        except (KeyError, ValueError):
            raise InputError(f"{key} is no number.") from None
        if not math.isfinite(value):
            raise InputError(f"{key} is no finite number.")
        return value


@dataclass(frozen=True)
class Answer:
    """What the server sends back."""

    body: bytes
    kind: str

    @classmethod
    def json(cls, value: Any) -> Answer:
        """Return plain lists, numbers and strings as JSON; NaN is not allowed."""
        return cls(json.dumps(value, allow_nan=False).encode(), "application/json")

    @classmethod
    def arrays(cls, **arrays: NDArray[Any]) -> Answer:
        """Return arrays of 32-bit or 8-bit numbers: the length of a header, the header (JSON), and their bytes.

        The header gives for each its name, kind and count; each begins at a multiple of four bytes.
        """
        header, parts = [], []
        for name, values in arrays.items():
            little = np.ascontiguousarray(values)
            little = little.astype(little.dtype.newbyteorder("<"), copy=False)
            header.append({"name": name, "kind": little.dtype.name, "count": int(little.size)})
            raw = little.tobytes()
            parts.append(raw + b"\0" * (-len(raw) % 4))
        text = json.dumps(header).encode()
        text += b" " * (-len(text) % 4)
        return cls(b"".join([np.uint32(len(text)).astype("<u4").tobytes(), text, *parts]), "application/octet-stream")


@dataclass(frozen=True)
class Page:
    """A page and what it may ask.

    Parameters
    ----------
    title : for the terminal, "view" or "pick"
    assets : names of its files: the page itself first, then scripts and styles
    get : what it may read, by name
    post : what it may change, by name
    """

    title: Literal["view", "pick"]
    assets: tuple[str, ...]
    get: Mapping[str, Callable[[Request], Answer]]
    post: Mapping[str, Callable[[Request], Answer]]

    def asset(self, name: str) -> Answer | None:
        """Return one of the files; None for every other name, so that no path can lead elsewhere."""
        name = name or self.assets[0]
        if name not in self.assets:
            return None
        shared = files("inspect3d.report") / "templates" / name
        own = files("inspect3d.web") / "assets" / name
        return Answer((own if own.is_file() else shared).read_bytes(), KINDS[name.rpartition(".")[2]])
