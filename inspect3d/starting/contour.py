"""The outline of the part as a camera would see it: points of the CAD, and which way is out of it in the picture."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers, unit
from inspect3d.camera import View
from inspect3d.nominal.surface import Surface

SMOOTH = np.cos(np.radians(30.0))  # between the normals of two triangles, above which their edge bends no outline
SPACING = 0.01  # share of the diagonal, between points on a long edge
MOST = 400  # points of an outline
BESIDE = 2.0  # px on either side of the outline, where one line of sight meets the part and the other does not


@dataclass(frozen=True, eq=False)
class Contour:
    """Points of the CAD that a picture shows as the part's outline.

    Parameters
    ----------
    points : (n, 3) mm, CAD frame
    outward : (n, 2), unit, the way out of the part in the picture
    """

    points: Floats
    outward: Floats


@dataclass(frozen=True, eq=False)
class Contours:
    """Find the outline of a surface in pictures.

    Parameters
    ----------
    surface : nominal
    """

    surface: Surface

    def __call__(self, view: View, step: float) -> Contour:
        """Return the outline that a camera sees.

        An edge between a triangle that faces the camera and one that does not, or a rim, belongs to the outline if the
        line of sight just beside it in the picture meets the surface on one side only.

        Parameters
        ----------
        step : px of the picture that count as one
        """
        ends, sides = self._edges
        normals = self.surface.face_normals
        facing = np.einsum("ti,ti->t", view.centre - self.surface.vertices[self.surface.triangles[:, 0]], normals) > 0
        chosen = np.flatnonzero((sides[:, 0] == sides[:, 1]) | (facing[sides[:, 0]] != facing[sides[:, 1]]))
        points, of = self._along(ends[chosen])
        if len(points) > MOST * 2:
            few = np.random.default_rng(0).permutation(len(points))[: MOST * 2]
            points, of = points[few], of[few]
        edge = chosen[of]
        points, edge = self._pictured(view, points, edge)
        if not len(points):
            return Contour(np.zeros((0, 3)), np.zeros((0, 2)))
        across = self._across(view, points, ends[edge], sides[edge])
        at = view.project(points)
        there, here = (self._meets(view, at + side * BESIDE * step * across) for side in (1.0, -1.0))
        outer = np.flatnonzero(there != here)[:MOST]
        return Contour(points[outer], np.where(there[outer], -1.0, 1.0)[:, None] * across[outer])

    @staticmethod
    def _pictured(view: View, points: Floats, edge: Integers) -> tuple[Floats, Integers]:
        """Return the points that lie in the picture, and their edges."""
        ahead = np.flatnonzero(view.depth(points) > 0)
        at = view.project(points[ahead])
        inside = ahead[((at > 0) & (at < np.array(view.camera.size) - 1)).all(axis=1)]
        return points[inside], edge[inside]

    @cached_property
    def _edges(self) -> tuple[Integers, Integers]:
        """Return the vertices at the ends of each edge, (e, 2), and the triangles on its sides, the same at a rim."""
        triangles = self.surface.triangles
        _, same = np.unique(self.surface.vertices, axis=0, return_inverse=True)
        welded = same.ravel()[triangles]
        pairs = np.stack([welded, np.roll(welded, -1, axis=1)], axis=2).reshape(-1, 2)
        own = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
        _, first, which, counts = np.unique(
            np.sort(pairs, axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True
        )
        order = np.argsort(which.ravel(), kind="stable")
        start = np.cumsum(counts) - counts
        one, other = order[start] // 3, order[start + np.minimum(counts, 2) - 1] // 3
        return own[first], np.stack([one, other], axis=1)

    def _along(self, ends: Integers) -> tuple[Floats, Integers]:
        """Return points spread along edges (k, 2), (n, 3) mm, and the edge of each."""
        one, other = self.surface.vertices[ends[:, 0]], self.surface.vertices[ends[:, 1]]
        counts = np.ceil(np.linalg.norm(other - one, axis=1) / (SPACING * self.surface.diagonal)).astype(np.int64)
        of = np.repeat(np.arange(len(ends)), counts)
        place = (np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts) + 0.5) / counts[of]
        return one[of] + place[:, None] * (other - one)[of], of

    def _across(self, view: View, points: Floats, ends: Integers, sides: Integers) -> Floats:
        """Return the direction across the outline in the picture at points (n, 3) of edges, (n, 2), unit."""
        normals, vertices = self.surface.face_normals, self.surface.vertices
        smooth = (sides[:, 0] != sides[:, 1]) & (
            np.einsum("ni,ni->n", normals[sides[:, 0]], normals[sides[:, 1]]) > SMOOTH
        )
        along = unit(vertices[ends[:, 1]] - vertices[ends[:, 0]])
        round_it = unit(np.cross(view.centre - points, normals[sides].sum(axis=1)))
        direction = np.where(smooth[:, None], round_it, along)
        little = 1e-4 * self.surface.diagonal
        run = view.project(points + little * direction) - view.project(points - little * direction)
        return unit(np.stack([-run[:, 1], run[:, 0]], axis=1))

    def _meets(self, view: View, pixels: Floats) -> Booleans:
        rays = np.column_stack([view.camera.undistorted(pixels), np.ones(len(pixels))])
        sights = view.camera_from_cad.inverse().turned(rays)
        return np.asarray(self.surface.first_hit(view.centre, sights).triangle >= 0)
