"""Random virtual scenes for a start without a click: four parts in any pose before two to four cameras."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from inspect3d.arrays import Floats, unit
from inspect3d.camera import View
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nominal import Nominal
from inspect3d.virtual.bracket import bracket
from inspect3d.virtual.deviation_field import DeviationField, Sum, Wave
from inspect3d.virtual.freeform import freeform
from inspect3d.virtual.milled import milled
from inspect3d.virtual.part import Part
from inspect3d.virtual.part_surface import PartSurface
from inspect3d.virtual.scene import Scene
from inspect3d.virtual.sensor import Sensor
from inspect3d.virtual.speckle import Speckle
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d.virtual.virtual_camera import VirtualCamera

SIZE = (1224, 1024)
FILLED = 0.3, 0.9  # share of a picture that the part takes along the side where it is largest
DOT = 5.0  # px, diameter of a dot of the speckle
WIDEST_TILT = 40.0  # degrees, of an open sheet, which has one side only
FORM = Sum((Wave(0.03, (0.009, 0.004, 0.003), 0.3), Wave(0.02, (-0.005, 0.012, 0.006), 1.9)))


def cover() -> Part:
    """Return a cast cover: a slab with a dome, a pipe and a corner cut off; no symmetry."""
    return Part("cover", _cover)


def _cover() -> Any:
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    slab = BRepPrimAPI_MakeBox(90.0, 64.0, 18.0).Shape()
    dome = BRepPrimAPI_MakeSphere(gp_Pnt(32.0, 30.0, 10.0), 24.0).Shape()
    pipe = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(70.0, 44.0, 0.0), gp_Dir(0, 0, 1)), 10.0, 32.0).Shape()
    body = BRepAlgoAPI_Fuse(BRepAlgoAPI_Fuse(slab, dome).Shape(), pipe).Shape()
    below = BRepPrimAPI_MakeBox(gp_Pnt(-5.0, -5.0, -40.0), gp_Pnt(95.0, 70.0, 0.0)).Shape()
    slant = gp_Ax2(gp_Pnt(90.0, 0.0, -1.0), gp_Dir(0, 0, 1), gp_Dir(1, -0.6, 0))
    corner = BRepPrimAPI_MakeBox(slant, 30.0, 30.0, 60.0).Shape()
    return BRepAlgoAPI_Cut(BRepAlgoAPI_Cut(body, below).Shape(), corner).Shape()


PARTS = {"freeform": freeform, "milled": milled, "bracket": bracket, "cover": cover}


@dataclass(frozen=True, eq=False)
class RandomScene:
    """What one scene consists of.

    Parameters
    ----------
    part : its name
    views : the true cameras
    grey : their pictures
    focal : px, the rough focal length that the recipe would state
    element : mm
    deviation : of the true part
    """

    part: str
    views: tuple[View, ...]
    grey: tuple[Floats, ...]
    focal: float
    element: float
    deviation: DeviationField


@cache
def surface(part: str) -> PartSurface:
    """Return the exact surface of a part."""
    return PARTS[part]().surface(2e-3)


@cache
def nominal(part: str, element: float) -> Nominal:
    """Return a part as designed."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.step"
        PARTS[part]().write_step(path)
        return load_nominal(path, element_size=element)


def random_scene(seed: int) -> RandomScene:
    """Return a scene: each fourth has the same part; all else is drawn."""
    random = np.random.default_rng([5, seed])
    part = tuple(PARTS)[seed % len(PARTS)]
    shape = surface(part)
    cameras, angle = int(random.integers(2, 5)), np.radians(random.uniform(15, 45))
    true, fill = random.uniform(2500, 6000), random.uniform(*FILLED)
    toward = unit(random.normal(size=3))
    if part == "freeform":
        tilt, turn = np.radians(WIDEST_TILT) * np.sqrt(random.random()), random.uniform(0, 2 * np.pi)
        toward = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
    up = unit(np.cross(toward, random.normal(size=3)))
    corners = shape.vertices
    across = np.stack([corners @ np.cross(up, toward), corners @ up], axis=1)
    low, high = across.min(axis=0), across.max(axis=0)
    scale = fill * float(np.min(SIZE / (high - low)))
    along = corners @ toward
    target = (low + high) / 2 @ np.stack([np.cross(up, toward), up]) + (along.min() + along.max()) / 2 * toward
    rig = StereoRig(cameras, angle, scale, true, SIZE, toward=tuple(toward), up=tuple(up), offset=3.0, spread=0.002)
    views = rig(target, seed)
    largest = max(_filled(view, corners) for view in views)
    if largest > FILLED[1]:  # one camera stands closer to an end of the part than the rig to its middle
        scale *= FILLED[1] / largest
        views = replace(rig, scale=scale)(target, seed)
    scene = Scene(shape, FORM, Speckle(dot=DOT / scale, seed=seed))
    grey = []
    for k, view in enumerate(views):
        sensor = Sensor(gain=random.uniform(0.8, 1.05), offset=random.uniform(0.02, 0.06))
        grey.append(VirtualCamera(view, sensor=sensor)(scene, 10 * seed + k).astype(np.float64))
    element = max(2.5, 4 * DOT / scale)
    return RandomScene(part, views, tuple(grey), true * random.uniform(0.95, 1.05), element, FORM)


def _filled(view: View, corners: Floats) -> float:
    """Return the share of a picture that points (n, 3) mm take along the side where they take most."""
    return float(np.max(np.ptp(view.project(corners), axis=0) / np.array(SIZE)))
