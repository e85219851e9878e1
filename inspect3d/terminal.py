"""Progress on standard error: a live line on a terminal, a plain line for a long stage elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Timer
from typing import TYPE_CHECKING, TextIO

from inspect3d.progress import Progress

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

PATIENCE = 1.0
"""Seconds after which a stage is worth a line."""


@contextmanager
def terminal(stream: TextIO) -> Iterator[Progress]:
    """Return a progress that is shown on a stream while the block runs."""
    if not stream.isatty():
        yield Progress(Lines(stream))
        return
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[at]}", markup=False),
    )
    with Bars(*columns, console=Console(file=stream), transient=True) as bars:
        yield Progress(Live(bars))


@dataclass(frozen=True)
class Live:
    """A line with a bar for each running stage; gone when the stage is over."""

    bars: Bars
    tasks: list[TaskID] = field(default_factory=list)

    def begin(self, words: str) -> None:
        """Add a line."""
        self.tasks.append(self.bars.add_task(words, total=None, at=""))

    def update(self, fraction: float, words: str = "") -> None:
        """Fill the bar of the innermost stage."""
        self.bars.update(self.tasks[-1], total=1.0, completed=fraction, at=words)

    def end(self) -> None:
        """Take the line away."""
        self.bars.remove_task(self.tasks.pop())


@dataclass(frozen=True)
class Lines:
    """A line for each stage that lasts longer than a second; for logs and pipes."""

    stream: TextIO
    timers: list[Timer] = field(default_factory=list)

    def begin(self, words: str) -> None:
        """Write the stage's words in a second, unless it is over by then."""
        timer = Timer(PATIENCE, print, [f"{words} ..."], {"file": self.stream, "flush": True})
        timer.daemon = True
        timer.start()
        self.timers.append(timer)

    def update(self, fraction: float, words: str = "") -> None:
        """Write nothing: a log has no bars."""

    def end(self) -> None:
        """Keep a short stage out of the log."""
        self.timers.pop().cancel()
