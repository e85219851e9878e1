"""Stage 2, the measuring method: what a plugin is given, and what it hands back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, runtime_checkable

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers, booleans, floats, integers
from inspect3d.camera import View
from inspect3d.figure import Figure
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import InputError
from inspect3d.pose import Pose

if TYPE_CHECKING:
    from inspect3d.nominal.nurbs import Nurbs


@dataclass(frozen=True)
class Files:
    """The files a recipe names for one measurement, by the recipe's key (`files`, `images`, `cameras`, ...).

    Parameters
    ----------
    folder : where the recipe lies; relative paths start here
    paths : for each key the files in the recipe's order, existing ones
    """

    folder: Path
    paths: Mapping[str, tuple[Path, ...]]

    def __getitem__(self, key: str) -> tuple[Path, ...]:
        """Return the files of a key.

        Raises
        ------
        InputError
            The recipe names none.
        """
        if not self.paths.get(key):
            raise InputError(f"The measurement names no `{key}`: add {key} = [...] to its table in the recipe.")
        return self.paths[key]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Measured points in one frame, aligned to the CAD as one body.

    Parameters
    ----------
    name : what to call it in messages, a file name or several
    points : (n, 3) mm
    normals : (n, 3), unit, out of the material as far as the instrument knows; zero or None where it does not
    noise : standard uncertainty of a point along the surface normal, mm; None: to be estimated from the cloud
    shares : (n,), standard uncertainty of each point as a share of the usual one; None: all are alike
    noise_length : mm, over which the noise of neighbouring points is alike; 0: every point has its own
    """

    name: str
    points: Floats
    normals: Floats | None = None
    noise: float | None = None
    shares: Floats | None = None
    noise_length: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", floats(self.points, "points", None, 3))
        if self.normals is not None:
            object.__setattr__(self, "normals", floats(self.normals, "normals", len(self.points), 3))
        if self.noise is not None and not self.noise > 0:
            raise ValueError(f"the noise of a cloud is positive, not {self.noise}")
        if self.shares is not None:
            object.__setattr__(self, "shares", floats(self.shares, "shares", len(self.points)))
            if not (self.shares > 0).all():
                raise ValueError("the uncertainty of a point is positive")
        if self.noise_length and self.noise is None:
            raise ValueError("noise that neighbouring points share cannot be found from their scatter: give it")

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points)


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a method measured, before it is aligned to the CAD.

    Parameters
    ----------
    clouds : one or more, each aligned by itself; a point belongs to exactly one
    frame : "instrument" (to be aligned) or "cad" (already there; a start "auto" then begins at the identity)
    scale_known : False where the method cannot see the scale (COLMAP without cameras)
    scale_sigma : relative standard uncertainty of a known scale
    views : the cameras in the frame and scale of the points, if the method has any
    remarks : what was done to the data that the report must say, a sentence each
    """

    clouds: tuple[Cloud, ...]
    frame: Literal["instrument", "cad"] = "instrument"
    scale_known: bool = True
    scale_sigma: float = 0.0
    views: tuple[View, ...] = ()
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.clouds:
            raise ValueError("a measurement holds at least one cloud")

    @property
    def points(self) -> Floats:
        """Return all points (n, 3) mm in the order of the clouds."""
        return np.concatenate([cloud.points for cloud in self.clouds])


class FieldCovariance(Protocol):
    """The covariance of a field at k nodes, as what it does: of many nodes it is too large to write down."""

    @property
    def variances(self) -> Floats:
        """Return its diagonal, (k,) mm²."""

    def covariance(self, columns: Floats) -> Floats:
        """Return it times columns (k, m)."""


@dataclass(frozen=True, eq=False)
class NodalMeasurement:
    """What a method measured that moves the nodes of the inspection mesh themselves, before the common alignment.

    Parameters
    ----------
    node : (k,) numbers of the nodes that it moved
    value : (k,) mm, their deviations; the rigid motion in them is the method's own choice unless `placed`
    sound : (k,), whether the deviation can be trusted
    uncertainty : of `value`
    cad_from_measured : where the method found the part in the frame of its instrument
    placed : whether the instrument's frame was known to be the CAD's, so that a rigid motion in `value` is measured
    scale_known : False where the method cannot tell a larger part from a smaller one
    symmetric : whether the part would look the same in another place, of which the method took one
    views : the cameras in the CAD frame, if it has any
    residual : (n,) normalised grey-level residual at every node of the mesh, NaN where there is none
    unresolved : (n,), nodes of the mesh whose shape is finer than the method resolves; None: it does not look for such
    hidden : the motions that the data cannot tell, in words
    weak : (k, w) what those of them that change `value` do to it, a column each, of any size
    contributions : to the uncertainty: source, size with its unit, and how it enters
    figures : what the report shows of the way there
    surfaces : the measured surfaces in the frame of `value`, of a method that moves such
    remarks : what the report must say, a sentence each
    """

    node: Integers
    value: Floats
    sound: Booleans
    uncertainty: FieldCovariance
    cad_from_measured: Pose
    placed: bool = False
    scale_known: bool = True
    symmetric: bool = False
    views: tuple[View, ...] = ()
    residual: Floats | None = None
    unresolved: Booleans | None = None
    hidden: tuple[str, ...] = ()
    weak: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    contributions: tuple[tuple[str, str, str], ...] = ()
    figures: tuple[Figure, ...] = ()
    surfaces: tuple[Nurbs, ...] = ()
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "node", integers(self.node, "node", None))
        object.__setattr__(self, "value", floats(self.value, "value", len(self.node)))
        object.__setattr__(self, "sound", booleans(self.sound, "sound", len(self.node)))
        weak = self.weak if self.weak.size else np.zeros((len(self.node), 0))
        object.__setattr__(self, "weak", floats(weak, "weak", len(self.node), None))


@runtime_checkable
class Measure(Protocol):
    """A measuring method: a frozen dataclass whose fields are its settings.

    Its `repr` is the provenance line of the report. It is registered under the entry point group
    `inspect3d.measurements`; the recipe's table, less the keys that every method shares, builds it. A method that must
    know where the part starts has a field `alignment`, and gets that table too.
    """

    def open(self, files: Files) -> Any:
        """Read and check the files of the recipe.

        Returns
        -------
        the source the call measures from; its `str` is one line for `inspect3d check`

        Raises
        ------
        InputError
            A file is missing, broken or not of this method.
        """

    def __call__(self, source: Any, nominal: Nominal) -> Measurement | NodalMeasurement:
        """Measure.

        Raises
        ------
        MeasurementError
            The data give no answer; says why and what to do.
        """
