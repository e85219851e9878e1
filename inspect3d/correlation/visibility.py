"""Which evaluation points each camera sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import View
from inspect3d.correlation.cells import Cells
from inspect3d.correlation.evaluation import interpolated
from inspect3d.nominal.nominal import InspectionMesh, Nominal
from inspect3d.nominal.sheets import Pieces

MARGIN = 3.0
OUTLINE = 4.0
EDGE = 3.0
FINE = 4
SHARE = 0.5
LIFT = 1e-4


@dataclass(frozen=True, eq=False)
class Visibility:
    """Who sees what.

    Parameters
    ----------
    seen : (v, p), the camera sees the point
    taking : (f, v), the view takes part in the cell
    used : (p,), every view that takes part in the point's cell sees it, and at least two do
    """

    seen: Booleans
    taking: Booleans
    used: Booleans


def visibility(
    nominal: Nominal, cells: Cells, views: Sequence[View], steepest: float, masks: Sequence[Booleans | None]
) -> Visibility:
    """Return which points are seen by rays from the cameras to the nominal surface.

    A camera sees a point that lies in its picture (three pixels within the border), four pixels or more within the
    outline of the part, where a blurred picture mixes it with what is behind, and in the mask; three pixels or more off
    the edges where sheets meet, which lie a little beside where the start has them; whose normal leans at most
    `steepest` rad towards the line of sight, and that no other part of the nominal surface hides. A view takes part in
    a cell of which it sees at least half the points.

    Parameters
    ----------
    views : v
    masks : of each view, True (rows, columns) where its picture may be used, or None
    """
    from inspect3d.correlation.point_kernel import write_used

    points = cells.points
    normals = interpolated(points.starts, points.shapes, cells.triangles, cells.normals, unit=True)
    lifted = points.places + (LIFT * nominal.diagonal + 2 * points.chord) * normals
    seen = np.empty((len(views), len(points)), dtype=np.bool_)
    for row, view, mask in zip(seen, views, masks, strict=True):
        _write_seen(nominal, cells, normals, lifted, view, steepest, mask, row)
    taking, used = np.empty((len(cells.triangles), len(views)), dtype=np.bool_), np.empty(len(points), dtype=np.bool_)
    write_used(points.starts, seen, SHARE, taking, used)
    return Visibility(seen, taking, used)


def _write_seen(
    nominal: Nominal,
    cells: Cells,
    normals: Floats,
    lifted: Floats,
    view: View,
    steepest: float,
    mask: Booleans | None,
    seen: Booleans,
) -> None:
    from inspect3d.correlation.point_kernel import write_in_sight

    camera, pose = view.camera, view.camera_from_cad
    rig = (camera.matrix, camera.distortion, pose.rotation, pose.translation)
    allowed = _within_outline(nominal.mesh, view) & _off_edges(nominal, cells.edges, view)
    if mask is not None:
        allowed = allowed & mask
    write_in_sight(cells.points.places, normals, rig, view.centre, np.cos(steepest), MARGIN, allowed, seen)
    near = np.flatnonzero(seen)
    seen[near] = ~nominal.surface.hides(lifted[near], view.centre)


def _within_outline(mesh: InspectionMesh, view: View) -> Booleans:
    """Return the pixels (rows, columns) that lie well inside the picture of the facets that face the camera."""
    import cv2

    width, height = view.camera.size
    corners = mesh.nodes[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = ((view.centre - corners[:, 0]) * normals).sum(axis=1) > 0
    ahead = (view.depth(mesh.nodes) > 0)[mesh.triangles].all(axis=1)
    shown = mesh.triangles[facing & ahead]
    places, needed = np.zeros((len(mesh.nodes), 2)), np.unique(shown)
    places[needed] = np.clip(view.project(mesh.nodes[needed]), -4 * width, 5 * width)
    filled = np.zeros((height, width), np.uint8)
    for triangle in np.rint(places * 2**FINE).astype(np.int32)[shown]:
        cv2.fillConvexPoly(filled, triangle, 1, shift=FINE)
    framed = cv2.copyMakeBorder(filled, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.distanceTransform(framed, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1] > OUTLINE)


def _off_edges(nominal: Nominal, edges: Pieces, view: View) -> Booleans:
    """Return the pixels (rows, columns) that lie well off where the camera sees sheets meet."""
    import cv2

    width, height = view.camera.size
    free = np.ones((height, width), np.uint8)
    middles = edges.ends.mean(axis=1) + LIFT * nominal.diagonal * edges.normals
    ahead = (view.depth(edges.ends.reshape(-1, 3)) > 0).reshape(-1, 2).all(axis=1)
    seen = np.flatnonzero(ahead & (((view.centre - middles) * edges.normals).sum(axis=1) > 0))
    seen = seen[~nominal.surface.hides(middles[seen], view.centre)]
    if not len(seen):
        return free > 0
    pixels = np.clip(view.project(edges.ends[seen].reshape(-1, 3)), -4 * width, 5 * width).reshape(-1, 2, 2)
    cv2.polylines(free, list(np.rint(pixels * 2**FINE).astype(np.int32)), False, 0, shift=FINE)
    return np.asarray(cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) > EDGE)
