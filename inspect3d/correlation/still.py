"""Keep the surface from sliding through the pictures while shape and cameras are solved for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inspect3d.arrays import Floats, unit
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.linear import Still, gauge_of, motions_of, moving_cameras
from inspect3d.correlation.scene import SAMPLE, Scene
from inspect3d.register.gauge import FREE

SOFT = 0.1  # share of the stiffest motion's stiffness; a motion that moves the surface in itself mostly has less
FOLLOWED = 0.1  # of the motions in which the surface slides in itself: a space that misses less nearly has them
SLIDING = 0.1  # of the slide that most slides the surface; a motion of the part that slides it less is none
STARTED = 1.0  # px, by which a start may be off along a motion that is held
SMALL = 1e-3  # mm, or of a motion of the part


def stilled(
    scene: Scene, freedom: Freedom, views: Sequence[View], deviation: Floats, shape: Floats, cameras: Floats
) -> tuple[Floats, Floats]:
    """Return a step of shape (k,) and cameras (m,) with a motion of the part added under which its surface keeps still.

    Of a space whose unknowns are fewer than the nodes, and does not have all motions of the part: `still_in_pictures`
    says why. Motions that move the surface in itself mostly are chosen such that its points stay where they are in the
    mean of the pictures, as far as they can and the space has such motions. To tilt a narrow plane moves its nodes
    little, and slides it less: no tilt keeps it still.

    A space that has none holds such motions of the part by this, where they started. One that follows them but for a
    few per cent, as splines do on a smooth sheet, would take steps for ever that its gauge takes back: there the step
    is returned as it is.
    """
    left, values, right = motions_of(scene, freedom)
    soft = values**2 <= SOFT * values[0] ** 2
    if not soft.any():
        return shape, cameras
    rows, sliding = scene.space.rows(scene), -(left * values)[:, soft]
    fields = scene.space.motion(scene, sliding)
    if scene.space.confined and np.linalg.norm(rows @ fields - sliding) < FOLLOWED * np.linalg.norm(sliding):
        return shape, cameras
    changes = moving_cameras(scene, freedom, views, right[soft])
    some = slice(None, None, 1 + len(scene.nodes) // SAMPLE)
    rows = rows[some]
    normals = scene.normals[some]
    places = scene.nodes[some] + deviation[some, None] * normals
    across = _tangents(normals)
    here = [view.project(places) for view in views]
    inverse = [
        np.linalg.inv(np.stack([(view.project(places + SMALL * t) - at) / SMALL for t in across], axis=2))
        for view, at in zip(views, here, strict=True)
    ]

    def slide(shape: Floats, cameras: Floats) -> Floats:
        moved = places + (rows @ shape)[:, None] * normals
        slides = [
            np.einsum("nij,nj->ni", inverse[k], view.project(moved) - here[k])
            for k, view in enumerate(freedom.moved(views, cameras))
        ]
        return np.mean(slides, axis=0).ravel()

    columns = [slide(SMALL * u, SMALL * p) / SMALL for u, p in zip(fields.T, changes.T, strict=True)]
    sizes = np.linalg.lstsq(np.stack(columns, axis=1), -slide(shape, cameras), rcond=SLIDING)[0]
    return shape + fields @ sizes, cameras + changes @ sizes


def still_in_pictures(scene: Scene, freedom: Freedom, views: Sequence[View]) -> Still | None:
    """Return how the surface keeps still in the mean of the pictures while shape and cameras are solved for.

    Moving the part, and growing it where the scale is not known, together with all cameras changes nothing that the
    pictures show. A gauge that leaves the shape no such motion would let what the pictures show weakly slide the
    surface through them by many pixels: over noise that is another every time, and over the outline of the part. So
    motions that mostly move the surface in itself are left to the shape, and the cameras keep the pictures of the part
    where they are in the mean. To tilt a narrow plane moves its nodes little, and slides it less: that stays with the
    gauge. None where no motion is one of these, and for spaces that cannot follow them all, see `stilled`.
    """
    left, values, right = motions_of(scene, freedom)
    soft = values**2 <= SOFT * values[0] ** 2
    if scene.space.confined or not soft.any():
        return None
    flow = _flow_of_unknowns(freedom, views, scene.sample)
    changes = moving_cameras(scene, freedom, views, right[soft])
    _, sizes, turns = np.linalg.svd(flow @ changes, full_matrices=False)
    sliding = sizes > SLIDING * sizes[0]
    gauge = np.column_stack([left[:, ~soft], (left * values)[:, soft] @ turns[~sliding].T])
    slides = changes @ turns[sliding].T
    return Still(gauge, slides, flow.T @ (flow @ slides))


def slides_in_pictures(scene: Scene, freedom: Freedom, views: Sequence[View], slides: Floats) -> Still | None:
    """Return how cameras are held where they slide the surface along slides in the mean of the pictures.

    Changes of the lenses slide it as well: with the poses held along the slides themselves, splines on a sheet slid by
    13 px. None where nodes move by themselves, see `still_in_pictures`, or nothing slides.

    Parameters
    ----------
    slides : (m, s), see `slides_of`
    """
    if not (scene.space.confined and freedom.poses == "free" and slides.shape[1]):
        return None
    return Still(gauge_of(scene, freedom), slides, across_in_pictures(scene, freedom, views, slides))


def across_in_pictures(scene: Scene, freedom: Freedom, views: Sequence[View], slides: Floats) -> Floats:
    """Return N (m, s) by which cameras that do not slide the surface in the mean of the pictures have N'p = 0.

    To hold them along the slides alone would not do where each camera has a pose of its own: turns and shifts of each
    make much the same of a slide.

    Parameters
    ----------
    slides : (m, s), see `slides_of`
    """
    flow = _flow_of_unknowns(freedom, views, scene.sample)
    return flow.T @ (flow @ slides)


def left_open(scene: Scene, freedom: Freedom, views: Sequence[View]) -> Floats:
    """Return what motions that are held make of the shape (k, s) if the start is off along them by a pixel.

    A motion that leaves the surface nearly in itself is held where the start has it, and moves the shape a little all
    the same: nothing but the start tells that.
    """
    none = np.zeros((scene.space.rows(scene).shape[1], 0))
    if freedom.poses == "known":
        return none
    left, values, right = motions_of(scene, freedom)
    held = values**2 <= FREE * values[0] ** 2
    if not held.any():
        return none
    flow = _flow(freedom, views, scene.sample, moving_cameras(scene, freedom, views, right[held]))
    sizes = STARTED / np.sqrt(2 * np.mean(flow**2, axis=0))
    return scene.space.motion(scene, left[:, held] * values[held] * sizes)


def _flow_of_unknowns(freedom: Freedom, views: Sequence[View], points: Floats) -> Floats:
    """Return how the unknowns of the cameras move points (p, 3) in the mean of the pictures, (2 p, m) px."""
    scale = freedom.scale(views, points)
    return _flow(freedom, views, points, np.diag(scale)) / scale


def _flow(freedom: Freedom, views: Sequence[View], points: Floats, changes: Floats) -> Floats:
    """Return how changes (m, s) of the cameras move points (p, 3) in the mean of the pictures, (2 p, s) px."""
    here = np.mean([view.project(points) for view in views], axis=0)
    moved = [freedom.moved(views, SMALL * change) for change in changes.T]
    there = [np.mean([view.project(points) for view in some], axis=0) for some in moved]
    return np.stack([(places - here).ravel() for places in there], axis=1) / SMALL


def slid(scene: Scene, start: Sequence[View], views: Sequence[View]) -> float:
    """Return how far the part has moved in the mean of the pictures, rms over its nodes, px."""
    moved = [now.project(scene.sample) - then.project(scene.sample) for then, now in zip(start, views, strict=True)]
    return float(np.sqrt((np.mean(moved, axis=0) ** 2).sum(axis=1).mean()))


def in_gauge(
    scene: Scene, freedom: Freedom, views: Sequence[View], deviation: Floats
) -> tuple[tuple[View, ...], Floats]:
    """Return cameras and deviation (n,) with the motion of the part that brings its shape into the system's gauge."""
    left, values, right = motions_of(scene, freedom)
    told = values**2 > FREE * values[0] ** 2
    sizes = left[:, told].T @ deviation
    changes = moving_cameras(scene, freedom, views, right[told]) @ (sizes / values[told])
    return freedom.moved(views, changes), deviation - left[:, told] @ sizes


def _tangents(normals: Floats) -> tuple[Floats, Floats]:
    """Return two unit tangents (n, 3) of each normal, across each other."""
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = unit(np.cross(normals, least))
    return first, np.cross(normals, first)
