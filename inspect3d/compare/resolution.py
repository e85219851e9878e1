"""How far two methods may differ at a node because each resolves what is narrower than an element in its own way."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.compare.measured_map import MeasuredMap
from inspect3d.nominal.nominal import InspectionMesh

SEEN = 5.0  # standard uncertainties that the range of a dozen values exceeds in 2 % of cases


def unresolved(a: MeasuredMap, b: MeasuredMap, mesh: InspectionMesh, at: Integers) -> Floats:
    """Return by how much two maps may differ at their common nodes `at` though both are right, (k,) mm; mostly 0.

    A method reports at a node what its elements, or its local fit, make of the surface within about an element. Beside
    a step of height h, two methods that weigh both sides differently differ by up to h; on a slope they agree, for both
    follow a plane. The height of what is as sharp as a step follows from the range r₁ of a map within an element of the
    node and r₂ within two: 2 r₁ - r₂ is h for a step and 0 for a slope. It is taken from the map in which it is
    smaller: a mismatch of the part shows in both, a defect in the data of one method in one only. Where r₁ does not
    stand out of the uncertainty of a map, there is no step. Beside a rim r₂ is cut off, and part of a slope counts.

    A node on an edge has no deviation; what lies beyond it counts as beside.
    """
    beside = _beside(mesh, at)
    return np.minimum(*(_sharp(each.deviation.value[at], each.deviation.sigma[at], beside) for each in (a, b)))


def _beside(mesh: InspectionMesh, at: Integers) -> sparse.csr_matrix:
    """Return which of the common nodes (k,) lie within an element of each other, (k, k), each beside itself too."""
    n = len(mesh)
    sides = mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    ends = np.concatenate([sides, sides[:, ::-1]]).T
    beside = sparse.csr_matrix((np.ones(ends.shape[1]), ends), (n, n))
    passing: Booleans = np.ones(n, bool)
    passing[at] = False
    reached = beside + beside @ sparse.diags(passing.astype(np.float64)) @ beside + sparse.identity(n)
    return sparse.csr_matrix(reached)[at][:, at]


def _sharp(value: Floats, sigma: Floats, beside: sparse.csr_matrix) -> Floats:
    """Return the height of steps in a map (k,) mm within an element of each node, (k,) mm."""
    first, second = beside.nonzero()
    high, low = _most(value, first, second), -_most(-value, first, second)
    near = high - low
    wide = _most(high, first, second) + _most(-low, first, second)
    noise = np.sqrt(np.bincount(first, sigma[second] ** 2) / np.bincount(first))
    return np.where(near > SEEN * noise, np.maximum(2 * near - wide, 0.0), 0.0)


def _most(value: Floats, first: Integers, second: Integers) -> Floats:
    """Return the largest value (k,) among the neighbours `second` of each node `first`."""
    most = np.full(len(value), -np.inf)
    np.maximum.at(most, first, value[second])
    return most
