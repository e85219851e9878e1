"""The pieces a report is made of: what HTML and PDF both show, without a word of either's markup."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Literal

Column = Literal["text", "name", "figure", "number", "code", "hash"]


@dataclass(frozen=True)
class Badge:
    """A result in a word; `colour` names it: conform, undecided, nonconform, failed, ambiguous, measured, none."""

    words: str
    colour: str


@dataclass(frozen=True)
class Link:
    """Words that lead to a chapter of the report."""

    words: str
    anchor: str


Cell = str | Badge | Link


@dataclass(frozen=True)
class Paragraph:
    """Running text; `lead` is set bold before it."""

    words: str
    lead: str = ""


@dataclass(frozen=True)
class Judgement:
    """A verdict in a word and a sentence, as it stands at the head of the report."""

    badge: Badge
    words: str


@dataclass(frozen=True)
class Heading:
    """The title of what follows within a chapter."""

    words: str


@dataclass(frozen=True)
class Note:
    """What the reader must not miss; `mood` is doubt or bad."""

    lead: str
    lines: tuple[str, ...]
    mood: Literal["doubt", "bad"] = "doubt"


@dataclass(frozen=True)
class Bullets:
    """Sentences that stand beside each other."""

    lines: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """Rows of cells; `head` may be empty, `columns` say how each column is set."""

    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    columns: tuple[Column, ...]

    def __post_init__(self) -> None:
        if any(len(row) != len(self.columns) for row in (*self.rows, self.head or self.columns)):
            raise ValueError("every row of a table has as many cells as it has columns")


@dataclass(frozen=True)
class Tiles:
    """The key figures: what, and how much."""

    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Share:
    """A piece of a bar: how much of it, which colour (red, green, blue), and what it stands for."""

    percent: float
    colour: tuple[int, int, int]
    words: str


@dataclass(frozen=True)
class Shares:
    """A bar that shows how a whole is divided."""

    parts: tuple[Share, ...]


@dataclass(frozen=True)
class Picture:
    """A picture: its file in the folder `pictures`, and what it shows."""

    file: str
    words: str


@dataclass(frozen=True)
class Code:
    """Text whose characters and lines stand as they are."""

    words: str


@dataclass(frozen=True)
class Folded:
    """What a screen shows on request, and paper always."""

    title: str
    blocks: tuple[Block, ...]
    open: bool = False


@dataclass(frozen=True)
class Beside:
    """Blocks in two columns."""

    left: tuple[Block, ...]
    right: tuple[Block, ...]


Block = Paragraph | Judgement | Heading | Note | Bullets | Table | Tiles | Shares | Picture | Code | Folded | Beside


@dataclass(frozen=True)
class Chapter:
    """A chapter: its place in the report, its title, a badge beside it, and what it holds."""

    anchor: str
    title: str
    blocks: tuple[Block, ...]
    badge: Badge | None = None


@dataclass(frozen=True)
class Document:
    """A whole report.

    Parameters
    ----------
    title : the part's name
    under : the line below the title
    front : what a reader sees first: the verdict, the worst places, how far the methods agree
    chapters : the rest
    """

    title: str
    under: str
    front: Chapter
    chapters: tuple[Chapter, ...]


def numbers(count: int) -> list[Column]:
    """Return the columns of so many figures."""
    return ["number" for _ in range(count)]


def table_of(pairs: Sequence[tuple[str, str]]) -> Table:
    """Return a table of labels and figures."""
    return Table((), tuple(pairs), ("text", "number"))


def as_data(document: Document) -> dict[str, Any]:
    """Return a document as JSON has it: every piece with its `kind`, every picture with its number."""
    data: dict[str, Any] = _plain(document)
    for number, picture in enumerate(_pictures(data), start=1):
        picture["number"] = number
    return data


def numbered_files(data: dict[str, Any]) -> dict[int, str]:
    """Return the files of a document's pictures by their numbers."""
    return {picture["number"]: picture["file"] for picture in _pictures(data)}


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        kept = {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
        return {"kind": type(value).__name__.lower(), **kept}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value


def _pictures(value: Any) -> list[dict[str, Any]]:
    if isinstance(value, dict):
        if value["kind"] == "picture":
            return [value]
        return [each for inner in value.values() for each in _pictures(inner)]
    return [each for inner in value for each in _pictures(inner)] if isinstance(value, list) else []
