"""What is true about virtual photographs, kept beside them as truth.json."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inspect3d.camera import Camera, View
from inspect3d.outcome import InputError
from inspect3d.pose import Pose
from inspect3d.virtual.deviation_field import DeviationField, described, field_of
from inspect3d.virtual.warp import Warp


@dataclass(frozen=True, eq=False)
class PictureTruth:
    """The truth about photographs of a virtual part.

    Parameters
    ----------
    deviation : how the part differs from its CAD; at nodes (n, 3) mm of the inspection mesh, `deviation(nodes)` is
        the true map, (n,) mm
    views : the true cameras in their true places, in the order of the pictures
    warps : what their distortion leaves out; None for a lens without such an error
    noise : standard noise of the grey levels, as a share of full scale
    seed : of everything
    """

    deviation: DeviationField
    views: tuple[View, ...]
    warps: tuple[Warp | None, ...]
    noise: float
    seed: int

    def write(self, path: Path) -> None:
        """Write the truth as JSON."""
        cameras = [
            {
                "matrix": view.camera.matrix.tolist(),
                "distortion": view.camera.distortion.tolist(),
                "size": list(view.camera.size),
                "camera_from_cad": view.camera_from_cad.matrix.tolist(),
                "warp": None if warp is None else vars(warp),
            }
            for view, warp in zip(self.views, self.warps, strict=True)
        ]
        content = {
            "schema": 1,
            "deviation": described(self.deviation),
            "cameras": cameras,
            "noise": self.noise,
            "seed": self.seed,
        }
        lines = (f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in content.items())
        path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> PictureTruth:
        """Read what `write` wrote.

        Raises
        ------
        InputError
            The file is not there, or is no truth about photographs.
        """
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            views = tuple(
                View(
                    Camera(np.array(camera["matrix"]), np.array(camera["distortion"]), tuple(camera["size"])),
                    Pose.from_matrix(np.array(camera["camera_from_cad"])),
                )
                for camera in content["cameras"]
            )
            warps = tuple(camera["warp"] and Warp(**camera["warp"]) for camera in content["cameras"])
            return cls(field_of(content["deviation"]), views, warps, float(content["noise"]), int(content["seed"]))
        except (OSError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path} holds no truth of virtual photographs: {error}") from error
