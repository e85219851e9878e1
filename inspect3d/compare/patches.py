"""Nodes gathered into patches, few enough for their whole covariance to be written down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from inspect3d.arrays import Floats, Integers
from inspect3d.measure import FieldCovariance

SAME_SIDE = 0.5  # cosine between the normals of patches that may be taken together
CUT = 2.5  # standard deviations at which a Gaussian window ends
AT_ONCE = 2e7  # numbers of the columns that a covariance is applied to in one go


@dataclass(frozen=True, eq=False)
class Patches:
    """Means over small pieces of the surface; where the nodes are few, each is a patch of its own.

    Parameters
    ----------
    means : (m, k), sparse: the mean over each patch of values at the nodes, weighted by area
    patch : (k,) number of the patch that each node belongs to
    places, normals : (m, 3) mm and unit
    areas : (m,) mm²
    spacing : mm, between neighbours
    """

    means: sparse.csr_matrix
    patch: Integers
    places: Floats
    normals: Floats
    areas: Floats
    spacing: float

    @classmethod
    def of(cls, nodes: Floats, normals: Floats, areas: Floats, most: int) -> Patches:
        """Return about `most` patches of nodes (k, 3), or all nodes where they are no more."""
        k = len(nodes)
        spacing = float(np.sqrt(areas.sum() / min(k, most)))
        patch = np.arange(k)
        if k > most:
            cells = np.floor((nodes - nodes.min(axis=0)) / spacing).astype(np.int64)
            main = np.abs(normals).argmax(axis=1)
            side = 2 * main + (normals[np.arange(k), main] > 0)
            patch = np.unique(np.column_stack([cells, side]), axis=0, return_inverse=True)[1].ravel()
        whole = np.bincount(patch, areas).astype(np.float64)
        means = sparse.csr_matrix((areas / whole[patch], (patch, np.arange(k))), (len(whole), k))
        directions = means @ normals
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        return cls(means, patch, means @ nodes, directions / np.maximum(lengths, 1e-12), whole, spacing)

    def covariance(self, field: FieldCovariance) -> Floats:
        """Return the covariance (m, m) of the means of a field, mm²."""
        m, k = self.means.shape
        width = max(int(AT_ONCE // k), 1)
        rows = [self.means @ field.covariance(self.means[at : at + width].T.toarray()) for at in range(0, m, width)]
        found = np.concatenate(rows, axis=1)
        return (found + found.T) / 2

    def windows(self, width: float, trust: Floats) -> sparse.csr_matrix:
        """Return the means (m, m) over Gaussian windows around each patch, on its own side of the part.

        Parameters
        ----------
        width : mm, standard deviation of the window; 0: the patch alone
        trust : (m,) weights of the patches
        """
        m = len(self.places)
        if width == 0:
            return sparse.identity(m, format="csr")
        pairs = cKDTree(self.places).query_pairs(CUT * width, output_type="ndarray")
        pairs = pairs[np.einsum("ij,ij->i", *self.normals[pairs.T]) > SAME_SIDE]
        squares = ((self.places[pairs[:, 0]] - self.places[pairs[:, 1]]) ** 2).sum(axis=1)
        weights = sparse.csr_matrix((np.exp(-squares / (2 * width**2)), pairs.T), (m, m))
        weights = (weights + weights.T + sparse.identity(m)) @ sparse.diags(trust)
        return sparse.csr_matrix(sparse.diags(1 / np.asarray(weights.sum(axis=1)).ravel()) @ weights)
