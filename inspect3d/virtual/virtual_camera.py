"""A camera that photographs a virtual part."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from os import cpu_count

import numpy as np
from numpy.typing import NDArray

from inspect3d.arrays import Floats, unit
from inspect3d.camera import View
from inspect3d.outcome import InputError
from inspect3d.virtual.deviation_field import Vector
from inspect3d.virtual.scene import Scene
from inspect3d.virtual.sensor import Sensor
from inspect3d.virtual.warp import Warp

BAND = 1 << 17  # rays that one thread works on at a time


@dataclass(frozen=True, eq=False)
class VirtualCamera:
    """A camera before a virtual part.

    Each pixel is the mean of `samples` x `samples` lines of sight, regularly spaced over it, each bent by the lens. The
    blur acts on that finer grid, before the pixels collect the light, as it does in a real camera.

    Parameters
    ----------
    view : lens and place
    samples : lines of sight a pixel, along each side: 2 makes 4 a pixel
    blur : px, standard deviation of a Gaussian, of the lens
    lamp : direction from the part toward the light, CAD frame; None lights every place alike
    ambient : share of the light that comes from everywhere, where there is a lamp
    vignetting : share of the light lost at the corners of the picture, growing with the square of the radius
    background : light where there is no part
    warp : a smooth error of the lens, which neither `view` nor a calibration knows; None is none
    sensor : what makes grey levels of the light
    """

    view: View
    samples: int = 2
    blur: float = 0.6
    lamp: Vector | None = None
    ambient: float = 0.4
    vignetting: float = 0.0
    background: float = 0.03
    warp: Warp | None = None
    sensor: Sensor = field(default_factory=Sensor)

    def __post_init__(self) -> None:
        if self.samples < 1 or self.blur < 0.0:
            raise ValueError("there is at least one sample a pixel, and the blur is not negative")
        if not (0.0 <= self.ambient <= 1.0 and 0.0 <= self.vignetting <= 1.0):
            raise ValueError("ambient light and vignetting are shares between 0 and 1")

    def __call__(self, scene: Scene, seed: int) -> NDArray[np.uint8] | NDArray[np.uint16]:
        """Return a photograph, (rows, columns) grey levels; the same seed gives the same noise."""
        return self.sensor(self.light(scene), np.random.default_rng(seed))

    def light(self, scene: Scene) -> Floats:
        """Return the light (rows, columns) that reaches the pixels, between 0 and 1, free of noise.

        Raises
        ------
        InputError
            The lens folds the picture.
        """
        import cv2

        width, height = self.view.camera.size
        count = self.samples
        columns, rows = (_centres(length, count) for length in (width, height))
        fine = np.empty((height * count, width * count), np.float32)
        step = max(1, BAND // len(columns))
        scene.prepare()

        def fill(start: int) -> None:
            fine[start : start + step] = self._seen(scene, columns, rows[start : start + step])

        with ThreadPoolExecutor(cpu_count()) as pool:
            list(pool.map(fill, range(0, len(rows), step)))
        if self.blur > 0.0:
            cv2.GaussianBlur(fine, (0, 0), self.blur * count, dst=fine, borderType=cv2.BORDER_REPLICATE)
        light = fine.reshape(height, count, width, count).mean(axis=(1, 3), dtype=np.float64)
        return light * self._falloff()

    def _seen(self, scene: Scene, columns: Floats, rows: Floats) -> Floats:
        """Return the light along the lines of sight of a grid of sub-pixels, (rows, columns)."""
        from inspect3d.virtual.sight_kernel import write_sights

        camera, pose = self.view.camera, self.view.camera_from_cad
        pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
        if self.warp is not None:
            pixels += self.warp(columns, rows)
        directions = np.empty((len(rows) * len(columns), 3))
        if not write_sights(camera.matrix, camera.distortion, pose.rotation, pixels.reshape(-1, 2), directions):
            raise InputError("The distortion of the lens cannot be undone over the whole picture: lower k1, k2 or k3.")
        sights = scene.sights(self.view.centre, directions)
        light = np.full(len(directions), self.background)
        hit = sights.hit
        light[hit] = scene.speckle(sights.points[hit])
        if self.lamp is not None:
            lit = np.maximum(sights.normals[hit] @ unit(np.array(self.lamp)), 0.0)
            light[hit] *= self.ambient + (1.0 - self.ambient) * lit
        return light.reshape(len(rows), len(columns))

    def _falloff(self) -> Floats:
        """Return the share of the light that each pixel gets, (rows, columns)."""
        width, height = self.view.camera.size
        x, y = np.arange(width) - (width - 1) / 2, np.arange(height)[:, None] - (height - 1) / 2
        return 1.0 - self.vignetting * (x**2 + y**2) / ((width**2 + height**2) / 4)


def _centres(length: int, count: int) -> Floats:
    """Return where the sub-pixels of a row of `length` pixels have their centres, px."""
    return (np.arange(length * count) + 0.5) / count - 0.5
