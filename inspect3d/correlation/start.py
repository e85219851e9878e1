"""Where stereocorrelation begins: the cameras, and what is not known about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import Camera, View
from inspect3d.correlation.automatic import Automatic, Scenery, automatic
from inspect3d.correlation.freedom import Freedom, Lens, Poses, Stand
from inspect3d.correlation.picks import Picks, ideal_camera, placed_by_picks, view_from_dlt
from inspect3d.figure import Figure
from inspect3d.files.calibration import CameraSigma, Rig
from inspect3d.files.photograph import Photograph
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose

ROUGH, WIDE = 0.05, 0.3  # relative uncertainty of a focal length that is given, and of one that the picks gave
CENTRE = 0.025  # of the picture's width: uncertainty of a principal point that is taken to be in the middle
DISTORTION = (0.2, 0.3, 1e-3, 1e-3, 0.0)  # uncertainties of k1, k2, p1, p2, k3 of a lens nobody calibrated


@dataclass(frozen=True, eq=False)
class Begin:
    """Where the solver begins.

    Parameters
    ----------
    views : the cameras before the part
    freedom : what is not known about them
    rig_view : the first camera in the frame of the calibration; None where that says nothing about places
    remarks : how the start was found, a sentence each
    symmetric : whether the part would look the same in another place
    figures : what the report shows of the start
    """

    views: tuple[View, ...]
    freedom: Freedom
    rig_view: View | None
    remarks: tuple[str, ...]
    symmetric: bool = False
    figures: tuple[Figure, ...] = ()


@dataclass(frozen=True, eq=False)
class StereoStart:
    """What a recipe says about the start.

    Parameters
    ----------
    picks : landmarks, or None
    cad_from_measured : where the part is before the rig, or before the first camera where there is none; None: unknown
    refine : whether that place is refined
    """

    picks: Picks | None
    cad_from_measured: Pose | None
    refine: bool

    def __call__(
        self,
        photographs: Sequence[Photograph],
        masks: Sequence[Booleans | None],
        rig: Rig | None,
        focals: Sequence[float | None],
        nominal: Nominal,
    ) -> Begin:
        """Return where the solver begins: from the calibration, from landmarks, or else found from the pictures alone.

        Parameters
        ----------
        masks : of each photograph, True where it may be used, or None
        rig : what a calibration says about the cameras, or None
        focals : px, rough focal length of each camera; None: by the EXIF data, or by six picks

        Raises
        ------
        MeasurementError
            The landmarks do not fit the part, or the pictures alone do not tell where it is.
        """
        scenery = Scenery(nominal, photographs, masks)
        return self._calibrated(rig, scenery) if rig else self._uncalibrated(focals, scenery)

    def _calibrated(self, rig: Rig, scenery: Scenery) -> Begin:
        lenses = tuple(_lens(sigma) for sigma in rig.sigmas)
        places = rig.camera_from_cad or rig.camera_from_rig
        if places is None or not rig.scaled:
            return self._free(rig.cameras, lenses, scenery, ())
        nodes = scenery.nominal.mesh.nodes
        cad_from_rig = self.cad_from_measured or Pose.identity()
        in_rig = tuple(map(View, rig.cameras, places))
        views = _before(in_rig, cad_from_rig)
        poses: Poses = "common" if self.refine else "known"
        found: Automatic | None = None
        remarks: tuple[str, ...] = ()
        if self.picks is not None and self.refine:
            freedom = Freedom(poses, lenses, views, self.picks.points_cad.mean(axis=0))
            placed = placed_by_picks(self.picks, views, rig.cameras, freedom)
            views, remarks = placed.views, (_fit_words(self.picks, placed.errors),)
        elif not rig.camera_from_cad and self.cad_from_measured is None:
            found = automatic(scenery, rig.cameras, lenses, in_rig, None)
            views, remarks = found.views, found.remarks
        cad_from_rig = views[0].camera_from_cad.inverse() @ in_rig[0].camera_from_cad
        x, y, z = (float(value) for value in cad_from_rig.translation)
        freedom = Freedom(poses, lenses, _before(in_rig, cad_from_rig), nodes.mean(axis=0), _stands(rig), (x, y, z))
        begin = Begin(views, freedom, in_rig[0], remarks)
        return replace(begin, symmetric=found.symmetric, figures=found.figures) if found else begin

    def _uncalibrated(self, focals: Sequence[float | None], scenery: Scenery) -> Begin:
        photographs, nodes = scenery.photographs, scenery.nominal.mesh.nodes
        rough = [
            self._rough(k, photograph, focal, nodes)
            for k, (photograph, focal) in enumerate(zip(photographs, focals, strict=True))
        ]
        words = "; ".join(
            f"picture {k}: {focal:.0f} px ± {100 * share:.0f} % by {origin}"
            for k, (focal, share, origin) in enumerate(rough, start=1)
        )
        lenses = tuple(
            Lens(share * focal, CENTRE * max(photograph.size), DISTORTION)
            for (focal, share, _), photograph in zip(rough, photographs, strict=True)
        )
        cameras = tuple(ideal_camera(each[0], p.size) for each, p in zip(rough, photographs, strict=True))
        remark = f"Rough focal lengths to start with, and how well known: {words}."
        return self._free(cameras, lenses, scenery, (remark,))

    def _rough(self, k: int, photograph: Photograph, focal: float | None, nodes: Floats) -> tuple[float, float, str]:
        """Return the focal length (px) of picture k, its relative uncertainty, and where it is from."""
        if focal is not None:
            return focal, ROUGH, "the recipe"
        if photograph.focal is not None:
            return photograph.focal, ROUGH, "the EXIF data"
        if self.picks is None:
            raise MeasurementError("Nothing tells the focal lengths: give a rough `focal`, px.")
        matrix = view_from_dlt(self.picks.points_cad, self.picks.pixels[:, k], photograph.size, nodes).camera.matrix
        return float(np.sqrt(matrix[0, 0] * matrix[1, 1])), WIDE, "the landmarks (direct linear transformation)"

    def _free(
        self, cameras: tuple[Camera, ...], lenses: tuple[Lens, ...], scenery: Scenery, remarks: tuple[str, ...]
    ) -> Begin:
        """Return the start of cameras whose places are unknown."""
        priors = tuple(View(camera, Pose.identity()) for camera in cameras)
        last = Freedom("free", lenses, priors, scenery.nominal.mesh.nodes.mean(axis=0))
        if self.picks is None:
            found = automatic(scenery, cameras, lenses, (), self.cad_from_measured)
            return Begin(found.views, last, None, (*remarks, *found.remarks), found.symmetric, found.figures)
        freedom = Freedom("free", lenses, priors, self.picks.points_cad.mean(axis=0))
        placed = placed_by_picks(self.picks, (), cameras, freedom)
        return Begin(placed.views, last, None, (*remarks, _fit_words(self.picks, placed.errors)))


def _before(in_rig: Sequence[View], cad_from_rig: Pose) -> tuple[View, ...]:
    """Return the cameras of a rig before the part."""
    back = cad_from_rig.inverse()
    return tuple(View(view.camera, view.camera_from_cad @ back) for view in in_rig)


def _fit_words(picks: Picks, errors: Floats) -> str:
    rms = np.sqrt((errors**2).mean())
    return f"The cameras started from {len(picks)} landmarks, which fit within {rms:.2g} px rms."


def _stands(rig: Rig) -> tuple[Stand, ...]:
    """Return how well the places of the cameras are known; empty where the calibration states no uncertainty."""
    stands = tuple(Stand(sigma.rotation, sigma.translation) if sigma else Stand() for sigma in rig.sigmas)
    return stands if any(stand.sigmas.any() for stand in stands) else ()


def _lens(sigma: CameraSigma | None) -> Lens:
    if sigma is None:
        return Lens()
    return Lens(sigma.focal, sigma.centre, tuple(float(value) for value in sigma.distortion))
