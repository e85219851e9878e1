"""Numbers as a metrologist writes them: no more digits than are known."""

from __future__ import annotations

import math

COVERAGE = 2
"""Coverage factor k of expanded uncertainties."""


def decimals(uncertainty: float) -> int:
    """Return the decimals at which an uncertainty shows two significant digits, at least 0 and at most 6.

    0.0123 and 0.095 both give 3; what is not positive gives 3, a micrometre.
    """
    if not (math.isfinite(uncertainty) and uncertainty > 0):
        return 3
    leading = math.floor(math.log10(float(f"{uncertainty:.1e}")))
    return min(max(1 - leading, 0), 6)


def number(value: float | None, places: int = 3, sign: bool = False) -> str:
    """Return a number with that many decimals and a true minus sign; a dash where it is not known."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:+.{places}f}" if sign else f"{value:.{places}f}"
    if not any(digit in text for digit in "123456789"):
        text = text.lstrip("+-")
    return text.replace("-", "−")


def grouped(count: int) -> str:
    """Return a count with its digits in groups of three, as ISO 80000-1 has them."""
    return f"{count:,}".replace(",", "\u202f")


def measured(value: float, sigma: float, unit: str = "mm") -> str:
    """Return value ± U (k = 2), both at the last digit that U warrants, such as "+0.123 ± 0.011 mm"."""
    if not math.isfinite(value):
        return "not measured"
    expanded = COVERAGE * sigma
    places = decimals(expanded)
    return f"{number(value, places, sign=True)} ± {number(expanded, places)} {unit}".rstrip()


def significant(value: float | None, digits: int = 2) -> str:
    """Return a number with that many significant digits and no power of ten unless it is far from one."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}g}"
    if "e" not in text:
        return text.replace("-", "−")
    mantissa, exponent = text.split("e")
    return f"{mantissa} × 10^{int(exponent)}".replace("-", "−")
