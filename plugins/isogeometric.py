"""Isogeometric stereocorrelation: the control points of the CAD's own NURBS surfaces from two or more photographs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from inspect3d.correlation.splines import Splines, exact_faces
from inspect3d.correlation.stereo import PickedPoint, Stereo, StereoSource
from inspect3d.measure import Files, NodalMeasurement
from inspect3d.nominal.nominal import Nominal
from inspect3d.recipe_alignment import Start

FINEST, HIGHEST = 6, 12


@dataclass(frozen=True)
class Isogeometric:
    """Measure the shape by isogeometric stereocorrelation of two or more photographs.

    The control points of the part's NURBS faces move along their normals (L. Dubreuil et al., Exp. Mech. 56, 2016,
    section 3); planes, cylinders and the like are converted exactly.

    Parameters
    ----------
    focal : px, rough focal length, one for all cameras or one each; None: from the calibration, the EXIF data or picks
    landmarks : points of the CAD picked in every picture, a start only: { cad = [x, y, z], pixels = [[u, v], ...] }
    solve : "joint": cameras and shape together; "two steps": one after the other as in the paper, which is biased
    faces : numbers of the faces to measure, as in the file; none: those that the cameras see
    refine : how often every span between two knots is halved
    degree : to which the surfaces are raised at least; 0: as in the CAD
    directions : in which control points move: "normal"; or "all", of which only those count that move the surface
        otherwise than normal motions do
    continuity : degrees between neighbouring faces, below which they keep together along their edge, and smoothly where
        the CAD is smooth; 0: each face moves by itself
    interpolation : of the pictures: "cubic" B-spline; "linear" as in the paper
    steepest : degrees, largest angle between a normal and the line of sight
    systematic : px, standard uncertainty of a smooth shift of each picture that no model explains
    systematic_length : mm on the part, over which that shift stays alike; None: an eighth of the part
    alignment : where the part starts before a known rig, and whether its place is refined
    """

    focal: float | tuple[float, ...] | None = None
    landmarks: tuple[PickedPoint, ...] = field(default=(), repr=False)
    solve: Literal["joint", "two steps"] = "joint"
    faces: tuple[int, ...] = ()
    refine: int = 0
    degree: int = 0
    directions: Literal["normal", "all"] = "normal"
    continuity: float = 45.0
    interpolation: Literal["cubic", "linear"] = "cubic"
    steepest: float = 65.0
    systematic: float = 0.01
    systematic_length: float | None = None
    alignment: Start = field(default=Start(), repr=False)

    def __post_init__(self) -> None:
        _ = self._stereo
        if not 0 <= self.refine <= FINEST:
            raise ValueError(f"refine = {self.refine} is not between 0 and {FINEST}: it halves the spans so often")
        if not 0 <= self.degree <= HIGHEST:
            raise ValueError(f"degree = {self.degree} is not between 0 and {HIGHEST}")

        if not 0 <= self.continuity <= 180:
            raise ValueError(f"continuity = {self.continuity:g} is not between 0 and 180 degrees")

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
            The landmarks do not fit, the pictures do not show the part twice, or they do not agree; or the model has no
            faces whose control points the pictures can tell apart on this mesh.
        """
        exact_faces(nominal)
        ways = 3 if self.directions == "all" else 1
        splines = Splines(self.faces, self.refine, self.degree, ways, self.continuity)
        correlate = replace(self._stereo.correlate(nominal), splines=splines)
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
