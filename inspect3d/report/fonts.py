"""The fonts of pictures and PDF: one that is always there, and what the computer has for other scripts."""

from __future__ import annotations

from functools import cache
from pathlib import Path

FAMILIES = ("DejaVu Sans", "Noto Sans CJK SC", "Noto Sans CJK JP", "Source Han Sans", "WenQuanYi Micro Hei",
            "Microsoft YaHei", "PingFang SC", "Hiragino Sans", "Malgun Gothic", "Arial Unicode MS")  # fmt: skip
MONO = ("DejaVu Sans Mono", *FAMILIES[1:])


def font_folder() -> Path:
    """Return the folder of the DejaVu fonts that come with matplotlib."""
    from matplotlib import get_data_path

    return Path(get_data_path()) / "fonts" / "ttf"


@cache
def installed() -> tuple[str, ...]:
    """Return those of the families that this computer has, DejaVu first."""
    from matplotlib.font_manager import fontManager

    names = {entry.name for entry in fontManager.ttflist}
    return tuple(family for family in FAMILIES if family in names)


def unprintable(words: str) -> str:
    """Return the characters of a text, each once, for which none of the installed families has a sign."""
    from matplotlib.font_manager import FontProperties, findfont
    from matplotlib.ft2font import FT2Font

    missing = {character for character in words if character.isprintable() and ord(character) > 126}
    for family in installed():
        if missing:
            missing -= {chr(code) for code in FT2Font(findfont(FontProperties(family=[family]))).get_charmap()}
    return "".join(sorted(missing))
