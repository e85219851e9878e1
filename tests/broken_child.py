"""Read one file as a mesh and as a cloud, and print what came of it as JSON; for test_files_broken.py."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from inspect3d.files.cloud import read_cloud
from inspect3d.files.mesh import read_mesh
from inspect3d.outcome import InputError


def mesh(path: Path) -> dict[str, Any]:
    """Return counts, bounds, area and volume, or the sentence that refuses the file."""
    try:
        found = read_mesh(path)
    except InputError as error:
        return {"refused": str(error)}
    a, b, c = (found.vertices[found.triangles[:, i]] for i in range(3))
    return {
        "vertices": len(found.vertices),
        "triangles": len(found.triangles),
        "low": found.vertices.min(axis=0).tolist(),
        "high": found.vertices.max(axis=0).tolist(),
        "area": float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2),
        "volume": float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6),
        "remarks": found.remarks,
    }


def cloud(path: Path) -> dict[str, Any]:
    """Return count and bounds, or the sentence that refuses the file."""
    try:
        found = read_cloud(path)
    except InputError as error:
        return {"refused": str(error)}
    low, high = found.points.min(axis=0), found.points.max(axis=0)
    return {"points": len(found.points), "low": low.tolist(), "high": high.tolist(), "remarks": found.remarks}


if __name__ == "__main__":
    given = Path(sys.argv[1])
    print(json.dumps({"mesh": mesh(given), "cloud": cloud(given)}))
