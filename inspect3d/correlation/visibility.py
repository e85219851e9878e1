"""Which evaluation points each camera sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats, unit
from inspect3d.camera import View
from inspect3d.correlation.evaluation import EvaluationPoints
from inspect3d.nominal.nominal import InspectionMesh, Nominal

MARGIN = 3.0
OUTLINE = 4.0
FINE = 4
SHARE = 0.5
LIFT = 1e-4


@dataclass(frozen=True, eq=False)
class Visibility:
    """Who sees what.

    Parameters
    ----------
    seen : (v, p), the camera sees the point
    taking : (f, v), the view takes part in the facet
    used : (p,), every view that takes part in the point's facet sees it, and at least two do
    """

    seen: Booleans
    taking: Booleans
    used: Booleans


def visibility(
    nominal: Nominal, points: EvaluationPoints, views: Sequence[View], steepest: float, masks: Sequence[Booleans | None]
) -> Visibility:
    """Return which points are seen by rays from the cameras to the nominal surface.

    A camera sees a point that lies in its picture (three pixels within the border), four pixels or more within the
    outline of the part, where a blurred picture mixes it with what is behind, and in the mask; whose normal leans at
    most `steepest` rad towards the line of sight, and that no other part of the nominal surface hides. A view takes
    part in a facet of which it sees at least half the points.

    Parameters
    ----------
    views : v
    masks : of each view, True (rows, columns) where its picture may be used, or None
    """
    triangles = nominal.mesh.triangles
    normals = unit(np.einsum("pi,pij->pj", points.shapes, nominal.mesh.normals[triangles[points.facet]]))
    seen = np.stack(
        [_seen(nominal, points, normals, view, steepest, mask) for view, mask in zip(views, masks, strict=True)]
    )
    counts = np.stack([np.add.reduceat(row, points.starts[:-1], dtype=np.int64) for row in seen], axis=1)
    taking = counts >= SHARE * np.diff(points.starts)[:, None]
    taking[taking.sum(axis=1) < 2] = False
    taken = taking[points.facet]
    used = np.all(seen.T | ~taken, axis=1) & np.any(taken, axis=1)
    return Visibility(seen, taking, used)


def _seen(
    nominal: Nominal, points: EvaluationPoints, normals: Floats, view: View, steepest: float, mask: Booleans | None
) -> Booleans:
    sight = view.centre - points.places
    distance = np.linalg.norm(sight, axis=1)
    seen = (sight * normals).sum(axis=1) >= np.cos(steepest) * distance
    seen &= view.depth(points.places) > 0
    near = np.flatnonzero(seen)
    pixels = view.project(points.places[near])
    inside = (pixels >= MARGIN).all(axis=1) & (pixels <= np.array(view.camera.size) - 1 - MARGIN).all(axis=1)
    at = np.clip(np.rint(pixels), 0, np.array(view.camera.size) - 1).astype(np.int64)
    inside &= _within_outline(nominal.mesh, view)[at[:, 1], at[:, 0]]
    if mask is not None:
        inside &= mask[at[:, 1], at[:, 0]]
    near = near[inside]
    lift = LIFT * nominal.diagonal + 2 * points.chord
    hits = nominal.surface.first_hit(points.places[near] + lift * normals[near], sight[near], distance[near])
    seen[:] = False
    seen[near] = hits.triangle < 0
    return seen


def _within_outline(mesh: InspectionMesh, view: View) -> Booleans:
    """Return the pixels (rows, columns) that lie well inside the picture of the facets that face the camera."""
    import cv2

    width, height = view.camera.size
    corners = mesh.nodes[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = ((view.centre - corners[:, 0]) * normals).sum(axis=1) > 0
    ahead = (view.depth(mesh.nodes) > 0)[mesh.triangles].all(axis=1)
    shown = corners[facing & ahead].reshape(-1, 3)
    pixels = np.clip(view.project(shown), -4 * width, 5 * width).reshape(-1, 3, 2)
    filled = np.zeros((height, width), np.uint8)
    for triangle in np.rint(pixels * 2**FINE).astype(np.int32):
        cv2.fillConvexPoly(filled, triangle, 1, shift=FINE)
    framed = cv2.copyMakeBorder(filled, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.distanceTransform(framed, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1] > OUTLINE)
