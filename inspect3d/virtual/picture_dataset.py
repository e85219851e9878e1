"""Virtual photographs as a folder: CAD, pictures, calibration, truth and a recipe to run on them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from string import Template

import numpy as np

from inspect3d.files.calibration_json import write_calibration_json
from inspect3d.outcome import InputError
from inspect3d.virtual.camera_knowledge import CameraKnowledge
from inspect3d.virtual.deviation_field import DeviationField
from inspect3d.virtual.part import Part
from inspect3d.virtual.picks import picks
from inspect3d.virtual.picture_truth import PictureTruth
from inspect3d.virtual.scene import Scene
from inspect3d.virtual.speckle import Speckle
from inspect3d.virtual.virtual_camera import VirtualCamera

PAIR = ("left.png", "right.png")


@dataclass(frozen=True, eq=False)
class PictureDataset:
    """What photographs of a virtual part consist of.

    Parameters
    ----------
    part : as designed
    deviation : how the real part differs from it
    speckle : paint
    cameras : in their places before the part
    knowledge : what calibration.json says about them; None leaves the file out
    picked : how many points are picked in the pictures; 0 leaves them out
    picking_noise : px, standard deviation of a click
    focal_error : relative error of the focal length that the recipe gives
    recipe : text of recipe.toml; it names part.step and calibration.json, and $images, $focal and $landmarks stand
        for the names of the pictures, the rough focal length in px and the rows of picked points
    """

    part: Part
    deviation: DeviationField
    speckle: Speckle
    cameras: tuple[VirtualCamera, ...]
    recipe: str
    knowledge: CameraKnowledge | None = None
    picked: int = 0
    picking_noise: float = 1.5
    focal_error: float = 0.03

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the pictures: left and right, or view1 and so on where there are more than two."""
        count = len(self.cameras)
        return PAIR if count == len(PAIR) else tuple(f"view{k}.png" for k in range(1, count + 1))

    def write(self, folder: Path, seed: int) -> PictureTruth:
        """Photograph, and write the files into a folder; existing ones are replaced.

        Parameters
        ----------
        seed : of noise, picks and errors of the calibration; the same seed gives the same files

        Raises
        ------
        InputError
            The folder cannot be written.
        """
        views = tuple(camera.view for camera in self.cameras)
        scene = Scene(self.part.surface(), self.deviation, self.speckle)
        warps = tuple(camera.warp for camera in self.cameras)
        noise = max(camera.sensor.noise for camera in self.cameras)
        truth = PictureTruth(self.deviation, views, warps, noise, seed)
        seeds = [int(value) for value in np.random.SeedSequence(seed).generate_state(len(views) + 2)]
        rows = picks(scene, views, self.picked, self.picking_noise, seeds[-1]).rows() if self.picked else ""
        focal = float(np.mean([view.camera.matrix[0, 0] for view in views])) * (1.0 + self.focal_error)
        values = {"images": ", ".join(f'"{name}"' for name in self.names), "focal": f"{focal:.1f}", "landmarks": rows}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for name, camera, own in zip(self.names, self.cameras, seeds, strict=False):
                (folder / name).write_bytes(_png(camera, scene, own))
            if self.knowledge is not None:
                rig = self.knowledge(views, np.random.default_rng(seeds[-2]))
                write_calibration_json(folder / "calibration.json", rig, self.names)
            truth.write(folder / "truth.json")
            (folder / "recipe.toml").write_text(Template(self.recipe).substitute(values), encoding="utf-8")
        except OSError as error:
            raise InputError(f"{folder} cannot be written: {error.strerror}. Choose another folder.") from error
        self.part.write_step(folder / "part.step")
        return truth


def _png(camera: VirtualCamera, scene: Scene, seed: int) -> bytes:
    """Return a photograph as a PNG file."""
    import cv2

    return cv2.imencode(".png", camera(scene, seed))[1].tobytes()
