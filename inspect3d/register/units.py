"""Whether a cloud in other units would fit the CAD better than in the declared ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from inspect3d.arrays import Floats

FACTORS = (10.0, 25.4, 100.0, 1000.0)
_WORDS = {
    1e-3: "a thousandth",
    1e-2: "a hundredth",
    1 / 25.4: "1/25.4",
    1e-1: "a tenth",
    10.0: "10 times",
    25.4: "25.4 times",
    100.0: "100 times",
    1000.0: "1000 times",
}


def other_factors(points: Floats, diagonal: float) -> Iterator[float]:
    """Return the factors by which units are commonly off that bring the cloud to the size of the CAD, likeliest first.

    A cloud scaled so that its extent is between 5 % and 300 % of the CAD's diagonal (mm) is worth a try.
    """
    low, high = np.percentile(points, [1, 99], axis=0)
    extent = float(np.linalg.norm(high - low))
    factors = [*FACTORS, *(1 / factor for factor in FACTORS)]
    ratios = {factor: factor * extent / diagonal for factor in factors}
    likely = [factor for factor in factors if 0.05 < ratios[factor] < 3.0]
    yield from sorted(likely, key=lambda factor: abs(np.log(ratios[factor] / 0.8)))


def unit_hint(
    points: Floats, diagonal: float, fits: bool, free: int, registers: Callable[[float], tuple[bool, int]]
) -> str | None:
    """Return a sentence naming the unit error, or None where the declared units are as good as any.

    Parameters
    ----------
    points : (n, 3) mm, in the declared units
    diagonal : of the CAD, mm
    fits, free : whether the cloud registers as declared, and how many motions it then leaves free
    registers : the same for the cloud times a factor
    """
    for factor in other_factors(points, diagonal):
        other_fits, other_free = registers(factor)
        if other_fits and (not fits or other_free < free):
            return (
                f"Its coordinates fit the CAD at {_WORDS[factor]} the declared size: the units of the scan or of the "
                f"CAD are probably wrong (mm, cm, m and inch differ by 10, 25.4, 100 or 1000); correct `units`."
            )
    return None
