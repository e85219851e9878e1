"""Sheets before two cameras, and what these see: what tests of the correlation engine share."""

from __future__ import annotations

import numpy as np

from inspect3d.correlation.normal import facets
from inspect3d.correlation.picture import Pictures
from inspect3d.correlation.seen import scene
from tests.sheets import plane, plane_normals, sheet
from tests.speckled import Speckle, picture, rig

STEEPEST = np.radians(65)
ALL = np.arange(16)


def flat_sheet():
    """Return a flat sheet, two views of it, and what they see."""
    nominal, views = sheet(plane, plane_normals, edge=9.0), rig()
    return nominal, views, scene(nominal, views, 6.0, STEEPEST, [None, None])


def wavy_sheet():
    """Return a wavy sheet, two views with distorting lenses, what they see, and exact pictures of it."""
    nominal, views = sheet(edge=6.0), rig(distortion=(-0.1, 0.2, 1e-3, -1e-3, 0.1))
    speckle = Speckle.drawn(np.random.default_rng(0), 0.7)
    stack = Pictures([picture(view, speckle) for view in views]).blurred(0.0)
    return nominal, views, scene(nominal, views, 4.0, STEEPEST, [None, None]), stack


def accumulated(seen, stack, views, deviation=None, columns=ALL):
    """Return what the pictures say, at the nominal shape unless told."""
    deviation = np.zeros(len(seen.nodes)) if deviation is None else deviation
    return facets(seen, stack, views, deviation, np.ones(len(seen.triangles)), columns, power=0)
