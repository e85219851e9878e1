"""A set-up of one's own to try before it is built: a TOML file that names a part, a rig, paint and deviations."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from math import radians
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar, get_type_hints

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.outcome import InputError
from inspect3d.virtual.camera_knowledge import CameraKnowledge, LensesKnown, places_known, rig_known
from inspect3d.virtual.deviation_field import Sum, field_of
from inspect3d.virtual.part import Part
from inspect3d.virtual.picture_dataset import PictureDataset
from inspect3d.virtual.sensor import Sensor
from inspect3d.virtual.speckle import Speckle
from inspect3d.virtual.stereo_datasets import CAMERAS, HEAD, PLACED, knowing
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d.virtual.virtual_camera import VirtualCamera
from inspect3d.virtual.warp import Warp

KEYS = {"cad", "element_size", "knowledge", "target", "rig", "camera", "sensor", "speckle", "warp", "deviations"}
KNOWLEDGE: Mapping[str, CameraKnowledge | None] = MappingProxyType(
    {"places": places_known, "rig": rig_known, "lenses": LensesKnown(), "picks": None}
)

Made = TypeVar("Made")


def load_plan(path: Path, seed: int) -> PictureDataset:
    """Return the photographs that a plan asks for, of a part in a STEP or IGES file.

    Its keys are `cad`, `element_size` (mm), `knowledge` of the cameras (places, rig, lenses or picks; by default
    places) and `target` (mm, by default the middle of the part); its tables `[rig]`, `[camera]`, `[sensor]` and
    `[speckle]` hold the settings of `StereoRig` (its angle in degrees), `VirtualCamera`, `Sensor` and `Speckle`,
    `[warp]` the `tau` and `length` of an unknown error of each lens, and each `[[deviations]]` a deviation field: its
    kind and parameters.

    Raises
    ------
    InputError
        The plan, or the file of the part, is not readable, or a setting is unknown or wrong.
    """
    plan = _toml(path)
    unknown = sorted(set(plan) - KEYS)
    if unknown or "cad" not in plan:
        raise InputError(
            f"{path.name}: {f'{unknown[0]!r} is unknown' if unknown else 'cad is missing'}; "
            f"the keys are {', '.join(sorted(KEYS))}."
        )
    knowledge = plan.get("knowledge", "places")
    if knowledge not in KNOWLEDGE:
        raise InputError(f"{path.name}: knowledge = {knowledge!r} is unknown; choose one of {', '.join(KNOWLEDGE)}.")
    part = _part(path.parent / str(plan["cad"]))
    turned = _table(plan, "rig", path.name)
    if isinstance(turned.get("angle"), int | float):
        turned["angle"] = radians(turned["angle"])
    rig = _made(StereoRig, turned, f"{path.name}, [rig]")
    vertices = part.surface().vertices
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    target = _value(tuple[float, float, float], plan.get("target", tuple(middle)), f"{path.name}, target")
    paint = {"dot": 6.0 / rig.scale, "seed": seed, **_table(plan, "speckle", path.name)}
    element_size = _value(float, plan.get("element_size", float(np.ptp(vertices, axis=0).max()) / 40), path.name)
    recipe = HEAD.format(title=part.name, name=path.name, element_size=f"{element_size:.3g}") + CAMERAS + PLACED
    cameras = _cameras(plan, path.name, rig, np.array(target), seed)
    dataset = PictureDataset(
        part,
        _deviation(plan, path.name),
        _made(Speckle, paint, f"{path.name}, [speckle]"),
        cameras,
        recipe,
        places_known,
    )
    return dataset if knowledge == "places" else knowing(dataset, KNOWLEDGE[knowledge])


def _cameras(
    plan: Mapping[str, Any], name: str, rig: StereoRig, target: Floats, seed: int
) -> tuple[VirtualCamera, ...]:
    """Return the cameras of a rig with the sensor and the light that a plan gives them, each warped in its own way."""
    sensor = _made(Sensor, _table(plan, "sensor", name), f"{name}, [sensor]")
    light = _table(plan, "camera", name)
    cameras = []
    seeds = np.random.SeedSequence((seed, rig.cameras)).generate_state(rig.cameras).tolist()
    for view, lens in zip(rig(target, seed), seeds, strict=True):
        warp = _made(Warp, _table(plan, "warp", name), f"{name}, [warp]", seed=lens) if "warp" in plan else None
        cameras.append(_made(VirtualCamera, light, f"{name}, [camera]", view=view, sensor=sensor, warp=warp))
    return tuple(cameras)


def _toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path.name} is not valid TOML: {error}.") from error


def _part(path: Path) -> Part:
    from inspect3d.nominal.step_iges import IGES_SUFFIXES, STEP_SUFFIXES, read_brep

    if path.suffix.lower() not in STEP_SUFFIXES | IGES_SUFFIXES or not path.is_file():
        raise InputError(f"cad = {path.name!r}: give a STEP or IGES file that is there; a virtual part is exact.")
    shape = read_brep(path).shape
    return Part(path.stem, lambda: shape)


def _deviation(plan: Mapping[str, Any], name: str) -> Sum:
    terms = plan.get("deviations", [])
    try:
        return Sum(tuple(field_of(term) for term in terms))
    except (AttributeError, TypeError, ValueError) as error:
        raise InputError(f"{name}, [[deviations]]: {error}.") from error


def _table(plan: Mapping[str, Any], key: str, name: str) -> dict[str, Any]:
    table = plan.get(key, {})
    if not isinstance(table, dict):
        raise InputError(f"{name}: [{key}] is a table of settings.")
    return dict(table)


def _made(kind: type[Made], table: Mapping[str, Any], where: str, **given: Any) -> Made:
    """Return a value of a kind with the settings of a table, and others given."""
    hints = get_type_hints(kind)
    known = [name for name in hints if name not in given]
    unknown = [key for key in table if key not in known]
    if unknown:
        raise InputError(f"{where}: {unknown[0]!r} is unknown; the settings are {', '.join(known)}.")
    values = {key: _value(hints[key], value, f"{where}, {key}") for key, value in table.items()}
    try:
        return kind(**values, **given)
    except (TypeError, ValueError) as error:
        raise InputError(f"{where}: {error}.") from error


def _value(hint: Any, value: Any, where: str) -> Any:
    """Return a value of TOML as the type it has in the program."""
    from pydantic import TypeAdapter, ValidationError

    try:
        return TypeAdapter(hint).validate_python(value)
    except ValidationError as error:
        raise InputError(f"{where}: {error.errors()[0]['msg']}.") from error
