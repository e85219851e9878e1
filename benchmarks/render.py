"""How long does a virtual photograph take, and what does each more line of sight a pixel buy?

    python benchmarks/render.py

Photographs the freeform sheet of the virtual rig with 5 megapixels, after the kernels are compiled. The error is that
of the picture against one with 36 lines of sight a pixel, over a window in the middle, as a share of full scale.
"""

from __future__ import annotations

import os
import time
from dataclasses import replace

import numpy as np

from inspect3d.camera import Camera, View
from inspect3d.virtual.scene import Scene
from inspect3d.virtual.stereo_datasets import smooth_stereo
from inspect3d.virtual.virtual_camera import VirtualCamera

WINDOW = 200  # px
EXACT = 6


def windowed(camera: VirtualCamera) -> VirtualCamera:
    """Return the camera with a sensor that covers only the middle of the picture."""
    lens = camera.view.camera
    matrix = lens.matrix.copy()
    matrix[:2, 2] -= (np.array(lens.size) - WINDOW) // 2
    return replace(camera, view=View(Camera(matrix, lens.distortion, (WINDOW, WINDOW)), camera.view.camera_from_cad))


def main() -> None:
    """Print one line per number of samples."""
    dataset = smooth_stereo(0)
    scene = Scene(dataset.part.surface(), dataset.deviation, dataset.speckle)
    camera = dataset.cameras[0]
    width, height = camera.view.camera.size
    small = windowed(camera)
    for blur in (0.0, 0.6):
        exact = replace(small, samples=EXACT, blur=blur).light(scene)
        print(f"{width} x {height} px, blur {blur} px, {os.cpu_count()} cores")
        for samples in (1, 2, 3):
            start, busy = time.perf_counter(), time.process_time()
            replace(camera, samples=samples, blur=blur)(scene, 0)
            seconds, busy = time.perf_counter() - start, time.process_time() - busy
            error = replace(small, samples=samples, blur=blur).light(scene) - exact
            print(
                f"  {samples**2} a pixel: {seconds:5.1f} s ({busy:5.1f} s of processor time), "
                f"off by {np.sqrt(np.mean(error**2)):.1e} rms"
            )


if __name__ == "__main__":
    main()
