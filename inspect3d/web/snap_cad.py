"""What a click on the CAD may snap to: corners, sharp edges and the centres of circles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.nominal.sharp import corners_of_lines, sides_of

SHARP = np.radians(30.0)
ROUND = 2e-3
"""Share of the radius by which points of an arc may miss the circle."""
LEAST_POINTS, LEAST_TURN = 5, np.radians(60.0)


@dataclass(frozen=True, eq=False)
class SnapTargets:
    """Places that can be named exactly.

    Parameters
    ----------
    corners : (k, 3) mm, where sharp edges end, branch or turn
    edges : (l, 2, 3) mm, pieces of sharp edges and of rims
    circles : (c, 7) mm, centre, unit normal and radius of round edges
    """

    corners: Floats
    edges: Floats
    circles: Floats


def snap_targets(mesh: InspectionMesh) -> SnapTargets:
    """Return the corners, edges and circles of an inspection mesh, whose nodes lie on the exact edges."""
    sides = sides_of(mesh.nodes, mesh.triangles)
    sharp = (sides.angle > SHARP) & mesh.crease[sides.ends].all(axis=1)
    ends = sides.ends[sharp | (sides.uses != 2)]
    corner = corners_of_lines(mesh.nodes, ends, SHARP)
    circles = [circle for chain in _chains(ends, corner) if (circle := _circle(mesh.nodes[chain])) is not None]
    return SnapTargets(mesh.nodes[corner], mesh.nodes[ends], _distinct(np.array(circles).reshape(-1, 7)))


def _chains(ends: Integers, corner: np.ndarray) -> list[list[int]]:
    """Return the nodes along each line from corner to corner, or around it where it is closed."""
    beside: dict[int, list[int]] = {}
    for a, b in ends.tolist():
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    used: set[tuple[int, int]] = set()
    chains = []
    for begin in sorted(beside, key=lambda node: not corner[node]):
        for after in beside[begin]:
            if (begin, after) in used:
                continue
            chain, before, now = [begin], begin, after
            used |= {(begin, after), (after, begin)}
            while not corner[now] and now != begin:
                chain.append(now)
                ahead = next(node for node in beside[now] if node != before)
                used |= {(now, ahead), (ahead, now)}
                before, now = now, ahead
            chains.append([*chain, now])
    return chains


def _circle(points: Floats) -> Floats | None:
    """Return centre, normal and radius (7,) of the circle through points (n, 3), or None where they are not on one."""
    if len(points) < LEAST_POINTS:
        return None
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle)[2]
    x, y = ((points - middle) @ axes[:2].T).T
    found = np.linalg.lstsq(np.column_stack([2 * x, 2 * y, np.ones(len(x))]), x**2 + y**2, rcond=None)[0]
    radius = float(np.sqrt(max(found[2] + found[0] ** 2 + found[1] ** 2, 0.0)))
    centre = middle + found[:2] @ axes[:2]
    off = np.abs(np.linalg.norm(points - centre, axis=1) - radius).max()
    flat = np.abs((points - middle) @ axes[2]).max()
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    if max(off, flat) > ROUND * radius or steps < LEAST_TURN * radius:
        return None
    return np.concatenate([centre, axes[2], [radius]])


def _distinct(circles: Floats) -> Floats:
    """Return each circle once: a round edge may be cut into arcs."""
    kept: list[Floats] = []
    for circle in circles:
        if all(np.linalg.norm(circle[[0, 1, 2, 6]] - other[[0, 1, 2, 6]]) > 1e-2 * circle[6] for other in kept):
            kept.append(circle)
    return np.array(kept).reshape(-1, 7)
