"""What an inspection says about itself while it runs, and how long each stage took."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from time import perf_counter
from typing import Protocol


class Display(Protocol):
    """Where stages are shown; they nest, and `update` and `end` speak of the innermost."""

    def begin(self, words: str) -> None:
        """Show that a stage begins."""

    def update(self, fraction: float, words: str = "") -> None:
        """Show how much of the stage is done, from 0 to 1, and what it is at."""

    def end(self) -> None:
        """Show that the stage is over."""


class Silent:
    """A display that shows nothing."""

    def begin(self, words: str) -> None:
        """Show nothing."""

    def update(self, fraction: float, words: str = "") -> None:
        """Show nothing."""

    def end(self) -> None:
        """Show nothing."""


@dataclass(frozen=True)
class Progress:
    """The stages of an inspection as they go by.

    A stage has words ("registering") and may have a subject, the measurement it belongs to ("laser"). Stages may
    nest; each counts its own whole time, and stages of the same words add up.

    Parameters
    ----------
    display : where the stages are shown; the default shows nothing
    seconds : for each subject the seconds of each stage so far; stages without a subject stand under ""
    """

    display: Display = field(default_factory=Silent)
    seconds: defaultdict[str, dict[str, float]] = field(default_factory=lambda: defaultdict(dict))

    @contextmanager
    def stage(self, words: str, subject: str = "") -> Iterator[None]:
        """Show a stage while the block runs, and record its seconds whether it ends well or not."""
        start = perf_counter()
        self.display.begin(f"{subject}: {words}" if subject else words)
        before = _running.set(self)
        try:
            yield
        finally:
            _running.reset(before)
            self.display.end()
            past = self.seconds[subject].get(words, 0.0)
            self.seconds[subject][words] = past + perf_counter() - start

    def update(self, fraction: float, words: str = "") -> None:
        """Say how much of the running stage is done, from 0 to 1, and what it is at."""
        self.display.update(fraction, words)


_running: ContextVar[Progress] = ContextVar("running")


def running() -> Progress:
    """Return the progress of the stage that is running, for what is too deep in it to be handed one: a plugin."""
    return _running.get(Progress())
