"""Motions of control points that keep neighbouring faces together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import qr
from scipy.spatial import cKDTree

from inspect3d.arrays import Booleans, Floats, Integers, unit
from inspect3d.correlation.scene import Scene
from inspect3d.nominal.borders import Border, borders
from inspect3d.nominal.brep import Brep
from inspect3d.nominal.nurbs import Nurbs
from inspect3d.register.mobility import jacobian, spread

SPACING = 0.5  # lengths of the mesh's edges, between the places along a border
REACH = 1.0  # lengths of the mesh's edges from a node on either face, within which a border counts as seen
HAIR = 0.01  # of the spacing, from the border to where slopes are taken
SMOOTH = 1.0  # degrees between faces, below which the CAD is smooth
SUPPLE = 4  # control points across a face that can take slopes at both its borders
FEWEST = 4
APART = 1e-3  # share of the largest motion that still counts as one
WHOLE = 6


@dataclass(frozen=True, eq=False)
class Side:
    """One face at places along a border: how its control points move them along its normals, and slopes into it.

    Parameters
    ----------
    normals : (s, 3), outward
    moved : (s, k), and further six columns for a motion of the part as a whole
    slopes : the same for the slopes, 1/mm, by the way into the face
    supple : (s,), whether there are control points enough across the border
    """

    normals: Floats
    moved: Floats
    slopes: Floats
    supple: Booleans


def joints(
    brep: Brep, patches: Mapping[int, Nurbs], scene: Scene, face: Integers, sharpest: float, ways: int = 1
) -> tuple[Floats, Floats]:
    """Return rows (m, k), which vanish for motions of the control points that keep the faces together.

    With them comes what motions (6,) of the part as a whole make of them, (m, 6); see `kept_together`.

    Where faces meet at less than `sharpest` degrees their deviations agree along the edge, and so do the slopes across
    it where the CAD is smooth; of faces whose control points differ, as far as the coarser can follow. At sharper edges
    the moved faces meet somewhere near whatever they do.

    Parameters
    ----------
    patches : by the number of their face; their control points are numbered one patch after the other
    face : (f,), of each facet of the scene
    ways : in which each control point moves, see `Nurbs.along`
    """
    edge = float(np.median(np.linalg.norm(np.diff(scene.nodes[scene.triangles[:, :2]], axis=1), axis=2)))
    trees = {n: cKDTree(scene.nodes[np.unique(scene.triangles[face == n])]) for n in patches}
    sizes = np.cumsum([0, *(ways * patch.size for patch in patches.values())])
    first = dict(zip(patches, sizes.tolist(), strict=False))
    found = [np.zeros((0, sizes[-1] + WHOLE))]
    for border in borders(brep, patches, SPACING * edge):
        seen = np.all([trees[n].query(border.points)[0] < REACH * edge for n in border.faces], axis=0)
        one, other = (
            _side(patches[n], border, k, HAIR * SPACING * edge, scene, ways) for k, n in enumerate(border.faces)
        )
        angle = np.degrees(np.arccos(np.clip((one.normals * other.normals).sum(axis=1), -1, 1)))
        together = seen & (angle < sharpest)
        smooth = together & (angle < SMOOTH) & (one.supple | other.supple)
        for left, right in ((one.moved[together], other.moved[together]), (one.slopes[smooth], -other.slopes[smooth])):
            if len(left) >= FEWEST:
                rows = _agreeing(left, right)
                wide = np.zeros((len(rows[0]), sizes[-1] + WHOLE))
                for n, block in zip(border.faces, rows[:2], strict=True):
                    wide[:, first[n] : first[n] + ways * patches[n].size] += block
                wide[:, -WHOLE:] = rows[2]
                found.append(wide)
    together = np.concatenate(found)
    return together[:, :-WHOLE], together[:, -WHOLE:]


def kept_together(rows: Floats, shifts: Floats, nodes: sparse.csr_matrix, scene: Scene) -> Floats:
    """Return orthonormal motions (k, m) of the control points whose deviation, less its best fit, has no gaps.

    A part that does not lie where it is said to has its edges elsewhere as well: what a motion of the part as a whole
    makes of them is no gap.

    Parameters
    ----------
    rows, shifts : see `joints`
    nodes : (n, k), how control points move nodes
    """
    gaps = rows - shifts @ (np.linalg.pinv(_whole(scene.nodes, scene.normals, scene), APART) @ nodes)
    turned, triangle, _ = qr(gaps.T, pivoting=True)
    sizes = np.abs(np.diag(triangle))
    return turned[:, int(np.count_nonzero(sizes > APART * sizes[0])) :]


def _whole(points: Floats, normals: Floats, scene: Scene) -> Floats:
    """Return how motions of the part as a whole move points along their normals, (n, 6), in units that compare."""
    length = spread(scene.nodes, np.ones(len(scene.nodes)), scene.centre)
    return jacobian(points, normals, scene.centre) / np.array([length] * 3 + [1.0] * 3)


def _side(patch: Nurbs, border: Border, k: int, hair: float, scene: Scene, ways: int) -> Side:
    """Return the first or second face along a border, with slopes over `hair` mm."""
    inward = unit(np.cross(patch.normals(patch.parameters(border.points)), border.along[k]))
    inner = patch.parameters(border.points + hair * inward)
    at = patch.descended(border.points, inner)  # at a seam, on this side of it
    places, normals = zip(*((patch.points(uv), patch.normals(uv)) for uv in (at, inner)), strict=True)
    here, there = (
        np.column_stack([patch.along(uv, n, ways).toarray(), _whole(x, n, scene)])
        for uv, x, n in zip((at, inner), places, normals, strict=True)
    )
    ways = np.linalg.norm(places[1] - places[0], axis=1, keepdims=True)
    slopes = np.divide(there - here, ways, out=np.zeros(here.shape), where=ways > 0)
    low, high = patch.bounds
    across = np.array(patch.weights.shape)[np.abs((inner - at) / (high - low)).argmax(axis=1)]
    return Side(normals[0], here, slopes, across >= SUPPLE)


def _agreeing(one: Floats, other: Floats) -> tuple[Floats, Floats, Floats]:
    """Return rows (m, a), (m, b) and (m, 6) that vanish where two faces agree, as far as the coarser can follow.

    Parameters
    ----------
    one, other : (s, a + 6) and (s, b + 6)
    """
    own, others = one[:, :-WHOLE], other[:, :-WHOLE]
    coarser = min((_range(each) for each in (own, others)), key=lambda basis: basis.shape[1])
    rows = coarser.T @ np.concatenate([own, -others], axis=1)
    left, sizes, right = np.linalg.svd(rows, full_matrices=False)
    kept = sizes > APART * sizes[0]
    shifts = left[:, kept].T @ (coarser.T @ (one[:, -WHOLE:] - other[:, -WHOLE:])) / sizes[kept, None]
    return right[kept, : own.shape[1]], right[kept, own.shape[1] :], shifts


def _range(matrix: Floats) -> Floats:
    """Return orthonormal columns that span those of a matrix."""
    left, sizes, _ = np.linalg.svd(matrix, full_matrices=False)
    return left[:, sizes > APART * sizes[0]]
