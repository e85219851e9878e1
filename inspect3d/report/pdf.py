"""The report as a PDF."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from inspect3d.report.blocks import Document, as_data, numbered_files
from inspect3d.report.fonts import FAMILIES, MONO, font_folder, unprintable
from inspect3d.report.page import asset

SHORT = ("rule", "provenance")
"""Chapters that begin on the page where the one before ends."""


def pdf(document: Document, pictures: Path, moment: datetime) -> bytes:
    """Return the report as PDF, A4: the same document, pictures and moment give the same bytes on a machine.

    What the document says reaches typst as strings of a JSON text, so nothing in it can be markup.

    Parameters
    ----------
    document : the report
    pictures : the folder where its pictures lie
    moment : the date in the file's own description
    """
    import typst

    data = as_data(document)
    words = json.dumps(data, ensure_ascii=False)
    missing = unprintable(words)
    content = {"document": data, "fonts": FAMILIES, "mono": MONO, "note": _note(missing), "after": SHORT}
    with TemporaryDirectory() as root:
        _put_pictures(data, pictures, Path(root))
        compiler = typst.Compiler(
            asset("report.typ").encode(),
            root=root,
            font_paths=typst.Fonts(font_paths=[font_folder()]),
            sys_inputs={"content": json.dumps(content, ensure_ascii=False)},
        )
        made = compiler.compile(format="pdf", timestamp=moment.replace(microsecond=0))
    if not isinstance(made, bytes):
        raise TypeError("typst wrote no single PDF")
    return made


def _put_pictures(data: dict[str, Any], pictures: Path, root: Path) -> None:
    """Put the pictures of a document into the folder that typst reads, as JPEG: a third of their size as PNG."""
    from PIL import Image

    for number, file in numbered_files(data).items():
        with Image.open(pictures / file) as image:
            image.convert("RGB").save(root / f"{number}.jpg", quality=92, subsampling=0)


def _note(missing: str) -> str:
    if not missing:
        return ""
    codes = ", ".join(f"U+{ord(character):04X}" for character in missing[:12])
    more = f" and {len(missing) - 12} more" if len(missing) > 12 else ""
    return (
        f"This computer has no font for some characters ({codes}{more}), which show as boxes here; the HTML report has "
        "them. Install a font that does, such as Noto Sans CJK (Debian: fonts-noto-cjk), and write the report again."
    )
