"""How an inspection can end, in words a metrologist can act on."""

from __future__ import annotations

from enum import StrEnum


class InspectionError(Exception):
    """One or two sentences: what is wrong, where, and what to do."""


class InputError(InspectionError):
    """The recipe or one of its files is wrong; seen before anything was measured (exit status 2)."""


class MeasurementError(InspectionError):
    """A measurement has no answer; the others go on (exit status 1)."""


class Status(StrEnum):
    """How a measurement ended; a later member overrides an earlier one."""

    OK = "ok"
    SYMMETRIC = "symmetric"
    FREE_MOTIONS = "free_motions"
    AMBIGUOUS = "ambiguous"
    FAILED = "failed"

    @property
    def has_map(self) -> bool:
        """Tell whether a measurement that ended so has a deviation map."""
        return self not in (Status.AMBIGUOUS, Status.FAILED)

    @property
    def words(self) -> str:
        """Say what the status means for the reader of a report."""
        return _WORDS[self]


_WORDS = {
    Status.OK: "The measured points fix the pose of the part completely.",
    Status.SYMMETRIC: "The CAD model is symmetric: of the equal poses the one nearest to the start was taken.",
    Status.FREE_MOTIONS: "The measured points leave some motions of the part free; they were held at the start.",
    Status.AMBIGUOUS: "Several different poses explain the measured points equally well; choose one in the recipe.",
    Status.FAILED: "There is no result.",
}
