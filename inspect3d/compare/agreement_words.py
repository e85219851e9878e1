"""What a comparison shows, in sentences."""

from __future__ import annotations

from inspect3d.compare.comparison import Comparison
from inspect3d.compare.deviation_region import DeviationRegion

EXPECTED = 100 * 0.0455  # percent of a normal distribution beyond two standard deviations
TIGHT, LOOSE = 0.40, 0.60  # rms of E_n between which the stated uncertainties are taken for true


def agreement_words(comparison: Comparison, remarks: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return what a comparison of two maps shows, a sentence each; `remarks` on what was assumed are put last."""
    if comparison.mean is None or comparison.std is None or comparison.limits_of_agreement is None:
        return (comparison.reason,)
    low, high = comparison.limits_of_agreement
    words = [
        f"{comparison.a} and {comparison.b} both observed {100 * comparison.coverage:.0f} % of the area, edges not "
        f"counted ({comparison.nodes} nodes).",
        f"There {comparison.a} minus {comparison.b} is {_micro(comparison.mean)} on average with a standard deviation "
        f"of {_micro(comparison.std)}: about 95 % of the differences lie between {_micro(low)} and {_micro(high)} "
        f"(limits of agreement).{_correlated(comparison.correlation)}",
        comparison.gauge,
    ]
    if comparison.en_rms is None or comparison.en_above_1 is None:
        words.append(comparison.reason)
    else:
        words.append(_judged(comparison.en_rms, comparison.en_above_1))
    if comparison.regions is not None:
        words.append(_regions(comparison.regions))
    return (*words, *remarks)


def _correlated(correlation: float | None) -> str:
    return "" if correlation is None else f" The correlation of the two maps is {correlation:.2f}.".replace("-", "−")


def _judged(rms: float, above: float) -> str:
    found = (
        f"E_n has the root mean square {rms:.2f} (0.50 where both uncertainties are true) and lies above 1 at "
        f"{100 * above:.1f} % of the nodes ({EXPECTED:.1f} %)"
    )
    if rms > LOOSE:
        return f"{found}: the two differ by more than their stated uncertainties explain."
    if rms < TIGHT:
        return f"{found}: they agree, and better than their stated uncertainties lead to expect."
    return f"{found}: they agree within their stated uncertainties."


def _regions(regions: tuple[DeviationRegion, ...]) -> str:
    if not regions:
        return "No region stands out in which they differ beyond doubt (5 % for the whole part)."
    places = "; ".join(
        f"({', '.join(_number(x) for x in region.place)}) mm, {region.area:.0f} mm², {_micro(region.mean)} on average"
        for region in regions[:3]
    )
    count = "one region" if len(regions) == 1 else f"{len(regions)} regions"
    return f"They differ beyond doubt (5 % for the whole part) in {count}: {places}."


def _micro(length: float) -> str:
    return f"{_number(1000 * length)} µm"


def _number(value: float) -> str:
    return f"{value:.1f}".replace("-", "−")
