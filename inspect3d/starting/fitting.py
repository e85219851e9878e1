"""Cameras and tracks fitted to the CAD: the points of the tracks come to lie on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.nominal.surface import Feet, Surface
from inspect3d.starting.bundle import Bundle, Lines, Planes, adjusted

WIDTHS = (0.02, 0.012, 0.008, 0.005, 0.003, 0.002, 0.001, 0.0007, 0.0005, 0.0005)
"""Shares of the CAD's diagonal that points may be off it, from the first fit to the last."""
FINAL = WIDTHS[5:]
OPPOSED = 0.3
OUTLINE = 20.0  # times as far as points may be off the CAD, its outline may be off the picture's
HELD = 1e-6  # damping of the adjustment, which keeps motions at rest that the points on the CAD leave free


@dataclass(frozen=True, eq=False)
class Fitted:
    """A bundle on the CAD.

    Parameters
    ----------
    bundle : cameras and points in the CAD frame
    feet : of the points on the nominal surface
    agrees : (n,), the normal there fits that of the points around
    """

    bundle: Bundle
    feet: Feet
    agrees: Booleans

    @property
    def distance(self) -> Floats:
        """Return the distance of each point from the CAD, (n,) mm; infinite off its rim, and on its wrong side."""
        return np.where(self.agrees & ~self.feet.on_rim, np.abs(self.feet.distance), np.inf)


def fitted(
    bundle: Bundle,
    normals: Floats,
    surface: Surface,
    freedom: Callable[[tuple[View, ...]], Freedom],
    noise: float,
    widths: Sequence[float] = WIDTHS,
    lines: Callable[[tuple[View, ...], float], Lines | None] | None = None,
) -> Fitted:
    """Return cameras and points fitted to the CAD, from coarse to fine.

    In turn the foot of each point is found on the CAD, and cameras and points are adjusted so that the points come to
    lie on the tangent planes there; how far they may be off shrinks. Points far off take no part: they are background,
    or where the part differs.

    Parameters
    ----------
    bundle : in the CAD frame, nearly
    normals : (n, 3), unit, of the points, towards the cameras; zero where unknown
    freedom : what may change about cameras at given places
    noise : px, of a feature's place
    widths : shares of the CAD's diagonal that points may be off it, from the first fit to the last
    lines : where the outline of the part was found in the pictures, beside where cameras show it, within a share of the
        CAD's diagonal
    """
    turned = normals
    for share in widths:
        there = _on(bundle, turned, surface)
        width = share * surface.diagonal
        usable = (there.distance < 4 * width)[:, None]
        planes = Planes(there.feet.points, np.where(usable, there.feet.normals, 0.0), width)
        before = bundle
        asked = lines(bundle.views, OUTLINE * share) if lines else None
        bundle = adjusted(bundle, freedom(bundle.views), noise, planes, 4, HELD, asked).bundle
        if not bundle.possible:
            return _on(before, turned, surface)
        turn = bundle.views[0].camera_from_cad.rotation.T @ before.views[0].camera_from_cad.rotation
        turned = turned @ turn.T
    return _on(bundle, turned, surface)


def _on(bundle: Bundle, normals: Floats, surface: Surface) -> Fitted:
    feet = surface.closest(bundle.points)
    cosine = np.einsum("ni,ni->n", normals, feet.normals)
    return Fitted(bundle, feet, (cosine > OPPOSED) | ~normals.any(axis=1))
