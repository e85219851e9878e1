"""A feature of the deviation, as one method measured it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FeatureEstimate:
    """The height of a step, of a waviness or of scallops, with its uncertainty, or why it is not resolved.

    Parameters
    ----------
    name, kind : of the recipe: step, waviness or scallops
    value : mm; of a step, how much higher the side is that `across` points to; of the others, from valley to ridge;
        None where the data are too coarse to tell
    sigma : mm, standard uncertainty; None with the value
    count : readings used
    source : what they are: "points" of a cloud or "nodes" of the map
    spacing : mm, between neighbouring readings
    reason : why the feature is not resolved, a sentence; empty where it is
    """

    name: str
    kind: str
    value: float | None
    sigma: float | None
    count: int
    source: str
    spacing: float
    reason: str = ""

    @property
    def resolved(self) -> bool:
        """Return whether the data show the feature beyond their uncertainty."""
        return not self.reason
