"""Stereocorrelation from the files of a recipe to moved nodes, whatever they are moved by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inspect3d.arrays import Booleans
from inspect3d.correlation.correlate import Correlate
from inspect3d.correlation.illustrated import MOVES, illustrated
from inspect3d.correlation.picks import FEWEST, Picks
from inspect3d.correlation.picture import Interpolation
from inspect3d.correlation.start import StereoStart
from inspect3d.correlation.state import Step
from inspect3d.correlation.systematic import Systematic
from inspect3d.correlation.ways import TWO_STEPS
from inspect3d.correlation.words import contributions, remarks
from inspect3d.files.calibration import Rig, what_is_known
from inspect3d.files.calibration_load import load_calibration
from inspect3d.files.photograph import Photograph, of_turned, read_mask, read_photograph
from inspect3d.measure import Files, NodalMeasurement
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import InputError
from inspect3d.pose import Pose
from inspect3d.progress import running

PATCH = 0.125  # of the part's size: length over which the systematic shift of a picture stays alike


@dataclass(frozen=True)
class PickedPoint:
    """A point of the CAD, mm, and its pixel in each picture; the name is for people."""

    cad: tuple[float, float, float]
    pixels: tuple[tuple[float, float], ...]
    name: str = ""


@dataclass(frozen=True, eq=False)
class StereoSource:
    """Photographs and what is known about the cameras; its `str` is one line."""

    photographs: tuple[Photograph, ...]
    masks: tuple[Booleans | None, ...]
    rig: Rig | None
    remarks: tuple[str, ...]

    def __str__(self) -> str:
        names = ", ".join(photograph.name for photograph in self.photographs)
        width, height = self.photographs[0].size
        return f"{len(self.photographs)} pictures of {width} x {height} px ({names}), cameras {what_is_known(self.rig)}"


@dataclass(frozen=True)
class Stereo:
    """What the methods that correlate photographs share: their files, the start, and what they hand over.

    Parameters
    ----------
    focal : px, rough focal length, one for all cameras or one each; None: from the calibration, the EXIF data or picks
    landmarks : points of the CAD picked in every picture, a start only
    two_steps : the cameras first, on the nominal shape, and then the shape, as in the paper; else both together
    interpolation : of the pictures between their pixels
    steepest : degrees, largest angle between a normal and the line of sight
    systematic : px, standard uncertainty of a smooth shift of each picture that no model explains
    systematic_length : mm on the part, over which that shift stays alike; None: an eighth of the part
    place : CAD from the frame of a calibrated rig, or of the first camera, where the recipe states it; None: unknown
    refine : whether the place of the part is refined
    """

    focal: float | tuple[float, ...] | None
    landmarks: tuple[PickedPoint, ...]
    two_steps: bool
    interpolation: Interpolation
    steepest: float
    systematic: float
    systematic_length: float | None
    place: Pose | None
    refine: bool

    def __post_init__(self) -> None:
        for focal in self._focals(1):
            if focal is not None and not focal > 0:
                raise ValueError(f"focal = {focal:g} is not a focal length: give a positive number of pixels")
        if not 0 < self.steepest < 90:
            raise ValueError(f"steepest = {self.steepest:g} is not between 0 and 90 degrees")
        if not self.systematic >= 0:
            raise ValueError(f"systematic = {self.systematic:g} is negative")
        if self.systematic_length is not None and not self.systematic_length > 0:
            raise ValueError(f"systematic_length = {self.systematic_length:g} is not positive")
        counts = {len(point.pixels) for point in self.landmarks}
        if len(counts) > 1:
            raise ValueError("every landmark has one pixel for each picture, in the order of the pictures")

    def open(self, files: Files) -> StereoSource:
        """Read photographs, masks and calibration.

        Raises
        ------
        InputError
            A file is missing, broken or does not fit the others; or nothing tells where to start.
        """
        photographs = tuple(read_photograph(path) for path in files["images"])
        self._require_pictures(photographs)
        masks = self._masks(files.paths.get("masks", ()), photographs)
        sizes = tuple(photograph.size for photograph in photographs)
        calibration = files.paths.get("cameras", ())
        rig = load_calibration(calibration, tuple(p.name for p in photographs), sizes) if calibration else None
        self._require_start(rig)
        self._require_focal(rig, photographs)
        return StereoSource(photographs, masks, rig, of_turned(photographs))

    def correlate(self, nominal: Nominal) -> Correlate:
        """Return the settings of the correlation, for nodes that move by themselves."""
        length = self.systematic_length or PATCH * nominal.diagonal
        return Correlate(
            levels=TWO_STEPS if self.two_steps else None,
            interpolation=self.interpolation,
            steepest=self.steepest,
            systematic=Systematic(self.systematic, length) if self.systematic else None,
        )

    def __call__(self, source: StereoSource, nominal: Nominal, correlate: Correlate) -> NodalMeasurement:
        """Measure the shape.

        Parameters
        ----------
        correlate : the settings of the correlation

        Raises
        ------
        MeasurementError
            The landmarks do not fit, the pictures do not show the part twice, or they do not agree.
        """
        start = self._start()
        begin = start(source.photographs, source.masks, source.rig, self._focals(len(source.photographs)), nominal)
        grey = [photograph.grey for photograph in source.photographs]
        steps: list[Step] = []
        shape = correlate(nominal, grey, begin.views, begin.freedom, source.masks, _telling(steps))
        cad_from_rig, nodes = Pose.identity(), len(shape.scene.node)
        if begin.rig_view is not None:
            cad_from_rig = shape.views[0].camera_from_cad.inverse() @ begin.rig_view.camera_from_cad
        return NodalMeasurement(
            node=shape.scene.node,
            value=shape.values,
            sound=shape.sound,
            uncertainty=shape.uncertainty,
            cad_from_measured=cad_from_rig,
            placed=begin.freedom.poses == "known",
            scale_known=begin.freedom.poses != "free",
            symmetric=begin.symmetric,
            views=shape.views,
            residual=shape.residual,
            unresolved=shape.unresolved,
            hidden=tuple(motion.words for motion in shape.hidden),
            weak=np.array([motion.pattern for motion in shape.hidden if motion.pattern.any()]).reshape(-1, nodes).T,
            contributions=contributions(shape),
            figures=(*begin.figures, *illustrated(nominal, shape, begin.views, grey, steps, start.picks)),
            surfaces=shape.scene.space.surfaces(shape.state.motion),
            remarks=(*source.remarks, *begin.remarks, *remarks(shape, begin.freedom)),
        )

    def _focals(self, count: int) -> tuple[float | None, ...]:
        return self.focal if isinstance(self.focal, tuple) else (self.focal,) * count

    def _require_pictures(self, photographs: tuple[Photograph, ...]) -> None:
        count = len(photographs)
        if count < 2:
            raise InputError(f"Stereocorrelation compares two pictures or more, and `images` names {count}.")
        for k, one in enumerate(photographs):
            for other in photographs[:k]:
                if one.size == other.size and np.array_equal(one.grey, other.grey):
                    raise InputError(f"{other.name} and {one.name} are the same picture: each camera needs its own.")
        if isinstance(self.focal, tuple) and len(self.focal) != count:
            raise InputError(f"`focal` has {len(self.focal)} values for {count} pictures: give one, or one for each.")
        for number, point in enumerate(self.landmarks, start=1):
            if len(point.pixels) != count:
                raise InputError(
                    f"Landmark {number} has {len(point.pixels)} pixels for {count} pictures: give one for each."
                )

    def _masks(self, paths: tuple[Path, ...], photographs: tuple[Photograph, ...]) -> tuple[Booleans | None, ...]:
        if not paths:
            return (None,) * len(photographs)
        if len(paths) != len(photographs):
            raise InputError(f"`masks` names {len(paths)} files for {len(photographs)} pictures: give one for each.")
        return tuple(read_mask(path, photograph.size) for path, photograph in zip(paths, photographs, strict=True))

    def _require_start(self, rig: Rig | None) -> None:
        placed = rig is not None and (rig.camera_from_cad or (rig.camera_from_rig and self.place is not None))
        if not (placed or self.refine):
            raise InputError(
                "refine = false keeps the part in the place it is said to have, and nothing says it: name `cameras` "
                "with their camera_from_cad, give alignment.start, or leave refine away."
            )
        if self.landmarks and len(self.landmarks) < FEWEST and not placed:
            raise InputError(f"There are {len(self.landmarks)} landmarks, and {FEWEST} or more are needed: pick more.")

    def _require_focal(self, rig: Rig | None, photographs: tuple[Photograph, ...]) -> None:
        if rig is not None or self.landmarks:
            return
        for photograph, focal in zip(photographs, self._focals(len(photographs)), strict=True):
            if focal is None and photograph.focal is None:
                raise InputError(
                    f"Nothing tells the focal length of {photograph.name}: give a rough `focal`, px (that of the lens, "
                    "mm, over the width of a pixel, mm), `cameras`, or 6 or more `landmarks` with their pixels."
                )

    def _start(self) -> StereoStart:
        picks = None
        if self.landmarks:
            cad, pixels = [p.cad for p in self.landmarks], [p.pixels for p in self.landmarks]
            picks = Picks(np.array(cad, float), np.array(pixels, float))
        return StereoStart(picks, self.place, self.refine)


def _telling(steps: list[Step]) -> Callable[[Step], None]:
    """Return what keeps the steps and shows them."""
    progress = running()

    def tell(step: Step) -> None:
        steps.append(step)
        what = MOVES[step.level.moves]
        done = len(steps) / (len(steps) + 10)
        progress.update(done, f"{what}, blur {step.level.blur:g} px, step {len(steps)}: {1000 * step.change:.2g} µm")

    return tell
