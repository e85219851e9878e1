"""A milled block in the spirit of the paper's Fig. 12: planar facets beside a cylindrical section.

The facets belong to the CAD. L. Dubreuil, J.-E. Dufour, Y. Quinsat, F. Hild, Mesh-Based Shape Measurements with
Stereocorrelation: Principle and First Results, Exp. Mech. 56, 2016, section 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate, pairwise
from math import radians, tan
from typing import Any

from inspect3d.virtual.deviation_field import DeviationField, FacetErrors, Scallops, Step, Within
from inspect3d.virtual.part import Part


@dataclass(frozen=True)
class MilledSizes:
    """The sizes of the milled block, mm; its profile lies in x, z and runs along y.

    The top is, along x: a ledge, the facets (each steeper than the one before), a land, the cylindrical section, a
    lower land. One corner is cut off at a slant, so that the part has no symmetry and cannot slide along y.
    """

    length: float = 100.0
    width: float = 70.0
    ledge: tuple[float, float] = (14.0, 20.0)  # length, height
    facet: float = 8.0  # length of a facet along x
    slopes: tuple[float, ...] = (6.0, 12.0, 18.0, 24.0)  # degrees, one per facet
    land: float = 6.0
    section: tuple[float, float, float] = (34.0, 5.0, -6.0)  # length; height of its middle and its end above the land
    cut: float = 22.0  # legs of the slanted corner at x = length, y = width

    @property
    def facet_borders(self) -> tuple[float, ...]:
        """Return where the facets begin and end along x, mm."""
        return tuple(self.ledge[0] + k * self.facet for k in range(len(self.slopes) + 1))

    @property
    def section_start(self) -> float:
        """Return where the cylindrical section begins along x, mm."""
        return self.facet_borders[-1] + self.land


def milled(sizes: MilledSizes | None = None) -> Part:
    """Return the milled block, by default 100 x 70 x 34 mm; no symmetry."""
    chosen = sizes or MilledSizes()
    return Part("milled", lambda: _shape(chosen))


def machining(pitch: float, scallop: float = 0.012, sizes: MilledSizes | None = None) -> DeviationField:
    """Return what the milling left behind: 40 µm mismatch at the section, 15 µm errors of the facets, scallops.

    Parameters
    ----------
    pitch : mm, from scallop to scallop along x
    scallop : mm, height of the scallops
    """
    chosen = sizes or MilledSizes()
    low = (chosen.facet_borders[0], -1.0, 1.0)
    high = (chosen.length + 1.0, chosen.width + 1.0, chosen.length)
    mismatch = Step(0.040, point=(chosen.section_start, 0.0, 0.0), normal=(1.0, 0.0, 0.0))
    facets = FacetErrors(chosen.facet_borders, heights=(0.015, -0.015, 0.015, -0.015), direction=(1.0, 0.0, 0.0))
    scallops = Scallops(scallop, pitch=pitch, direction=(1.0, 0.0, 0.0))
    return Within(mismatch + facets + scallops, low, high)


def _shape(sizes: MilledSizes) -> Any:
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeHalfSpace, BRepPrimAPI_MakePrism
    from OCP.GC import GC_MakeArcOfCircle
    from OCP.gp import gp_Dir, gp_Pln, gp_Pnt, gp_Vec

    rises = accumulate((sizes.facet * tan(radians(slope)) for slope in sizes.slopes), initial=sizes.ledge[1])
    facets = [gp_Pnt(x, 0.0, z) for x, z in zip(sizes.facet_borders, rises, strict=True)]
    top, start = facets[-1].Z(), sizes.section_start
    run, middle, end = sizes.section
    before, between, after = (
        gp_Pnt(start, 0.0, top),
        gp_Pnt(start + run / 2, 0.0, top + middle),
        gp_Pnt(start + run, 0.0, top + end),
    )
    far = sizes.length
    rising = [gp_Pnt(0.0, 0.0, 0.0), gp_Pnt(0.0, 0.0, sizes.ledge[1]), *facets, before]
    falling = [after, gp_Pnt(far, 0.0, top + end), gp_Pnt(far, 0.0, 0.0), rising[0]]

    wire = BRepBuilderAPI_MakeWire()
    for a, b in pairwise(rising):
        wire.Add(BRepBuilderAPI_MakeEdge(a, b).Edge())
    wire.Add(BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(before, between, after).Value()).Edge())
    for a, b in pairwise(falling):
        wire.Add(BRepBuilderAPI_MakeEdge(a, b).Edge())
    profile = BRepBuilderAPI_MakeFace(wire.Wire(), True).Face()
    block = BRepPrimAPI_MakePrism(profile, gp_Vec(0.0, sizes.width, 0.0)).Shape()

    corner = gp_Pnt(far, sizes.width, top)
    slant = gp_Pln(gp_Pnt(far - sizes.cut, sizes.width, top), gp_Dir(1, 1, 1))
    beyond = BRepPrimAPI_MakeHalfSpace(BRepBuilderAPI_MakeFace(slant).Face(), corner).Solid()
    return BRepAlgoAPI_Cut(block, beyond).Shape()
