"""Numbers of a text, read fast and strictly."""

from __future__ import annotations

import re
import warnings

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.files.content import Content

_NUMBER = re.compile(rb"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?|[-+]?(inf|infinity|nan)(\(\w*\))?", re.IGNORECASE)


def numbers(content: Content, text: bytes) -> Floats:
    """Return the numbers between white space, (n,).

    Raises
    ------
    InputError
        A word among them is not a number; it is quoted.
    """
    text = text.strip()
    if not text:
        return np.zeros(0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return np.fromstring(text, dtype=np.float64, sep=" ")
    except (ValueError, DeprecationWarning) as error:
        word = next((word for word in text.split() if not _NUMBER.fullmatch(word)), b"?")
        shown = word[:40].decode("ascii", "replace")
        raise content.refused(f"has {shown!r} where a number is expected") from error
