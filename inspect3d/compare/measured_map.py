"""What a comparison needs of a measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.map_covariance import MapCovariance


@dataclass(frozen=True, eq=False)
class MeasuredMap:
    """A map with how its errors hang together, and what it was measured from.

    Parameters
    ----------
    name : of the measurement
    deviation : on the inspection mesh
    covariance : of the observed nodes
    sources : the files it was measured from, name by SHA-256; maps that share one share its noise
    """

    name: str
    deviation: Deviation
    covariance: MapCovariance
    sources: Mapping[str, str] = field(default_factory=dict)
