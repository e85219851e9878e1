"""The datasets that the project makes itself, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from inspect3d.outcome import InputError
from inspect3d.virtual.bracket import bracket
from inspect3d.virtual.dataset import Dataset
from inspect3d.virtual.deviation_field import Bump, Sum, Wave
from inspect3d.virtual.freeform import FreeformSizes, freeform, freeform_patch
from inspect3d.virtual.laser_scanner import LaserScanner
from inspect3d.virtual.milled import machining, milled
from inspect3d.virtual.picture_dataset import PictureDataset
from inspect3d.virtual.picture_truth import PictureTruth
from inspect3d.virtual.plan import load_plan
from inspect3d.virtual.random_pose import random_pose
from inspect3d.virtual.stereo_datasets import PHOTOGRAPHED
from inspect3d.virtual.studies import STUDIES
from inspect3d.virtual.study import Study
from inspect3d.virtual.truth import Truth

AROUND = ((0.25, 0.1, 1.0), (1.0, 0.3, 0.6), (0.2, 1.0, 0.7), (0.2, -1.0, 0.7), (-1.0, -0.2, 0.5))
ABOVE = ((0.0, 0.0, 1.0), (0.4, 0.3, 1.0), (-0.4, -0.2, 1.0))

BRACKET_RECIPE = """\
# A bracket from the virtual rig (`inspect3d virtual bracket`): its true deviations are in truth.json.
schema = 1

[part]
name = "Bracket"
cad = "part.step"
element_size = 2.0               # mm
tolerance = [-0.1, 0.1]          # mm
regions = [ { name = "boss top", box = [[53, 44, 21], [79, 70, 23]], tolerance = [-0.05, 0.05] } ]

[[measurements]]
name = "laser"
method = "scan"
files = ["scan.ply"]
units = "mm"
noise = 0.02                     # mm, standard noise of a point

[report]
labels = [
  { name = "bump", point = [40, 50, 12] },
  { name = "wall", point = [12, 18, 45] },
  { name = "boss", point = [66, 57, 22] },
]
"""

FREEFORM_RECIPE = """\
# The freeform sheet from the virtual rig (`inspect3d virtual freeform`): its true deviations are in truth.json.
schema = 1

[part]
name = "Freeform sheet"
cad = "part.step"
element_size = 3.0               # mm
tolerance = [-0.08, 0.08]        # mm

[[measurements]]
name = "laser"
method = "scan"
files = ["scan.ply"]
units = "mm"
noise = 0.02                     # mm, standard noise of a point
"""

MILLED_RECIPE = """\
# The milled block from the virtual rig (`inspect3d virtual milled`): its true deviations are in truth.json.
schema = 1

[part]
name = "Milled block"
cad = "part.step"
element_size = 2.0               # mm
tolerance = [-0.05, 0.05]        # mm

[[measurements]]
name = "laser"
method = "scan"
files = ["scan.ply"]
units = "mm"
noise = 0.02                     # mm, standard noise of a point
"""


def make_dataset(name: str, folder: Path, seed: int = 0) -> Truth | PictureTruth | None:
    """Make one of `DATASETS`, or what a plan asks for, and write it into a folder.

    Parameters
    ----------
    name : of a dataset, or the path of a plan, a TOML file; see `load_plan`
    seed : of everything random; the same seed gives the same files

    Raises
    ------
    InputError
        There is no dataset of that name, the plan is wrong, or the folder cannot be written.
    """
    if name.endswith(".toml"):
        return load_plan(Path(name), seed).write(folder, seed)
    if name not in DATASETS:
        raise InputError(
            f"There is no virtual dataset {name!r}; choose one of {', '.join(DATASETS)}, or give a plan.toml."
        )
    return DATASETS[name](seed).write(folder, seed)


def _bracket(seed: int) -> Dataset:
    """Bump of 0.3 mm, form error of some hundredths, 3 % foreign points; about 60,000 points."""
    form = Sum(
        (
            Wave(0.018, (0.008, 0.003, 0.002), 0.7),
            Wave(0.012, (-0.004, 0.011, 0.005), 2.1),
            Wave(0.008, (0.006, -0.007, 0.014), 4.0),
        )
    )
    bump = Bump(centre=(40.0, 50.0, 12.0), height=0.3, width=8.0)
    scanner = LaserScanner(
        noise=0.02,
        views=AROUND,
        line_spacing=0.9,
        point_spacing=0.6,
        foreign=0.03,
        holes=4,
        hole_width=7.0,
        scan_from_cad=random_pose(np.random.default_rng(seed)),
    )
    return Dataset(bracket(), form + bump, scanner, BRACKET_RECIPE)


def _freeform(seed: int) -> Dataset:
    """Form error, a bump and a dent on a smooth sheet; about 100,000 points."""
    form = Sum((Wave(0.02, (0.009, 0.004, 0.0), 0.3), Wave(0.015, (-0.005, 0.012, 0.0), 1.9)))
    sizes = FreeformSizes()
    (bump, dent), _ = freeform_patch(sizes)(np.array([[0.33, 0.62], [0.75, 0.31]]))
    bumps = Bump(tuple(bump.tolist()), height=0.1, width=12.0) + Bump(tuple(dent.tolist()), height=-0.08, width=9.0)
    scanner = LaserScanner(
        noise=0.02,
        views=ABOVE,
        line_spacing=0.8,
        point_spacing=0.32,
        foreign=0.03,
        scan_from_cad=random_pose(np.random.default_rng(seed)),
    )
    return Dataset(freeform(sizes), form + bumps, scanner, FREEFORM_RECIPE)


def _milled(seed: int) -> Dataset:
    """Mismatch of 40 µm on the cylindrical section, 15 µm errors on the facets, 12 µm scallops."""
    scanner = LaserScanner(
        noise=0.02,
        views=ABOVE,
        line_spacing=0.5,
        point_spacing=0.4,
        foreign=0.03,
        scan_from_cad=random_pose(np.random.default_rng(seed)),
    )
    return Dataset(milled(), machining(pitch=1.6), scanner, MILLED_RECIPE)


SCANNED: Mapping[str, Callable[[int], Dataset]] = MappingProxyType(
    {"bracket": _bracket, "freeform": _freeform, "milled": _milled}
)
DATASETS: Mapping[str, Callable[[int], Dataset | PictureDataset | Study]] = MappingProxyType(
    {**SCANNED, **PHOTOGRAPHED, **STUDIES}
)
