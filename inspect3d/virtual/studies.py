"""The studies of the paper as datasets: one part, several methods, one recipe that compares them.

L. Dubreuil, J.-E. Dufour, Y. Quinsat, F. Hild, Mesh-Based Shape Measurements with Stereocorrelation: Principle and
First Results, Exp. Mech. 56, 2016.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from inspect3d.virtual.camera_knowledge import rig_known
from inspect3d.virtual.dataset import Dataset
from inspect3d.virtual.deviation_field import Uniform
from inspect3d.virtual.laser_scanner import LaserScanner
from inspect3d.virtual.milled import machining, milled
from inspect3d.virtual.picture_dataset import PictureDataset
from inspect3d.virtual.random_pose import random_pose
from inspect3d.virtual.stereo_datasets import AROUND, MILLED_MIDDLE, photographed
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d.virtual.study import Study

PAINT = 0.040  # mm, thickness in the paper
SEEN_FROM = ((0.0, 0.0, 1.0), (0.4, 0.3, 1.0), (-0.4, -0.2, 1.0))

MILLED_PART = """\
# A milled block of the virtual rig by several methods; the truth is in the folders of scan and photographs.
schema = 1

[part]
name = "Milled block"
cad = "part.step"
element_size = 2.0               # mm
tolerance = [-0.05, 0.05]        # mm

[[part.features]]
name = "mismatch"
kind = "step"
place = { box = [[46.5, 4, 15], [68, 44, 60]] }
across = [1, 0, 0]
point = [52, 0, 0]
wavelength = 4.0

[[part.features]]
name = "errors of the facets"
kind = "waviness"
place = { box = [[14.5, 4, 15], [45.5, 44, 60]] }
across = [1, 0, 0]
wavelength = 16.0

[[part.features]]
name = "scallops"
kind = "scallops"
place = { box = [[53, 4, 15], [85, 44, 60]] }
across = [1, 0, 0]
wavelength = 4.0
"""

LASER = """
[[measurements]]
name = "laser"                   # before the part was painted
method = "scan"
files = ["{folder}scan.ply"]
noise = 0.02                     # mm, standard noise of a point
"""

PHOTOGRAPHS = """
[[measurements]]
name = "stereo"
method = "stereocorrelation"     # no landmarks: the start is found by itself
images = ["{folder}view1.png", "{folder}view3.png"]
cameras = "{folder}calibration.json"
coating = {{ thickness = 0.040, sigma = 0.005 }}

[[measurements]]
name = "splines"
method = "isogeometric"          # the control points of the CAD's faces from the same two photographs
images = ["{folder}view1.png", "{folder}view3.png"]
cameras = "{folder}calibration.json"
coating = {{ thickness = 0.040, sigma = 0.005 }}
refine = 2                       # a CAD of few control points follows no defect: every span is quartered

[[measurements]]
name = "photogrammetry"
method = "colmap"
images = [{images}]
cameras = "{folder}calibration.json"
coating = {{ thickness = 0.040, sigma = 0.005 }}
"""

MILLED_REPORT = """
[report]
formats = ["html", "pdf"]
sections = [ { point = [50, 35, 25], normal = [0, 1, 0] } ]
labels = [ { name = "mismatch", point = [54, 35, 29] } ]
"""


def milled_study(seed: int, rig: StereoRig | None = None) -> Study:
    """Return the paper's section 4: a milled block, scanned with a laser plane, then painted and photographed."""
    deviation = machining(pitch=4.0)
    scanner = LaserScanner(
        noise=0.02,
        views=SEEN_FROM,
        line_spacing=0.3,
        point_spacing=0.3,
        foreign=0.03,
        scan_from_cad=random_pose(np.random.default_rng(seed)),
    )
    painted, rig = deviation + Uniform(PAINT), rig or AROUND.halved()
    alone = MILLED_PART + _photographs("", rig.cameras)
    photographs = photographed(milled(), painted, rig, MILLED_MIDDLE, seed, alone)
    datasets: dict[str, Dataset | PictureDataset] = {
        "scan": Dataset(milled(), deviation, scanner, MILLED_PART + LASER.format(folder="")),
        "photographs": replace(photographs, knowledge=rig_known),
    }
    tables = LASER.format(folder="scan/") + _photographs("photographs/", rig.cameras)
    return Study(milled(), datasets, MILLED_PART + tables + MILLED_REPORT)


def _photographs(folder: str, count: int) -> str:
    """Return the tables of the methods that measure from photographs in a folder."""
    images = ", ".join(f'"{folder}view{k}.png"' for k in range(1, count + 1))
    return PHOTOGRAPHS.format(folder=folder, images=images)


STUDIES: Mapping[str, Callable[[int], Study]] = MappingProxyType({"milled-study": milled_study})
