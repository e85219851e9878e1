"""Variance of what the polynomials around the nodes do not follow."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array

from inspect3d.arrays import Booleans, Floats
from inspect3d.nominal.nominal import InspectionMesh

STEPS = 5  # to neighbours; they weigh about 30 nodes, most of them within three edges


def lack_of_fit(mesh: InspectionMesh, told: Booleans, change: Floats, uncertain: Floats, variance: Floats) -> Floats:
    """Return the variance of the lack of fit at nodes, (k,) mm², from what a further term changes around them.

    The change d of a node's value by the further term has the expected square v + b², v its variance and b what the
    polynomial missed. So b² is the mean of d² - v over the nodes around, weighted by 1 / (s² + v), the inverse variance
    of the value with the further term, and by the number of ways of five steps that lead there over the edges of the
    mesh, where staying counts as a step. A negative mean is taken for 0. It is a mean since a node's own change is as
    uncertain as its value; what one node misses beside a step is shared out over those around.

    Parameters
    ----------
    mesh : the inspection mesh, n nodes
    told : (n,), the k nodes where the further term could be fitted
    change : d (k,) mm
    uncertain : v (k,) mm², variance of the change
    variance : s² (k,) mm², of the value without the further term
    """
    count = len(mesh)
    sides = np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]])
    first = np.concatenate([sides[:, 0], sides[:, 1], np.arange(count)])
    second = np.concatenate([sides[:, 1], sides[:, 0], np.arange(count)])
    beside = coo_array((np.ones(len(first)), (first, second)), shape=(count, count)).tocsr()
    beside.data[:] = 1.0
    whole = variance + uncertain
    weight = np.divide(1.0, whole, out=np.zeros_like(whole), where=whole > 0)
    sums = np.zeros((count, 2))
    sums[told] = np.stack([weight * (change**2 - uncertain), weight], axis=1)
    for _ in range(STEPS):
        sums = beside @ sums
    above, below = sums[told].T
    return np.maximum(np.divide(above, below, out=np.zeros_like(above), where=below > 0), 0.0)
