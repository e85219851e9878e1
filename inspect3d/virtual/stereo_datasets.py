"""The photographed datasets that the project makes itself, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import radians
from types import MappingProxyType

import numpy as np

from inspect3d.virtual.camera_knowledge import CameraKnowledge, LensesKnown, places_known, rig_known
from inspect3d.virtual.deviation_field import Bump, DeviationField, Sum, Uniform, Wave
from inspect3d.virtual.freeform import FreeformSizes, freeform, freeform_patch
from inspect3d.virtual.milled import machining, milled
from inspect3d.virtual.part import Part
from inspect3d.virtual.picture_dataset import PictureDataset
from inspect3d.virtual.sensor import Sensor
from inspect3d.virtual.speckle import Speckle
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d.virtual.virtual_camera import VirtualCamera

HEAD = """\
# {title} before the cameras of the virtual rig (`inspect3d virtual {name}`): the truth is in truth.json.
schema = 1

[part]
name = "{title}"
cad = "part.step"
element_size = {element_size}               # mm
tolerance = [-0.08, 0.08]        # mm

[[measurements]]
name = "stereo"
method = "stereocorrelation"
images = [$images]
"""

CAMERAS = 'cameras = "calibration.json"\n'
PLACED = 'alignment = { start = "identity", refine = false }\n'
FOCAL = "focal = $focal                   # px, a few per cent off\n"
MILLED_MIDDLE = (50.0, 35.0, 26.0)
LANDMARKS = "landmarks = [\n$landmarks]\n"
AROUND = StereoRig(cameras=8, angle=radians(40.0))


def smooth_stereo(
    seed: int, rig: StereoRig | None = None, element_size: float = 2.7, name: str = "smooth-stereo"
) -> PictureDataset:
    """Return the freeform sheet with 20 µm rms of deviations before a rig whose cameras and places are known."""
    sizes = FreeformSizes()
    (middle, bump), _ = freeform_patch(sizes)(np.array([[0.5, 0.5], [0.33, 0.62]]))
    form = Sum((Wave(0.02, (0.009, 0.004, 0.0), 0.3), Wave(0.015, (-0.005, 0.012, 0.0), 1.9)))
    deviation = form + Bump(tuple(bump.tolist()), height=0.1, width=12.0)
    recipe = HEAD.format(title="Freeform sheet", name=name, element_size=element_size) + CAMERAS + PLACED
    return photographed(freeform(sizes), deviation, rig or StereoRig(), tuple(middle.tolist()), seed, recipe)


SPLINES = """
[[measurements]]
name = "nurbs"
method = "isogeometric"
images = [$images]
"""


def smooth_nurbs(seed: int, rig: StereoRig | None = None, element_size: float = 2.7) -> PictureDataset:
    """Return the paper's first study: a smooth part of 68 control points and degree 8, about 1370 nodes, two pictures.

    The sheet is 40 µm thicker for its paint and has a slow form error of some hundredths of a millimetre. The lenses
    are known; where the cameras stand is found from six picks and the part itself, once by each method.
    """
    sizes = FreeformSizes(poles=(17, 4), degrees=(8, 3))
    (middle,), _ = freeform_patch(sizes)(np.array([[0.5, 0.5]]))
    form = Sum((Wave(0.03, (0.011, 0.002, 0.0), 0.3), Wave(0.02, (-0.004, 0.005, 0.0), 1.9)))
    head = HEAD.format(title="Smooth part", name="smooth-nurbs", element_size=element_size)
    recipe = "".join(text + CAMERAS + PLACED for text in (head, SPLINES))
    made = photographed(freeform(sizes), Uniform(0.04) + form, rig or StereoRig(), tuple(middle.tolist()), seed, recipe)
    return knowing(made, LensesKnown())


def milled_stereo(seed: int, rig: StereoRig | None = None, scallop: float = 0.012) -> PictureDataset:
    """Return the milled block: 40 µm mismatch, 15 µm errors on the facets, 12 µm scallops; cameras known."""
    recipe = HEAD.format(title="Milled block", name="milled-stereo", element_size=2.0) + CAMERAS + PLACED
    deviation = machining(pitch=4.0, scallop=scallop)
    return photographed(milled(), deviation, rig or StereoRig(), MILLED_MIDDLE, seed, recipe)


def milled_photographs(seed: int, rig: StereoRig | None = None, name: str = "milled-photographs") -> PictureDataset:
    """Return eight photographs of the milled block from a cone, 15 degrees from each to the next; cameras known."""
    dataset = milled_stereo(seed, rig or AROUND)
    recipe = dataset.recipe.replace(PLACED, "").replace("milled-stereo", name)
    recipe = recipe.replace('name = "stereo"', 'name = "photographs"').replace('"stereocorrelation"', '"colmap"')
    return replace(dataset, recipe=recipe)


def knowing(dataset: PictureDataset, knowledge: CameraKnowledge | None, picked: int = 6) -> PictureDataset:
    """Return the same photographs with another knowledge about the cameras, and points picked to start from."""
    recipe = dataset.recipe.replace(PLACED, LANDMARKS)
    recipe = recipe if knowledge else recipe.replace(CAMERAS, FOCAL)
    return replace(dataset, knowledge=knowledge, picked=picked, recipe=recipe)


def photographed(
    part: Part,
    deviation: DeviationField,
    rig: StereoRig,
    target: tuple[float, float, float],
    seed: int,
    recipe: str,
) -> PictureDataset:
    """Return photographs by cameras whose gains and offsets differ."""
    random = np.random.default_rng(seed)
    cameras = tuple(
        VirtualCamera(view, sensor=Sensor(gain=random.uniform(0.8, 1.05), offset=random.uniform(0.02, 0.06)))
        for view in rig(np.array(target), seed)
    )
    speckle = Speckle(dot=6.0 / rig.scale, seed=seed)
    return PictureDataset(part, deviation, speckle, cameras, recipe, knowledge=places_known)


def _knowing(knowledge: CameraKnowledge | None, name: str) -> Callable[[int], PictureDataset]:
    return lambda seed: knowing(smooth_stereo(seed, name=name), knowledge)


PHOTOGRAPHED: Mapping[str, Callable[[int], PictureDataset]] = MappingProxyType(
    {
        "smooth-stereo": smooth_stereo,
        "smooth-stereo-small": lambda seed: smooth_stereo(seed, StereoRig().halved(), 4.6, "smooth-stereo-small"),
        "smooth-stereo-three": lambda seed: smooth_stereo(seed, StereoRig(cameras=3), name="smooth-stereo-three"),
        "smooth-stereo-four": lambda seed: smooth_stereo(seed, StereoRig(cameras=4), name="smooth-stereo-four"),
        "smooth-stereo-rig": _knowing(rig_known, "smooth-stereo-rig"),
        "smooth-stereo-lenses": _knowing(LensesKnown(), "smooth-stereo-lenses"),
        "smooth-stereo-picks": _knowing(None, "smooth-stereo-picks"),
        "smooth-nurbs": smooth_nurbs,
        "milled-stereo": milled_stereo,
        "milled-photographs": milled_photographs,
        "milled-photographs-small": lambda seed: milled_photographs(seed, AROUND.halved(), "milled-photographs-small"),
    }
)
