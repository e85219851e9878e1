"""The part as designed: an exact or fine surface, and the mesh on which deviations are reported."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers, booleans, floats, integers
from inspect3d.nominal.surface import Surface


@dataclass(frozen=True, eq=False)
class InspectionMesh:
    """Quasi-uniform triangles on the nominal surface; every method reports its deviation at these nodes.

    Parameters
    ----------
    nodes : (n, 3) mm, on the exact surface
    triangles : (m, 3) indices, counter-clockwise seen from outside
    normals : (n, 3), unit, out of the material: the exact normal inside a face, the angle-weighted mean on an edge
    crease : (n,), nodes on an edge whose facets are more than 30 degrees apart
    face : (n,) number of the B-rep face that owns the node; -1 where the model has none
    """

    nodes: Floats
    triangles: Integers
    normals: Floats
    crease: Booleans
    face: Integers

    def __post_init__(self) -> None:
        n = len(self.nodes)
        object.__setattr__(self, "nodes", floats(self.nodes, "nodes", None, 3))
        object.__setattr__(self, "triangles", integers(self.triangles, "triangles", None, 3))
        object.__setattr__(self, "normals", floats(self.normals, "normals", n, 3))
        object.__setattr__(self, "crease", booleans(self.crease, "crease", n))
        object.__setattr__(self, "face", integers(self.face, "face", n))

    def __len__(self) -> int:
        """Return the number of nodes."""
        return len(self.nodes)

    @cached_property
    def areas(self) -> Floats:
        """Return the area of each node, (n,) mm²: a third of every triangle around it."""
        a, b, c = (self.nodes[self.triangles[:, k]] for k in range(3))
        third = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0
        return np.bincount(self.triangles.ravel(), np.repeat(third, 3), minlength=len(self.nodes)).astype(np.float64)

    def nodes_of(self, faces: Iterable[int]) -> Integers:
        """Return the nodes that the B-rep faces with the given numbers own."""
        return np.flatnonzero(np.isin(self.face, list(faces)))

    @cached_property
    def edge_length(self) -> float:
        """Return the median length of the edges, mm."""
        corners = self.nodes[self.triangles]
        return float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))


@dataclass(frozen=True, eq=False)
class Nominal:
    """The part as designed.

    Parameters
    ----------
    name : of the part
    surface : triangles fine enough to stand for the exact surface; distances are measured to it
    mesh : the inspection mesh
    chord : largest distance between `surface` and the exact surface, mm; 0 where the mesh is the model
    remarks : what was repaired or assumed, a sentence each
    exact : the B-rep, where there is one (see `inspect3d.nominal.brep`)
    surface_face : (m,) number of the B-rep face each triangle of `surface` lies on, where there is one
    """

    name: str
    surface: Surface
    mesh: InspectionMesh
    chord: float = 0.0
    remarks: tuple[str, ...] = ()
    exact: object | None = None
    surface_face: Integers | None = None

    def __post_init__(self) -> None:
        if self.surface_face is not None:
            faces = integers(self.surface_face, "surface_face", len(self.surface.triangles))
            object.__setattr__(self, "surface_face", faces)

    @property
    def diagonal(self) -> float:
        """Return the diagonal of the bounding box, mm."""
        return self.surface.diagonal
