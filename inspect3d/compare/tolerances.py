"""What the recipe asks of each node: which limits it must keep to, and whether it counts at all."""

from __future__ import annotations

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.recipe import Part
from inspect3d.recipe_types import Region


def inside(region: Region, points: Floats, face: np.ndarray) -> Booleans:
    """Tell which points (n, 3) mm, on B-rep faces numbered `face` (n,), lie in a region."""
    if region.box is not None:
        low, high = np.array(region.box)
        return ((points >= low) & (points <= high)).all(axis=1)
    return np.isin(face, region.faces or ())


def excluded(part: Part, points: Floats, face: np.ndarray) -> Booleans:
    """Tell which points (n, 3) mm the recipe leaves out of the inspection."""
    result = np.zeros(len(points), bool)
    for region in part.exclude:
        result |= inside(region, points, face)
    return result


def tolerances(part: Part, mesh: InspectionMesh) -> Floats | None:
    """Return the limits (n, 2) mm of each node, NaN where it has none, or None where the recipe states none at all.

    A region's tolerance overrides the part's; of two regions the later one counts. Excluded nodes have none.
    """
    if part.tolerance is None and not any(region.tolerance for region in part.regions):
        return None
    limits = np.tile(part.tolerance or (np.nan, np.nan), (len(mesh), 1)).astype(np.float64)
    for region in part.regions:
        if region.tolerance is not None:
            limits[inside(region, mesh.nodes, mesh.face)] = region.tolerance
    limits[excluded(part, mesh.nodes, mesh.face)] = np.nan
    return limits
