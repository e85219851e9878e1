"""COLMAP: points of a speckled part triangulated from two or more photographs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version

import numpy as np
from scipy.spatial import cKDTree

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import Camera, View
from inspect3d.correlation.picture import Pictures
from inspect3d.files.calibration import Rig, what_is_known
from inspect3d.files.calibration_load import load_calibration
from inspect3d.files.photograph import Photograph, of_turned, read_mask, read_photograph
from inspect3d.measure import Cloud, Files, Measurement
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import InputError, MeasurementError
from inspect3d.pose import Pose
from inspect3d.progress import running
from inspect3d.triangulation.centre_sigma import centre_sigma
from inspect3d.triangulation.features import Features, FindFeatures
from inspect3d.triangulation.patches import FitPatches, Patched
from inspect3d.triangulation.scale_bar import ScaleBar
from inspect3d.triangulation.tie import Tie, TiePoints

FEWEST_FEATURES, FEWEST_POINTS = 100, 30
FEWEST_CENTRES = 3  # two centres lie as they may: a motion and a growth make any two of any other two
SAMPLE = 2000
NORMAL_LENS = 1.2  # of the longer side of a picture: the focal length that is tried where nothing tells it
GIVEN = "The scale is that of the given cameras."
FROM_CAD = (
    "The scale was taken from the CAD, by registration: a part that is too large or too small all over goes unnoticed. "
    "Give the cameras with their places, or a scale_bar, to measure it."
)
NO_CUDA = (
    "COLMAP's own dense stereo, which needs a CUDA device, was not used: the points are patches that were fitted to "
    "all photographs."
)


@dataclass(frozen=True, eq=False)
class ColmapSource:
    """Photographs and what is known about the cameras; its `str` is one line."""

    photographs: tuple[Photograph, ...]
    masks: tuple[Booleans | None, ...]
    rig: Rig | None
    remarks: tuple[str, ...]

    def __str__(self) -> str:
        sizes = sorted({photograph.size for photograph in self.photographs})
        names = [photograph.name for photograph in self.photographs]
        listed = ", ".join(names if len(names) <= 4 else [*names[:2], "...", names[-1]])
        return (
            f"{len(names)} photographs of {', '.join(f'{width} x {height}' for width, height in sizes)} px ({listed}), "
            f"cameras {what_is_known(self.rig)}"
        )


@dataclass(frozen=True)
class Colmap:
    """Triangulate points of a speckled part with COLMAP, and refine them by patches that fit all photographs.

    Parameters
    ----------
    focal : px, rough focal length, one for all cameras or one each; None: from the calibration or the EXIF data
    scale_bar : a known distance between two marked points, for cameras whose places are unknown
    features : of each photograph at the most, to tie the photographs together
    half_window : px, of a patch, on each side of its middle
    spacing : px, between patches
    steepest : degrees, largest angle between a normal and the line of sight
    systematic : px, standard uncertainty of a shift of each picture that no model explains
    """

    focal: float | tuple[float, ...] | None = None
    scale_bar: ScaleBar | None = field(default=None, repr=False)
    features: int = 16_000
    half_window: int = 5
    spacing: float = 10.0
    steepest: float = 65.0
    systematic: float = 0.01

    def __post_init__(self) -> None:
        focals = self.focal if isinstance(self.focal, tuple) else (self.focal,)
        if any(focal is not None and not focal > 0 for focal in focals):
            raise ValueError(f"focal = {self.focal} holds no focal length: give positive numbers of pixels")
        if not 2 <= self.half_window <= 50:
            raise ValueError(f"half_window = {self.half_window} is not between 2 and 50 px")
        if not self.spacing >= 1:
            raise ValueError(f"spacing = {self.spacing:g} px is less than a pixel")
        if not 0 < self.steepest < 90:
            raise ValueError(f"steepest = {self.steepest:g} is not between 0 and 90 degrees")
        if not self.systematic >= 0:
            raise ValueError(f"systematic = {self.systematic:g} is negative")
        if self.features < FEWEST_FEATURES:
            raise ValueError(f"features = {self.features} is too few to tie photographs together")

    def open(self, files: Files) -> ColmapSource:
        """Read photographs, masks and calibration.

        Raises
        ------
        InputError
            A file is missing, broken or does not fit the others.
        """
        photographs = tuple(read_photograph(path) for path in files["images"])
        self._require_different(photographs)
        self._focals(photographs)
        masks: tuple[Booleans | None, ...] = (None,) * len(photographs)
        given = files.paths.get("masks", ())
        if given:
            if len(given) != len(photographs):
                raise InputError(f"There are {len(given)} masks for {len(photographs)} photographs: give one for each.")
            masks = tuple(read_mask(path, each.size) for path, each in zip(given, photographs, strict=True))
        names, sizes = tuple(p.name for p in photographs), tuple(p.size for p in photographs)
        calibration = files.paths.get("cameras", ())
        rig = load_calibration(calibration, names, sizes) if calibration else None
        self._require_marked(names)
        remarks = [*of_turned(photographs)]
        if rig is None and len(set(sizes)) > 1:
            remarks.append("The photographs have different sizes: each is taken as that of a camera of its own.")
        return ColmapSource(photographs, masks, rig, tuple(remarks))

    def __call__(self, source: ColmapSource, nominal: Nominal) -> Measurement:
        """Measure.

        Raises
        ------
        MeasurementError
            The photographs do not fit together, or show too little of the part.
        """
        progress = running()
        features = []
        for k, (photograph, mask) in enumerate(zip(source.photographs, source.masks, strict=True)):
            progress.update(0.5 * k / len(source.photographs), f"finding features in {photograph.name}")
            features.append(self._features(photograph, mask))
        progress.update(0.5, "matching features")
        tied = self._tied(source, features)
        placed = [k for k, view in enumerate(tied.views) if view is not None]
        views = [view for view in tied.views if view is not None]
        progress.update(0.8, "fitting patches")
        fit = FitPatches(self.half_window, self.spacing, steepest=self.steepest, systematic=self.systematic)
        grey = [source.photographs[k].grey for k in placed]
        patched = fit(Pictures(grey), views, [source.masks[k] for k in placed], tied.points, tied.towards)
        return self._measurement(source, tied, placed, views, patched)

    def _features(self, photograph: Photograph, mask: Booleans | None) -> Features:
        found = FindFeatures(most=self.features)(photograph, mask)
        if len(found) < FEWEST_FEATURES:
            raise MeasurementError(
                f"{photograph.name} shows {len(found)} features, and {FEWEST_FEATURES} are needed: is it sharp and "
                "well exposed, and is the part speckled?"
            )
        return found

    def _tied(self, source: ColmapSource, features: Sequence[Features]) -> TiePoints:
        """Return the tie points, with the given cameras or with cameras that they themselves place."""
        names, rig = [photograph.name for photograph in source.photographs], source.rig
        places = rig and (rig.camera_from_cad or rig.camera_from_rig)
        if rig and places:
            return Tie().placed(names, features, tuple(map(View, rig.cameras, places)))
        sizes = [photograph.size for photograph in source.photographs]
        lenses: Sequence[Camera | float] = rig.cameras if rig else self._focals(source.photographs)
        return Tie().free(names, features, lenses, sizes)

    def _focals(self, photographs: Sequence[Photograph]) -> list[float]:
        """Return the focal length to begin with of each photograph, px."""
        given = self.focal if isinstance(self.focal, tuple) else (self.focal,) * len(photographs)
        if len(given) != len(photographs):
            raise InputError(
                f"focal names {len(given)} values for {len(photographs)} photographs: give one for all, or one each."
            )
        return [
            focal or photograph.focal or NORMAL_LENS * max(photograph.size)
            for focal, photograph in zip(given, photographs, strict=True)
        ]

    def _measurement(
        self, source: ColmapSource, tied: TiePoints, placed: Sequence[int], views: Sequence[View], patched: Patched
    ) -> Measurement:
        """Return the cloud in mm, as far as the scale is known."""
        names = [source.photographs[k].name for k in placed]
        if len(patched) < FEWEST_POINTS:
            raise MeasurementError(
                f"The photographs agree on {len(patched)} places of the surface only: check that the part is speckled, "
                "that the pictures are sharp, and that the calibration belongs to them."
            )
        rig = source.rig
        known = rig is not None and bool(rig.camera_from_cad or (rig.camera_from_rig and rig.scaled))
        scale, scale_sigma, remark = 1.0, 0.0, GIVEN
        if self.scale_bar is not None:
            scale, scale_sigma = self.scale_bar.scale(names, views)
            remark = self._bar_words(scale, scale_sigma, known)
            scale, scale_sigma = (1.0, 0.0) if known else (scale, scale_sigma)
        elif not known:
            remark = FROM_CAD
        points, sigma = scale * patched.points, scale * patched.sigma
        scaled = [replace(v, camera_from_cad=_scaled(v.camera_from_cad, scale)) for v in views]
        known = known or self.scale_bar is not None
        return Measurement(
            (Cloud(f"{len(placed)} photographs", points, patched.normals, shares=sigma / np.median(sigma)),),
            frame="cad" if rig is not None and rig.camera_from_cad else "instrument",
            scale_known=known,
            scale_sigma=scale_sigma,
            views=tuple(scaled),
            remarks=(
                *source.remarks,
                *_left_out(source.photographs, placed),
                remark,
                _tie_words(tied),
                *_centre_words(tied, rig, self.systematic),
                _patch_words(patched, points, sigma, known),
                NO_CUDA,
            ),
        )

    def _bar_words(self, scale: float, sigma: float, known: bool) -> str:
        length = self.scale_bar.length if self.scale_bar else 0.0
        if not known:
            return f"The scale is that of the scale bar, {length:g} mm long, to {1e6 * sigma:.0f} µm in a metre."
        return (
            f"The scale is that of the given cameras; with them the scale bar of {length:g} mm measures "
            f"{length / scale:.4f} mm, give or take {sigma * length:.4f} mm."
        )

    @staticmethod
    def _require_different(photographs: Sequence[Photograph]) -> None:
        if len(photographs) < 2:
            raise InputError("COLMAP needs two photographs or more, from different places; the recipe names one.")
        for k, one in enumerate(photographs):
            for other in photographs[k + 1 :]:
                if one.size == other.size and np.array_equal(one.grey, other.grey):
                    raise InputError(
                        f"{one.name} and {other.name} are the same picture: name photographs from different places."
                    )

    def _require_marked(self, names: Sequence[str]) -> None:
        """Refuse a scale bar that is marked in a photograph that is not there."""
        for mark in self.scale_bar.marks if self.scale_bar else ():
            if mark.image not in names:
                raise InputError(
                    f"scale_bar names {mark.image}, which is not among the photographs: {', '.join(names)}."
                )


def _scaled(pose: Pose, scale: float) -> Pose:
    """Return the pose of a camera before a scene that is scaled."""
    return Pose(pose.rotation, scale * pose.translation)


def _left_out(photographs: Sequence[Photograph], placed: Sequence[int]) -> tuple[str, ...]:
    missing = [photograph.name for k, photograph in enumerate(photographs) if k not in placed]
    if not missing:
        return ()
    return (f"{', '.join(missing)} could not be placed, for showing too little of what the others show: left out.",)


def _tie_words(tied: TiePoints) -> str:
    return (
        f"{len(tied.points)} features were tied over {len(tied.pixels) / len(tied.points):.1f} photographs each, on "
        f"average, and triangulated by COLMAP {version('pycolmap')}: {tied.error:.2f} px rms from where they were seen."
    )


def _centre_words(tied: TiePoints, rig: Rig | None, systematic: float) -> tuple[str, ...]:
    """Return how well cameras that COLMAP placed are known against each other: parts of their distance to the part."""
    placed = [view for view in tied.views if view is not None]
    if len(placed) < FEWEST_CENTRES or (rig is not None and (rig.camera_from_cad or rig.camera_from_rig)):
        return ()
    sigma = centre_sigma(tied, rig is None, systematic)
    sigma = sigma[np.isfinite(sigma)]
    middle = np.median(tied.points, axis=0)
    shares = 1e6 * sigma / np.array([np.linalg.norm(view.centre - middle) for view in placed])
    return (
        f"The centres of the cameras are known to {np.median(shares):.2g} µm, at the most {shares.max():.2g} µm, in "
        "each metre of their distance to the part, against each other and along each axis (standard uncertainty, by "
        "the bundle adjustment with the lenses "
        f"{'given' if rig else 'free and their axes half a per cent of the picture off its middle'}).",
    )


def _patch_words(patched: Patched, points: Floats, sigma: Floats, known: bool) -> str:
    """Return how many points there are, how dense, and how certain, in mm where the scale is known."""
    reach = 3 * float(np.median(cKDTree(points).query(points, 2)[0][:, 1]))
    around = cKDTree(points).query_ball_point(points[:: 1 + len(points) // SAMPLE], reach, return_length=True)
    density = float(np.median(around)) / (np.pi * reach**2)
    words = (
        f"{density:.2g} points per mm², each known to {1e3 * np.median(sigma):.2g} µm along its normal (median)"
        if known
        else "as dense as `spacing` says"
    )
    return f"{len(points)} patches fit {np.mean(patched.views):.1f} photographs each, on average: {words}."
