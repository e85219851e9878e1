"""Which of a few picked pairs does not belong to the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.outcome import InspectionError

Answer = TypeVar("Answer")

APART = 5.0
"""Errors of the others by which a pair is off where they put it, before it stands out."""


@dataclass(frozen=True, eq=False)
class Fit(Generic[Answer]):
    """What pairs say.

    Parameters
    ----------
    answer : the fit, of all pairs or of all but the one that stands out
    errors : (n, v) how far each pair is off
    outlier : the number of the pair that stands out, or None
    words : what the user should know, or empty
    """

    answer: Answer
    errors: Floats
    outlier: int | None = None
    words: str = ""

    @property
    def rms(self) -> float:
        """Return the root mean square of the errors of the pairs that were used."""
        used = self.errors if self.outlier is None else np.delete(self.errors, self.outlier, axis=0)
        return float(np.sqrt((used**2).mean())) if used.size else 0.0

    def saying(self, words: str) -> Fit[Answer]:
        """Return the same with words to the user."""
        return replace(self, words=words)


def standing_out(
    count: int,
    fewest: int,
    fitted: Callable[[np.ndarray], Answer],
    errors: Callable[[Answer], Floats],
    fair: float,
) -> Fit[Answer]:
    """Return the fit of all pairs; or, if that is poor, of all but one that is far from where the others put it.

    Least squares spread the error of one wrong pair over all, so that the largest error need not be that pair's: each
    is left out in turn. It takes one pair more than the fit needs to see that one is wrong, and two to say which.

    Parameters
    ----------
    count : how many pairs
    fewest : how many a fit needs
    fitted : the fit of the pairs of the given numbers; raises an `InspectionError` where they do not fit
    errors : how far all pairs are off a fit, (n, v)
    fair : the largest error at which nothing is looked for

    Raises
    ------
    InspectionError
        Of the fit of all pairs, where leaving one out does not help.
    """
    everything = np.arange(count)
    whole, failure = None, None
    try:
        answer = fitted(everything)
        whole = Fit(answer, errors(answer))
    except InspectionError as error:
        failure = error
    if count < fewest + 2 or (whole is not None and whole.errors.max() <= fair):
        return _or_raise(whole, failure)
    fits = []
    for out in range(count):
        try:
            answer = fitted(np.delete(everything, out))
            fits.append(Fit(answer, errors(answer), out))
        except InspectionError:
            continue
    best = min(fits, key=lambda fit: fit.rms, default=None)
    if best is None or best.outlier is None or best.errors[best.outlier].max() < APART * max(best.rms, fair / 3):
        return _or_raise(whole, failure)
    return best


def _or_raise(fit: Fit[Answer] | None, failure: InspectionError | None) -> Fit[Answer]:
    if fit is None:
        raise failure or InspectionError("The pairs do not fit.")
    return fit
