"""The studies of the paper as datasets: one part, several methods, one recipe that compares them.

L. Dubreuil, J.-E. Dufour, Y. Quinsat, F. Hild, Mesh-Based Shape Measurements with Stereocorrelation: Principle and
First Results, Exp. Mech. 56, 2016.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from inspect3d.virtual.dataset import Dataset
from inspect3d.virtual.deviation_field import Uniform
from inspect3d.virtual.laser_scanner import LaserScanner
from inspect3d.virtual.milled import machining, milled
from inspect3d.virtual.random_pose import random_pose
from inspect3d.virtual.stereo_datasets import MILLED_MIDDLE, photographed
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d.virtual.study import Study

PAINT = 0.040  # mm, thickness in the paper
SEEN_FROM = ((0.0, 0.0, 1.0), (0.4, 0.3, 1.0), (-0.4, -0.2, 1.0))

MILLED_PART = """\
# {title}
schema = 1

[part]
name = "Milled block"
cad = "part.step"
element_size = 2.0               # mm
tolerance = [-0.05, 0.05]        # mm
"""

LASER = """
[[measurements]]
name = "laser"                   # before the part was painted
method = "scan"
files = ["{folder}scan.ply"]
noise = 0.02                     # mm, standard noise of a point
"""

STEREO = """
[[measurements]]
name = "stereo"
method = "stereocorrelation"
images = ["{folder}view1.png", "{folder}view{opposite}.png"]
cameras = "{folder}calibration.json"
coating = {{ thickness = 0.040, sigma = 0.005 }}
alignment = {{ start = "identity" }}
"""

MILLED_REPORT = """
[report]
formats = ["html", "pdf"]
sections = [ { point = [50, 35, 25], normal = [0, 1, 0] } ]
labels = [ { name = "mismatch", point = [55, 35, 29] } ]
"""


def milled_study(seed: int, rig: StereoRig | None = None) -> Study:
    """Return the paper's section 4: a milled block, scanned with a laser plane, then painted and photographed."""
    rig = rig or StereoRig(cameras=8).halved()
    deviation, opposite = machining(pitch=4.0), rig.cameras // 2 + 1
    scanner = LaserScanner(
        noise=0.02,
        views=SEEN_FROM,
        line_spacing=0.3,
        point_spacing=0.3,
        foreign=0.03,
        scan_from_cad=random_pose(np.random.default_rng(seed)),
    )
    scan = Dataset(
        milled(), deviation, scanner, MILLED_PART.format(title="The laser scan alone.") + LASER.format(folder="")
    )
    alone = MILLED_PART.format(title="The photographs alone.") + STEREO.format(folder="", opposite=opposite)
    photographs = photographed(milled(), deviation + Uniform(PAINT), rig, MILLED_MIDDLE, seed, alone)
    recipe = (
        MILLED_PART.format(title="A milled block of the virtual rig by several methods; the truth is in the folders.")
        + LASER.format(folder="scan/")
        + STEREO.format(folder="photographs/", opposite=opposite)
        + MILLED_REPORT
    )
    return Study(milled(), {"scan": scan, "photographs": photographs}, recipe)


STUDIES: Mapping[str, Callable[[int], Study]] = MappingProxyType({"milled-study": milled_study})
