"""Everything a finished inspection knows: what the report shows and results.json keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.camera import View
from inspect3d.compare.comparison import Comparison
from inspect3d.compare.deviation_region import DeviationRegion
from inspect3d.compare.feature_estimate import FeatureEstimate
from inspect3d.compare.sensitivity import Sensitivity
from inspect3d.deviate.deviation import Deviation
from inspect3d.deviate.map_covariance import MapCovariance
from inspect3d.figure import Figure
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import Status
from inspect3d.register.alignment import Alignment, Candidate

if TYPE_CHECKING:
    from inspect3d.nominal.nurbs import Nurbs
    from inspect3d.recipe import Recipe


@dataclass(frozen=True, eq=False)
class MeasuredPart:
    """How one measurement of the recipe ended.

    Parameters
    ----------
    name, method, provenance : of the measurement; provenance is the plugin's repr
    status, reason : how it ended; `reason` is a sentence, empty where all is well
    seconds : time per stage
    alignments : one per cloud that was aligned by itself; empty where there is no answer
    candidates : the poses considered, where the measurement ended ambiguous or failed
    deviation : the map, or None where there is none
    covariance : how the errors of the map hang together; None where there is no map
    sources : the files it was measured from, name by SHA-256
    regions : where the deviation stands out, largest volume first
    features : what the recipe asks for in marked places
    sensitivity : how much the map depends on the choice of the alignment; None where there is no map
    verdict : (n,) 0 none, 1 conform, 2 undecided, 3 nonconform, per node; None without a tolerance
    points_cad : (k, 3) mm, the measured points in the CAD frame in the order of the files; None for stereo methods
    point_deviation : (k,) mm, NaN where a point has none
    noise : mm, standard uncertainty of a measured point; None for stereo methods
    views : the cameras in the CAD frame; empty for methods without
    residual : (n,) normalised grey-level residual at the nodes of the mesh, NaN where there is none; None for clouds
    unresolved : (n,), nodes of the mesh whose shape is finer than the method resolves; None: it does not look for such
    hidden : the motions that the data cannot tell, in words
    contributions : of the method to the uncertainty: source, size with its unit, and how it enters
    figures : what the report shows of the way there
    surfaces : the measured surfaces in the CAD frame, of a method that moves such
    remarks : what was done that the reader must know, a sentence each
    """

    name: str
    method: str
    provenance: str
    status: Status
    reason: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict)
    alignments: tuple[Alignment, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    deviation: Deviation | None = None
    covariance: MapCovariance | None = None
    sources: Mapping[str, str] = field(default_factory=dict)
    regions: tuple[DeviationRegion, ...] = ()
    features: tuple[FeatureEstimate, ...] = ()
    sensitivity: Sensitivity | None = None
    verdict: Integers | None = None
    points_cad: Floats | None = None
    point_deviation: Floats | None = None
    noise: float | None = None
    views: tuple[View, ...] = ()
    residual: Floats | None = None
    unresolved: Booleans | None = None
    hidden: tuple[str, ...] = ()
    contributions: tuple[tuple[str, str, str], ...] = ()
    figures: tuple[Figure, ...] = ()
    surfaces: tuple[Nurbs, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class InputFile:
    """A file the inspection read: path relative to the recipe, and what was in it."""

    path: str
    sha256: str


@dataclass(frozen=True, eq=False)
class Record:
    """A finished inspection.

    Parameters
    ----------
    recipe : as validated
    nominal : the part as designed
    parts : how each measurement ended, in the recipe's order
    inputs : the files read
    versions : of inspect3d, Python and the libraries that computed the result
    warnings : what the recipe asked for and did not get, a sentence each
    comparisons : of every two measurements that have a map, in the recipe's order
    """

    recipe: Recipe
    nominal: Nominal
    parts: tuple[MeasuredPart, ...]
    inputs: tuple[InputFile, ...]
    versions: Mapping[str, str]
    warnings: tuple[str, ...] = ()
    comparisons: tuple[Comparison, ...] = ()
