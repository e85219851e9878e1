"""The bridge from arrays to VTK."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from inspect3d.arrays import Floats, Integers

if TYPE_CHECKING:
    from pyvista import PolyData


def triangulated(nodes: Floats, triangles: Integers) -> PolyData:
    """Return nodes (n, 3) and triangles (m, 3) as VTK data that share no memory with them."""
    from pyvista import PolyData

    faces: Any = np.array(triangles)
    return PolyData.from_regular_faces(np.array(nodes), faces)
