"""Where stereocorrelation begins: the cameras, and what is not known about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import Camera, View
from inspect3d.correlation.freedom import Freedom, Lens, Poses, Stand
from inspect3d.correlation.picks import Picks, ideal_camera, placed_by_picks, view_from_dlt
from inspect3d.files.calibration import CameraSigma, Rig
from inspect3d.files.photograph import Photograph
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
    """

    views: tuple[View, ...]
    freedom: Freedom
    rig_view: View | None
    remarks: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class StereoStart:
    """What a recipe says about the start.

    Parameters
    ----------
    picks : landmarks, or None
    rig_from_cad : where the part starts in the frame of a calibration that has one
    refine : whether its place there is refined
    """

    picks: Picks | None
    rig_from_cad: Pose
    refine: bool

    def calibrated(self, rig: Rig, nodes: Floats) -> Begin:
        """Return the start with calibrated cameras.

        Parameters
        ----------
        nodes : (n, 3) mm, of the part

        Raises
        ------
        MeasurementError
            The landmarks do not fit the part, or there are none and they are needed.
        """
        lenses = tuple(_lens(sigma) for sigma in rig.sigmas)
        places = rig.camera_from_cad or rig.camera_from_rig
        if places is None or not rig.scaled:
            return self._picked(rig.cameras, lenses, nodes, ())
        first = View(rig.cameras[0], places[0])
        views = tuple(View(c, place @ self.rig_from_cad) for c, place in zip(rig.cameras, places, strict=True))
        poses: Poses = "common" if self.refine else "known"
        start, cad_from_rig = views, self.rig_from_cad.inverse()
        remarks: tuple[str, ...] = ()
        if self.picks is not None and self.refine:
            freedom = Freedom(poses, lenses, views, self.picks.points_cad.mean(axis=0))
            placed = placed_by_picks(self.picks, views, rig.cameras, freedom)
            start, remarks = placed.views, (_fit_words(self.picks, placed.errors),)
            cad_from_rig = start[0].camera_from_cad.inverse() @ first.camera_from_cad
        priors = tuple(View(c, place @ cad_from_rig.inverse()) for c, place in zip(rig.cameras, places, strict=True))
        x, y, z = (float(value) for value in cad_from_rig.translation)
        freedom = Freedom(poses, lenses, priors, nodes.mean(axis=0), _stands(rig), (x, y, z))
        return Begin(start, freedom, first, remarks)

    def uncalibrated(self, photographs: Sequence[Photograph], focals: Sequence[float | None], nodes: Floats) -> Begin:
        """Return the start with lenses that nobody calibrated, from picks.

        Parameters
        ----------
        focals : px, rough focal length of each camera; None: by the EXIF data, or by six picks
        nodes : (n, 3) mm, of the part

        Raises
        ------
        MeasurementError
            The landmarks are missing, do not fit the part, or are too flat to give the focal length.
        """
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
        return self._picked(cameras, lenses, nodes, (remark,))

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

    def _picked(
        self, cameras: tuple[Camera, ...], lenses: tuple[Lens, ...], nodes: Floats, remarks: tuple[str, ...]
    ) -> Begin:
        """Return the start of cameras whose places are unknown."""
        if self.picks is None:
            raise MeasurementError("Nothing tells where the cameras stand before the part: pick 4 or more landmarks.")
        priors = tuple(View(camera, Pose.identity()) for camera in cameras)
        freedom = Freedom("free", lenses, priors, self.picks.points_cad.mean(axis=0))
        placed = placed_by_picks(self.picks, (), cameras, freedom)
        freedom = Freedom("free", lenses, priors, nodes.mean(axis=0))
        return Begin(placed.views, freedom, None, (*remarks, _fit_words(self.picks, placed.errors)))


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
