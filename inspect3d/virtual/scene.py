"""The true part before the cameras: its exact shape, its deviation and its paint."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.virtual.deviation_field import DeviationField
from inspect3d.virtual.part_surface import PartSurface
from inspect3d.virtual.speckle import Speckle

if TYPE_CHECKING:
    from inspect3d.nominal.bvh import Tree
    from inspect3d.virtual.patch_kernel import PackedPatches

ROUNDS = 8
STEADY = 1e-4  # mm; a change of d that moves the end of a line of sight by less than a thousandth of a pixel


@dataclass(frozen=True, eq=False)
class Sights:
    """What n lines of sight end on.

    Parameters
    ----------
    hit : (n,), those that end on the part; the rest of a line that does not means nothing
    points : (n, 3) mm, the nominal surface point x of the material seen; it stands at x + d(x) n(x)
    normals : (n, 3), unit, n(x), outward
    height : (n,) mm, d(x)
    """

    hit: Booleans
    points: Floats
    normals: Floats
    height: Floats


@dataclass(frozen=True, eq=False)
class Scene:
    """A painted part that differs from its CAD: the surface x + d(x) n(x), x running over the nominal one.

    A line of sight first meets the triangles of the nominal part, which decide what hides what and where the part
    ends; then the place moves over the exact patch, by Newton's method, until the deviated surface lies on the line.
    So a deviation neither casts shadows nor moves the outline, which is off by d times the tangent of the angle of
    view; inside the outline, places are exact to rounding. On a cliff of d, as a mismatch step has, the line ends on
    one of the two sides; where it only just touches the part, it ends on the nominal surface.

    Parameters
    ----------
    surface : as designed
    deviation : d, how the part differs from it
    speckle : paint
    """

    surface: PartSurface
    deviation: DeviationField
    speckle: Speckle

    def prepare(self) -> None:
        """Build what lines of sight need, once, before several threads ask for it."""
        _ = self._tree, self._at_corners, self._patches

    def sights(self, origin: Floats, directions: Floats) -> Sights:
        """Return what lines of sight from one point end on.

        Parameters
        ----------
        origin : (3,) mm, CAD frame
        directions : (n, 3), unit
        """
        from inspect3d.virtual.beam_kernel import first_met
        from inspect3d.virtual.sight_kernel import interpolate, slide

        count = len(directions)
        triangle, distance, at = np.empty(count, np.int64), np.empty(count), np.zeros((count, 3))
        points, normals = np.zeros((2, count, 3))
        first_met(origin, directions, self._tree, triangle, distance)
        interpolate(origin, directions, triangle, distance, self._corners, self._at_corners, at)
        hit = triangle >= 0
        face = self.surface.face[triangle]
        unsettled = np.flatnonzero(hit)
        slide(origin, directions, unsettled, face, self._patches, at, points, normals)
        for _ in range(ROUNDS):
            height = self.deviation(points[unsettled])
            change = np.abs(height - at[unsettled, 2])
            at[unsettled, 2] = height
            slide(origin, directions, unsettled[change > 0.0], face, self._patches, at, points, normals)
            unsettled = unsettled[change > STEADY]
            if len(unsettled) == 0:
                break
        return Sights(hit, points, normals, at[:, 2])

    @cached_property
    def _corners(self) -> Floats:
        """Return the corners (m, 3, 3) mm of the triangles."""
        return self.surface.vertices[self.surface.triangles]

    @cached_property
    def _at_corners(self) -> Floats:
        """Return u, v and d (mm) at the corners of the triangles, (m, 3, 3)."""
        height = self.deviation(self.surface.vertices)
        return np.column_stack([self.surface.parameters, height])[self.surface.triangles]

    @cached_property
    def _tree(self) -> Tree:
        from inspect3d.nominal.bvh import build

        return build(self._corners, self.surface.triangulation.face_normals)

    @cached_property
    def _patches(self) -> PackedPatches:
        from inspect3d.virtual.patch_kernel import packed

        return packed(self.surface.patches)
