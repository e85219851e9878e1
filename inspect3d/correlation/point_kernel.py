"""Where evaluation points lie and which of them a camera may see: numba kernels over plain arrays."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.camera_kernel import project_point

BATCH = 64


@njit(cache=True)
def _between(values: Floats, corners: Integers, shape: Floats) -> tuple[float, float, float]:
    """Return a nodal vector (n, 3) between the three corners of a facet, by their shares (3,)."""
    a, b, c = corners
    s, t, u = shape
    return (
        s * values[a, 0] + t * values[b, 0] + u * values[c, 0],
        s * values[a, 1] + t * values[b, 1] + u * values[c, 1],
        s * values[a, 2] + t * values[b, 2] + u * values[c, 2],
    )


@njit(cache=True, parallel=True, error_model="numpy")
def interpolate(starts: Integers, shapes: Floats, corners: Integers, values: Floats, unit: bool, found: Floats) -> None:
    """Write nodal vectors (n, 3) interpolated at the points of each facet (p, 3), at length one if `unit`."""
    facets = len(corners)
    for batch in prange((facets + BATCH - 1) // BATCH):
        for f in range(batch * BATCH, min((batch + 1) * BATCH, facets)):
            for p in range(starts[f], starts[f + 1]):
                x, y, z = _between(values, corners[f], shapes[p])
                length = np.sqrt(x * x + y * y + z * z) if unit else 1.0
                found[p, 0], found[p, 1], found[p, 2] = x / length, y / length, z / length


@njit(cache=True)
def cubic_monomials(s: float, t: float, u: float) -> tuple[float, ...]:
    """Return the ten monomials of third degree in barycentric coordinates."""
    return s * s * s, t * t * t, u * u * u, s * s * t, s * t * t, t * t * u, t * u * u, u * u * s, u * s * s, s * t * u


@njit(cache=True, parallel=True, error_model="numpy")
def bend(
    starts: Integers, shapes: Floats, corners: Integers, normals: Floats, cubics: Floats, places: Floats, found: Floats
) -> None:
    """Write the points (p, 3) of each facet, moved along the interpolated normals by a cubic.

    Parameters
    ----------
    cubics : (f, 10) mm, the shares of `cubic_monomials`
    places : (p, 3) mm, the points before
    """
    facets = len(corners)
    for batch in prange((facets + BATCH - 1) // BATCH):
        for f in range(batch * BATCH, min((batch + 1) * BATCH, facets)):
            for p in range(starts[f], starts[f + 1]):
                x, y, z = _between(normals, corners[f], shapes[p])
                monomials = cubic_monomials(shapes[p, 0], shapes[p, 1], shapes[p, 2])
                lift = 0.0
                for m in range(10):
                    lift += cubics[f, m] * monomials[m]
                lift /= np.sqrt(x * x + y * y + z * z)
                found[p, 0] = places[p, 0] + lift * x
                found[p, 1] = places[p, 1] + lift * y
                found[p, 2] = places[p, 2] + lift * z


@njit(cache=True, parallel=True, error_model="numpy")
def write_in_sight(
    places: Floats,
    normals: Floats,
    view: tuple[Floats, Floats, Floats, Floats],
    centre: Floats,
    least: float,
    margin: float,
    allowed: Booleans,
    seen: Booleans,
) -> None:
    """Tell which points lie in the picture and face the camera, whatever is in between.

    Parameters
    ----------
    places, normals : (p, 3) mm and unit
    view : matrix (3, 3) px, distortion (5,), rotation (3, 3), translation (3,) mm
    centre : (3,) mm, of projection
    least : cosine of the steepest angle between normal and line of sight
    margin : px, least distance from the border of the picture
    allowed : (rows, columns), pixels that may be used
    seen : (p,), written
    """
    rows, columns = allowed.shape
    for p in prange(len(places)):
        x, y, z = centre[0] - places[p, 0], centre[1] - places[p, 1], centre[2] - places[p, 2]
        height = x * normals[p, 0] + y * normals[p, 1] + z * normals[p, 2]
        seen[p] = False
        if height >= least * np.sqrt(x * x + y * y + z * z):
            at_x, at_y, depth = project_point(*view, places[p, 0], places[p, 1], places[p, 2])
            inside = margin <= at_x <= columns - 1 - margin and margin <= at_y <= rows - 1 - margin
            if depth > 0 and inside:
                seen[p] = allowed[int(np.rint(at_y)), int(np.rint(at_x))]


@njit(cache=True, parallel=True)
def write_used(starts: Integers, seen: Booleans, share: float, taking: Booleans, used: Booleans) -> None:
    """Write which views (f, v) see at least a share of a facet's points, and which points all of these see.

    Parameters
    ----------
    seen : (v, p)
    taking : (f, v), written: at least two in each facet, or none
    used : (p,), written
    """
    facets, views = taking.shape
    for batch in prange((facets + BATCH - 1) // BATCH):
        for f in range(batch * BATCH, min((batch + 1) * BATCH, facets)):
            taken = 0
            for k in range(views):
                count = 0
                for p in range(starts[f], starts[f + 1]):
                    count += seen[k, p]
                taking[f, k] = count >= share * (starts[f + 1] - starts[f])
                taken += taking[f, k]
            if taken < 2:
                taking[f] = False
            for p in range(starts[f], starts[f + 1]):
                used[p] = taken >= 2
                for k in range(views):
                    if taking[f, k] and not seen[k, p]:
                        used[p] = False
