"""3MF files.

Not through trimesh, which needs networkx and lxml for them and builds support structures as if they were the part.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import PurePosixPath
from xml.etree import ElementTree

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.files.content import Content
from inspect3d.files.found import Found
from inspect3d.files.numbers import numbers

_UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "inch": "inch", "foot": "ft", "meter": "m"}
_LARGEST_MODEL = 2**31
_DEEPEST = 32
_SUPPORTS = ("support", "solidsupport")
_Key = tuple[str, str]


@dataclass(frozen=True)
class _Object:
    """An object: a mesh of its own, and other objects placed in it by matrices (4, 4) that act on row vectors."""

    vertices: Floats
    triangles: Floats
    components: tuple[tuple[_Key, Floats], ...]
    kind: str


def read_3mf(content: Content) -> Found:
    """Read the triangles of everything that is built, each instance at its place; support structures are left out.

    Notes
    -----
    3MF Core Specification 1.3, chapters 3 and 4, and the paths of the Production Extension 1.1.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content.data)) as archive:
            return _read(content, archive)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise content.refused(f"is a damaged 3MF archive: {error}", "Export or copy it again.") from error
    except ElementTree.ParseError as error:
        raise content.refused(f"holds a model that is not XML: {error}") from error
    except (KeyError, ValueError) as error:
        raise content.refused(f"holds a model that lacks something or has a wrong value: {error}") from error


def _read(content: Content, archive: zipfile.ZipFile) -> Found:
    names = {name.lower().lstrip("/"): name for name in archive.namelist()}
    models = [name for name in names if name.endswith(".model")]
    root = next((name for name in models if name == "3d/3dmodel.model"), models[0] if models else None)
    if root is None:
        raise content.refused("is an archive without a 3MF model", "Unpack it and name the file in it.")
    objects: dict[_Key, _Object] = {}
    items: list[tuple[_Key, Floats]] = []
    unit = "millimeter"
    for name in models:
        if archive.getinfo(names[name]).file_size > _LARGEST_MODEL:
            raise content.refused("holds a model larger than 2 GiB")
        with archive.open(names[name]) as stream:
            for _, node in ElementTree.iterparse(stream):
                match _tag(node):
                    case "object":
                        objects[name, node.attrib["id"]] = _object(content, node, name)
                        node.clear()
                    case "item" if name == root:
                        items.append(_placed(node, name))
                    case "model" if name == root:
                        unit = node.get("unit", unit)
    if unit not in _UNITS:
        raise content.refused(f"is in the unknown unit {unit!r}")
    if not items:
        raise content.refused("has nothing to build, so no part")
    placed = [piece for key, matrix in items for piece in _pieces(content, objects, key, matrix, 0)]
    vertices = [mesh.vertices @ matrix[:3, :3] + matrix[3, :3] for mesh, matrix in placed]
    shift = np.cumsum([0, *(len(points) for points in vertices)])
    corners = [mesh.triangles.ravel() + first for (mesh, _), first in zip(placed, shift, strict=False)]
    for mesh, _ in placed:
        if len(mesh.triangles) and not 0 <= mesh.triangles.min() <= mesh.triangles.max() < len(mesh.vertices):
            raise content.refused("has a triangle that refers to a vertex which is not there")
    flat = np.concatenate([*corners, np.zeros(0)]).astype(np.int64)
    points = np.concatenate([*vertices, np.zeros((0, 3))])
    skipped = sum(thing.kind in _SUPPORTS for thing in objects.values())
    remarks = (f"{content.path.name}: {skipped} support structures were left out.",) if skipped else ()
    return Found(points, corners=flat, sizes=np.full(len(flat) // 3, 3), units=_UNITS[unit], remarks=remarks)


def _pieces(
    content: Content, objects: dict[_Key, _Object], key: _Key, matrix: Floats, depth: int
) -> Iterator[tuple[_Object, Floats]]:
    if key not in objects:
        raise content.refused(f"builds the object {key[1]}, which is not in it")
    if depth > _DEEPEST:
        raise content.refused("nests its objects without end")
    thing = objects[key]
    if thing.kind in _SUPPORTS:
        return
    if len(thing.triangles):
        yield thing, matrix
    for inner, place in thing.components:
        yield from _pieces(content, objects, inner, place @ matrix, depth + 1)


def _object(content: Content, node: ElementTree.Element, file: str) -> _Object:
    vertices = [f"{v.attrib['x']} {v.attrib['y']} {v.attrib['z']}" for v in node.iter() if _tag(v) == "vertex"]
    triangles = [f"{t.attrib['v1']} {t.attrib['v2']} {t.attrib['v3']}" for t in node.iter() if _tag(t) == "triangle"]
    return _Object(
        numbers(content, " ".join(vertices).encode()).reshape(-1, 3),
        numbers(content, " ".join(triangles).encode()).reshape(-1, 3),
        tuple(_placed(c, file) for c in node.iter() if _tag(c) == "component"),
        node.get("type", "model"),
    )


def _placed(node: ElementTree.Element, file: str) -> tuple[_Key, Floats]:
    path = next((value for name, value in node.attrib.items() if name.endswith("}path")), None)
    matrix = np.eye(4)
    if "transform" in node.attrib:
        matrix[:, :3] = np.array([float(word) for word in node.attrib["transform"].split()]).reshape(4, 3)
    return (str(PurePosixPath(path)).lower().lstrip("/") if path else file, node.attrib["objectid"]), matrix


def _tag(node: ElementTree.Element) -> str:
    return node.tag.rpartition("}")[2]
