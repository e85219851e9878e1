"""Mesh-based stereocorrelation: the shape of a speckled part from two or more photographs and its CAD model."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from inspect3d.correlation.stereo import PickedPoint, Stereo, StereoSource
from inspect3d.measure import Files, NodalMeasurement
from inspect3d.nominal.nominal import Nominal
from inspect3d.recipe_alignment import Start

SMOOTHEST = 0.1  # beyond, the plate takes off more of a curved shape than the uncertainty can tell


@dataclass(frozen=True)
class Stereocorrelation:
    """Measure the shape by mesh-based stereocorrelation of two or more photographs.

    Parameters
    ----------
    focal : px, rough focal length, one for all cameras or one each; None: from the calibration, the EXIF data or picks
    landmarks : points of the CAD picked in every picture, a start only: { cad = [x, y, z], pixels = [[u, v], ...] }
    solve : "joint": cameras and shape together; "two steps": one after the other as in the paper, which is biased
    facets : "lifted" onto the nominal surface; "flat" as in the paper, wrong by the chord
    interpolation : of the pictures: "cubic" B-spline; "linear" as in the paper
    steepest : degrees, largest angle between a normal and the line of sight
    systematic : px, standard uncertainty of a smooth shift of each picture that no model explains
    systematic_length : mm on the part, over which that shift stays alike; None: an eighth of the part
    smoothing : stiffness of a plate that smooths the map when it has been found, in medians of the nodes' own, up to
        0.1; 0: the map as it was measured
    alignment : where the part starts before a known rig, and whether its place is refined
    """

    focal: float | tuple[float, ...] | None = None
    landmarks: tuple[PickedPoint, ...] = field(default=(), repr=False)
    solve: Literal["joint", "two steps"] = "joint"
    facets: Literal["lifted", "flat"] = "lifted"
    interpolation: Literal["cubic", "linear"] = "cubic"
    steepest: float = 65.0
    systematic: float = 0.01
    systematic_length: float | None = None
    smoothing: float = 0.0
    alignment: Start = field(default=Start(), repr=False)

    def __post_init__(self) -> None:
        if not 0 <= self.smoothing <= SMOOTHEST:
            raise ValueError(f"smoothing = {self.smoothing:g} is not between 0 and {SMOOTHEST:g}")
        _ = self._stereo

    def open(self, files: Files) -> StereoSource:
        """Read photographs, masks and calibration.

        Raises
        ------
        InputError
            A file is missing, broken or does not fit the others; or nothing tells where to start.
        """
        return self._stereo.open(files)

    def __call__(self, source: StereoSource, nominal: Nominal) -> NodalMeasurement:
        """Measure the shape.

        Raises
        ------
        MeasurementError
            The landmarks do not fit, the pictures do not show the part twice, or they do not agree.
        """
        own = self._stereo.correlate(nominal)
        correlate = replace(own, lifted=self.facets == "lifted", smoothing=self.smoothing)
        return self._stereo(source, nominal, correlate)

    @property
    def _stereo(self) -> Stereo:
        return Stereo(
            self.focal,
            self.landmarks,
            self.solve == "two steps",
            self.interpolation,
            self.steepest,
            self.systematic,
            self.systematic_length,
            self.alignment.place,
            self.alignment.refine,
        )
