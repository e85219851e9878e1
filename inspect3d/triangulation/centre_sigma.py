"""How well bundle adjustment knows where cameras stand that it placed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.triangulation.tie import TiePoints, loss_scale

POSE, LENS = 6, ("focal length", "k1", "k2")
SMALL = 1e-4
NOTHING = 1e-13
OFF_MIDDLE = 0.005  # of the longer side of a picture, standard uncertainty of the principal point in it


def centre_sigma(tied: TiePoints, free_lenses: bool, systematic: float) -> Floats:
    """Return the standard uncertainty of each camera's centre (v,), rms of three axes, in the unit of the views.

    It is NaN for cameras that were not placed, and tells how the centres lie against each other: a motion and a growth
    of all of them together do not count. All tie points are taken to be equally uncertain in the pictures, as much as
    the robust adjustment leaves them off, and independent. What they share besides, since features look another way
    from aside, is a shift of each picture, constant and linear in its pixels, of standard uncertainty `systematic` over
    its features. Free lenses are adjusted with their axes in the middle of the picture: that these lie half a per cent
    of its longer side off counts as a shift of the whole picture, and is most of the uncertainty then.

    With the points eliminated, U - W V⁻¹ W' is the reduced camera matrix. It has seven motions without stiffness, which
    the map to the frame of the centres sends to zero, so that any generalised inverse serves.

    Parameters
    ----------
    free_lenses : whether focal length and two radial terms of each lens were adjusted too
    systematic : px, of each component of the shift of a picture

    Notes
    -----
    B. Triggs, P. McLauchlan, R. Hartley, A. Fitzgibbon, "Bundle adjustment: a modern synthesis", 2000, sections 6.1
    and 9.3.
    """
    placed = [(k, view) for k, view in enumerate(tied.views) if view is not None]
    size, points = POSE + len(LENS) * free_lenses, tied.points
    weight, misses = np.zeros((len(points), 3, 3)), []
    slopes = []
    reduced = np.zeros((len(placed) * size, len(placed) * size))
    cross = np.zeros((len(points), len(placed) * size, 3))
    for row, (k, view) in enumerate(placed):
        here = tied.view == k
        which, own = tied.point[here], np.arange(row * size, (row + 1) * size)
        by_point, by_camera = _slopes(view, points[which], free_lenses)
        middle = np.sqrt(3.0) * OFF_MIDDLE * max(view.camera.size) * free_lenses
        slopes.append((which, _shifts(tied.pixels[here]), by_point, by_camera, middle))
        misses.append(tied.pixels[here] - view.project(points[which]))
        np.add.at(weight, which, np.einsum("nra,nrb->nab", by_point, by_point))
        reduced[np.ix_(own, own)] = np.einsum("nra,nrb->ab", by_camera, by_camera)
        np.add.at(cross, (which[:, None], own[None]), np.einsum("nra,nrb->nab", by_camera, by_point))
    eliminated = np.einsum("pia,pab->pib", cross, np.linalg.inv(weight))
    reduced -= np.einsum("pib,pjb->ij", eliminated, cross, optimize=True)
    freedom = max(2 * len(tied.pixels) - 3 * len(points) - len(reduced) + 7, 1)
    noise = 2 * len(tied.pixels) / freedom * robust_variance(np.concatenate(misses))
    scale = 1 / np.sqrt(np.diag(reduced))
    inverse = np.linalg.pinv(reduced * scale * scale[:, None], NOTHING, hermitian=True) * scale * scale[:, None]
    common = []
    for row, (which, shifts, by_point, by_camera, middle) in enumerate(slopes):
        pulls = -np.einsum("nib,nrb,nf->irf", eliminated[which], by_point, shifts, optimize=True)
        pulls[row * size : (row + 1) * size] += np.einsum("nrc,nf->crf", by_camera, shifts)
        sizes = np.array([np.hypot(systematic, middle), systematic, systematic])
        common.append(inverse @ (sizes * pulls).reshape(len(reduced), -1))
    moved = np.concatenate(common, axis=1)
    centres = (np.arange(len(placed))[:, None] * size + np.arange(3, POSE)).ravel()
    covariance = (noise * inverse + moved @ moved.T)[np.ix_(centres, centres)]
    return _against_each_other(covariance, placed, len(tied.views))


def robust_variance(misses: Floats) -> float:
    """Return the variance, px², that misses (n, 2) of a least-squares fit would need to be as certain as Cauchy's.

    With the weights w = 1 / (1 + |r|²/c²) that is E(w² |r|²) / 2 over E(w²)², w² being the mean slope of w r.

    Notes
    -----
    P. J. Huber, "Robust Statistics", 1981, section 7.6.
    """
    squares = (misses**2).sum(axis=1)
    weights = 1 / (1 + squares / max(loss_scale(misses) ** 2, NOTHING))
    return float((weights**2 * squares).mean() / 2 / (weights**2).mean() ** 2)


def _shifts(pixels: Floats) -> Floats:
    """Return shifts at pixels (n, 2) that are constant and linear in them, (n, 3), their squares one on average."""
    away = pixels - pixels.mean(axis=0)
    linear = away / np.sqrt(np.maximum((away**2).mean(axis=0), NOTHING))
    return np.column_stack([np.ones(len(pixels)), linear]) / np.sqrt(3.0)


def _against_each_other(covariance: Floats, placed: list[tuple[int, View]], count: int) -> Floats:
    """Return the uncertainties (count,) from the covariance (3 k, 3 k) of the centres in whatever frame."""
    centres = np.array([view.centre for _, view in placed])
    away = centres - centres.mean(axis=0)
    turns = np.cross(np.eye(3)[None], away[:, None]).transpose(0, 2, 1)
    shifts = np.broadcast_to(np.eye(3), (len(away), 3, 3))
    common = np.concatenate([turns, shifts, away[:, :, None]], axis=2).reshape(-1, 7)
    rest = np.eye(len(common)) - common @ np.linalg.pinv(common)
    variances = np.diag(rest @ covariance @ rest.T).reshape(-1, 3).mean(axis=1)
    found = np.full(count, np.nan)
    found[[k for k, _ in placed]] = np.sqrt(variances)
    return found


def _slopes(view: View, points: Floats, free_lens: bool) -> tuple[Floats, Floats]:
    """Return the slopes of pixels by the points (n, 2, 3), and by turns about the camera, shifts and lens (n, 2, c)."""
    step = SMALL * float(np.median(view.depth(points)))
    sides = [view.project(points + step * axis) - view.project(points - step * axis) for axis in np.eye(3)]
    by_point = np.stack(sides, axis=2) / (2 * step)
    turned = np.stack([np.cross(axis, points - view.centre) for axis in np.eye(3)], axis=2)
    columns = [by_point @ turned, by_point]
    if free_lens:
        columns.append(np.stack([_by_lens(view, points, number) for number in range(len(LENS))], axis=2))
    return by_point, np.concatenate(columns, axis=2)


def _by_lens(view: View, points: Floats, number: int) -> Floats:
    """Return the slopes (n, 2) of pixels by the focal length, k1 or k2."""
    matrix, distortion = view.camera.matrix.copy(), view.camera.distortion.copy()
    step = SMALL * matrix[0, 0] if number == 0 else SMALL
    if number == 0:
        matrix[[0, 1], [0, 1]] += step
    else:
        distortion[number - 1] += step
    changed = replace(view, camera=replace(view.camera, matrix=matrix, distortion=distortion))
    return (changed.project(points) - view.project(points)) / step
