"""How long does pyxel-dic take on the pictures of `correlation_speed.py`, beside stereocorrelation?

    pip install pyxel-dic
    python benchmarks/against_pyxel.py

pyxel-dic matches one picture with the other in their plane, on a mesh of as many nodes, from its optical flow on; it
knows no cameras there and states no uncertainty. Stereocorrelation goes from the same pictures to the shape and its
uncertainty. Imports and the compiling of kernels are not counted. Where pyxel-dic is not installed nothing is run.
"""

from __future__ import annotations

import importlib.util
import os
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
from correlation_speed import SMALL, USUAL, made, run

from inspect3d.arrays import Floats
from inspect3d.correlation.correlate import Correlate

RUNS, TRI3 = 3, 2
ELEMENT, BORDER = 51, 25  # px


def main() -> None:
    """Print the median times of both."""
    if importlib.util.find_spec("pyxel") is None:
        print("pyxel-dic is not installed: install it beside inspect3d to compare.")
        return
    views, nominal, grey = made(SMALL)
    Correlate()(nominal, grey, views).uncertainty.variances.sum()
    views, nominal, grey = made(USUAL)
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; medians of {RUNS}, wall and processor time")
    ours = [sum(run(Correlate(), nominal, grey, views)[0].values()) for _ in range(RUNS)]
    print(f"stereocorrelation, {len(nominal.mesh):,} nodes: {_words(np.median(ours, axis=0))}")
    places = views[0].project(nominal.mesh.nodes)
    with tempfile.TemporaryDirectory() as folder:
        paths = [str(Path(folder) / name) for name in ("left.tif", "right.tif")]
        for path, picture in zip(paths, grey, strict=True):
            cv2.imwrite(path, np.asarray(picture).astype(np.uint8))
        nodes, theirs = 0, []
        for _ in range(RUNS):
            nodes, seconds = _pyxel(paths, places)
            theirs.append(seconds)
    print(f"pyxel-dic, {nodes:,} nodes: {_words(np.median(theirs, axis=0))}")
    print(f"ratio of the wall times {np.median(theirs, axis=0)[0] / np.median(ours, axis=0)[0]:.1f}")


def _pyxel(paths: list[str], places: Floats) -> tuple[int, Floats]:
    """Return the number of nodes, and wall and processor seconds (2,), of a mesh over places (n, 2) px."""
    import pyxel

    roi = np.stack([places.min(axis=0) + BORDER, places.max(axis=0) - BORDER]).astype(int)
    started = np.array([time.perf_counter(), time.process_time()])
    one, other = (pyxel.Image(path).Load() for path in paths)
    mesh, camera = pyxel.MeshFromROI(roi, [ELEMENT, ELEMENT], TRI3)
    mesh.Connectivity()
    start = pyxel.DISFlowInit(one, other, mesh, camera)[0]
    pyxel.Correlate(one, other, mesh, camera, U0=start, disp=False)
    return len(mesh.n), np.array([time.perf_counter(), time.process_time()]) - started


def _words(seconds: Floats) -> str:
    return f"{seconds[0]:.2f} s ({seconds[1]:.2f} s)"


if __name__ == "__main__":
    main()
