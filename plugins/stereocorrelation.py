"""Mesh-based stereocorrelation: the shape of a speckled part from two or more photographs and its CAD model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from inspect3d.arrays import Booleans
from inspect3d.camera import Camera, View
from inspect3d.correlation.correlate import TWO_STEPS, Correlate
from inspect3d.correlation.freedom import Freedom, Lens, Poses, Stand
from inspect3d.correlation.illustrated import MOVES, illustrated
from inspect3d.correlation.picks import FEWEST, Picks, ideal_camera, placed_by_picks, view_from_dlt
from inspect3d.correlation.shape import Shape
from inspect3d.correlation.solver import Step
from inspect3d.correlation.uncertainty import Systematic
from inspect3d.files.calibration import CameraSigma, Rig
from inspect3d.files.calibration_load import load_calibration
from inspect3d.files.photograph import Photograph, read_mask, read_photograph
from inspect3d.measure import Files, NodalMeasurement
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import InputError, MeasurementError
from inspect3d.pose import Pose
from inspect3d.progress import running
from inspect3d.recipe import Start

ROUGH, WIDE = 0.05, 0.3  # relative uncertainty of a focal length that is given, and of one that the picks gave
CENTRE = 0.025  # of the picture's width: uncertainty of a principal point that is taken to be in the middle
DISTORTION = (0.2, 0.3, 1e-3, 1e-3, 0.0)  # uncertainties of k1, k2, p1, p2, k3 of a lens nobody calibrated
PULLED = 5.0  # standard uncertainties by which a camera may differ from what was known without a word
LOUD = 0.1  # px, disagreement of the pictures that the reader must hear of
PATCH = 0.125  # of the part's size: length over which the systematic shift of a picture stays alike


@dataclass(frozen=True)
class PickedPoint:
    """A point of the CAD, mm, and its pixel in each picture."""

    cad: tuple[float, float, float]
    pixels: tuple[tuple[float, float], ...]


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
        return f"{len(self.photographs)} pictures of {width} x {height} px ({names}), cameras {self._known()}"

    def _known(self) -> str:
        if self.rig is None:
            return "not calibrated"
        if self.rig.camera_from_cad:
            return "calibrated, in their places before the part"
        return "calibrated, in their places in the rig" if self.rig.camera_from_rig else "of calibrated lenses"


@dataclass(frozen=True, eq=False)
class Begin:
    """Where the solver begins.

    Parameters
    ----------
    views : the cameras
    freedom : what is not known about them
    rig_view : the first camera in the frame of the rig, which the alignment is stated from; None without a rig
    picks : the landmarks, or None
    remarks : how the start was found
    """

    views: tuple[View, ...]
    freedom: Freedom
    rig_view: View | None
    picks: Picks | None
    remarks: tuple[str, ...]


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
    alignment: Start = field(default=Start(), repr=False)

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
        self._require_start(rig, len(photographs))
        remarks = tuple(
            f"{photograph.name} asks viewers to turn it; its pixels are counted as it is stored, unturned."
            for photograph in photographs
            if photograph.turned
        )
        return StereoSource(photographs, masks, rig, remarks)

    def __call__(self, source: StereoSource, nominal: Nominal) -> NodalMeasurement:
        """Measure the shape.

        Raises
        ------
        MeasurementError
            The landmarks do not fit, the pictures do not show the part twice, or they do not agree.
        """
        begin = self._begin(source, nominal)
        grey = [photograph.grey for photograph in source.photographs]
        steps: list[Step] = []
        correlate = self._correlate(nominal)
        shape = correlate(nominal, grey, begin.views, begin.freedom, source.masks, _telling(steps))
        cad_from_rig = Pose.identity()
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
            views=shape.views,
            residual=shape.residual,
            hidden=tuple(motion.words for motion in shape.hidden),
            contributions=_contributions(shape),
            figures=illustrated(nominal, shape, begin.views, grey, steps, begin.picks),
            remarks=(*source.remarks, *begin.remarks, *_remarks(shape), *_pulled(shape, begin.freedom)),
        )

    def _correlate(self, nominal: Nominal) -> Correlate:
        length = self.systematic_length or PATCH * nominal.diagonal
        return Correlate(
            levels=TWO_STEPS if self.solve == "two steps" else None,
            interpolation=self.interpolation,
            lifted=self.facets == "lifted",
            steepest=self.steepest,
            systematic=Systematic(self.systematic, length) if self.systematic else None,
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

    def _require_start(self, rig: Rig | None, count: int) -> None:
        placed = rig is not None and (rig.camera_from_cad or (rig.camera_from_rig and self.alignment.start != "auto"))
        if placed or len(self.landmarks) >= FEWEST:
            return
        if self.landmarks:
            raise InputError(f"There are {len(self.landmarks)} landmarks, and {FEWEST} or more are needed: pick more.")
        how = 'the pose of the part (alignment = { start = "pose", matrix = ... })' if rig else "`cameras`"
        raise InputError(
            f"Nothing tells where the cameras stand before the part: add {FEWEST} or more `landmarks` with their "
            f"pixels in the {count} pictures, or {how}."
        )

    def _begin(self, source: StereoSource, nominal: Nominal) -> Begin:
        rig, picks = source.rig, self._picks()
        origin = nominal.mesh.nodes.mean(axis=0)
        placed = _places(rig)
        lenses, cameras, remarks = self._lenses(source, picks, nominal)
        poses: Poses = "free" if placed is None else "common" if self.alignment.refine else "known"
        if placed is not None:
            placed = tuple(View(view.camera, view.camera_from_cad @ self._rig_from_cad()) for view in placed)
        rig_view = placed[0] if placed else None
        if rig_view is not None:
            rig_view = View(rig_view.camera, rig_view.camera_from_cad @ self._rig_from_cad().inverse())
        start, prior_views = placed, placed
        stands = _stands(rig) if placed else ()
        if picks is not None and poses != "known":
            priors = tuple(View(camera, Pose.identity()) for camera in cameras)
            freedom = Freedom(poses, lenses, priors, picks.points_cad.mean(axis=0))
            found = placed_by_picks(picks, placed or (), cameras, freedom)
            start = found.views
            prior_views = _rig_before(placed, start[0]) if placed else start
            errors = np.sqrt((found.errors**2).mean())
            remarks += (f"The cameras started from {len(picks)} landmarks, which fit within {errors:.2g} px rms.",)
        if start is None:
            raise MeasurementError("There are no landmarks to place the cameras by.")
        priors = tuple(map(View, cameras, (view.camera_from_cad for view in prior_views or start)))
        datum = (0.0, 0.0, 0.0)
        if rig_view is not None:
            cad_from_rig = priors[0].camera_from_cad.inverse() @ rig_view.camera_from_cad
            x, y, z = cad_from_rig.translation
            datum = (float(x), float(y), float(z))
        return Begin(start, Freedom(poses, lenses, priors, origin, stands, datum), rig_view, picks, remarks)

    def _picks(self) -> Picks | None:
        if not self.landmarks:
            return None
        cad, pixels = [p.cad for p in self.landmarks], [p.pixels for p in self.landmarks]
        return Picks(np.array(cad, float), np.array(pixels, float))

    def _rig_from_cad(self) -> Pose:
        """Return where the recipe says the part starts in the frame of the calibration."""
        matrix = self.alignment.matrix
        return Pose.identity() if matrix is None else Pose.from_matrix(np.array(matrix)).inverse()

    def _lenses(
        self, source: StereoSource, picks: Picks | None, nominal: Nominal
    ) -> tuple[tuple[Lens, ...], tuple[Camera, ...], tuple[str, ...]]:
        """Return how well each lens is known, the lenses to start with, and where they are from."""
        rig = source.rig
        if rig is not None:
            return tuple(_lens(sigma) for sigma in rig.sigmas), rig.cameras, ()
        lenses, cameras, origins = [], [], []
        for k, (photograph, given) in enumerate(
            zip(source.photographs, self._focals(len(source.photographs)), strict=True)
        ):
            focal, share, origin = given, ROUGH, "the recipe"
            if focal is None:
                focal, origin = photograph.focal, "the EXIF data"
            if focal is None:
                if picks is None:
                    raise MeasurementError("Nothing tells the focal lengths: give a rough `focal`, px.")
                view = view_from_dlt(picks.points_cad, picks.pixels[:, k], photograph.size, nominal.mesh.nodes)
                focal = float(np.sqrt(view.camera.matrix[0, 0] * view.camera.matrix[1, 1]))
                share, origin = WIDE, "the landmarks (direct linear transformation)"
            width = max(photograph.size)
            lenses.append(Lens(share * focal, CENTRE * width, DISTORTION))
            cameras.append(ideal_camera(focal, photograph.size))
            origins.append(f"{focal:.0f} px ± {100 * share:.0f} % by {origin}")
        words = "; ".join(f"picture {k}: {origin}" for k, origin in enumerate(origins, start=1))
        return tuple(lenses), tuple(cameras), (f"Rough focal lengths to start with, and how well known: {words}.",)


def _places(rig: Rig | None) -> tuple[View, ...] | None:
    """Return the cameras in the frame of the calibration, or None where their places in it are not known in mm."""
    if rig is None or not rig.scaled:
        return None
    poses = rig.camera_from_cad or rig.camera_from_rig
    return tuple(map(View, rig.cameras, poses)) if poses else None


def _stands(rig: Rig | None) -> tuple[Stand, ...]:
    """Return how well the places of the cameras are known; empty where the calibration states no uncertainty."""
    stands = (
        tuple(Stand(sigma.rotation, sigma.translation) if sigma else Stand() for sigma in rig.sigmas) if rig else ()
    )
    return stands if any(stand.sigmas.any() for stand in stands) else ()


def _rig_before(rig: tuple[View, ...], first: View) -> tuple[View, ...]:
    """Return the views of a rig moved so that its first one stands where `first` does."""
    moved = rig[0].camera_from_cad.inverse() @ first.camera_from_cad
    return tuple(View(view.camera, view.camera_from_cad @ moved) for view in rig)


def _lens(sigma: CameraSigma | None) -> Lens:
    if sigma is None:
        return Lens()
    return Lens(sigma.focal, sigma.centre, tuple(float(value) for value in sigma.distortion))


def _telling(steps: list[Step]) -> Callable[[Step], None]:
    """Return what keeps the steps and shows them."""
    progress = running()

    def tell(step: Step) -> None:
        steps.append(step)
        what = MOVES[step.level.moves]
        done = len(steps) / (len(steps) + 10)
        progress.update(done, f"{what}, blur {step.level.blur:g} px, step {len(steps)}: {1000 * step.change:.2g} µm")

    return tell


def _contributions(shape: Shape) -> tuple[tuple[str, str, str], ...]:
    """Return what the uncertainty of a shape is made of: source, size with its unit, and how it enters."""
    sure, systematic = shape.uncertainty, shape.systematic
    found = [
        (
            "noise of the pictures",
            f"{np.sqrt(sure.noise):.2g} grey levels",
            f"by what the fit leaves over, propagated to every node; times {sure.correlated:.2f} for being correlated",
        )
    ]
    if systematic is not None:
        words = f"a smooth shift of each picture that no camera model explains, alike over {systematic.length:.3g} mm"
        found.append(("systematic shift of the pictures", f"{systematic.size:.2g} px", words))
    weak = [motion for motion in shape.hidden if np.isfinite(motion.sigma)]
    if weak:
        size = 1000 * float(np.sqrt(sum(motion.sigma**2 for motion in weak)))
        words = "motions that the pictures tell weakly, which the priors of the cameras bound; named below"
        found.append(("cameras", f"{size:.2g} µm rms over the map", words))
    return tuple(found)


def _pulled(shape: Shape, freedom: Freedom) -> tuple[str, ...]:
    """Return by how much the pictures contradict what was known of the cameras, where that is a lot."""
    _, sigmas = freedom.spread(freedom.columns)
    pulls = np.abs(freedom.offset(shape.views)) / sigmas
    if not len(pulls) or pulls.max() < PULLED:
        return ()
    return (
        f"The pictures move the {freedom.names[int(np.argmax(pulls))]} by {pulls.max():.0f} standard uncertainties "
        "from what was known of it: the cameras are known less well than is stated.",
    )


def _remarks(shape: Shape) -> tuple[str, ...]:
    remarks = []
    if shape.systematic is not None and shape.systematic.size > LOUD:
        remarks.append(
            f"Across the epipolar lines, where no shape can make up for it, the pictures disagree by "
            f"{shape.systematic.size:.2g} px: the calibration is not as good as it is said to be. State its "
            "uncertainty (`sigma`), or calibrate again."
        )
    if not shape.settled:
        remarks.append(
            f"The solver stopped after {len(shape.state.steps)} steps of its last stage, before the shape had settled: "
            f"the last step moved it by up to {1000 * shape.state.steps[-1].change:.2g} µm."
        )
    left_out = np.count_nonzero(~shape.sound)
    if left_out:
        remarks.append(
            f"{left_out} of the {len(shape.sound)} nodes that two cameras see are not observed: the pictures agree on "
            "too few of the points around them, or they lie on an edge."
        )
    return tuple(remarks)
