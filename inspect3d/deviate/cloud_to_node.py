"""From points to the nodes of the inspection mesh: what the cloud says where the node's normal meets it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.deviate.lack_of_fit import lack_of_fit
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.nominal.surface import Feet


@dataclass(frozen=True, eq=False)
class NodeFit:
    """The measured surface over each node, before any rigid motion is taken out.

    Parameters
    ----------
    value : (n,) mm, signed distance along the node's normal; NaN where not observed
    variance : (n,) mm², of the value, from the scatter, number and place of the points; NaN where not observed
    observed : (n,)
    noise : mm, standard uncertainty of a point: as given, or the robust scatter of the points about the local fits
    radius : mm, of the fits
    missed : (n,) mm², variance of what the polynomial does not follow, which the scatter does not show; 0 where it is
        not told, NaN where not observed
    """

    value: Floats
    variance: Floats
    observed: Booleans
    noise: float
    radius: float
    missed: Floats


@dataclass(frozen=True)
class CloudToNode:
    """Fit a polynomial to the signed distances of the points whose feet lie around a node.

    The distance to the nominal surface is fitted as a function of the place on it, so that the shape of the part
    itself does not enter; a quadratic polynomial follows a bump's top, a linear one serves where points are few.
    Points off by more than four robust scales are left out. The radius holds about `wanted` points, within limits set
    by the mesh, and grows where they are few.

    Points that are less certain count less. The variance is s² times the first entry of (A'A)⁻¹, with s² pooled from
    the node's own scatter and the noise of the cloud, which counts as `prior` further points. A node that lies beyond
    the edge of the scan is not observed: an extrapolated value is not a measured one.

    What the quadratic polynomial does not follow, as narrow ridges, hardly shows in the scatter. By how much r⁴, as one
    more term, would change the value at the nodes tells the variance of it (`lack_of_fit`), which is kept apart.

    Parameters
    ----------
    wanted : number of points around a node
    radius : least and largest radius, in edge lengths of the mesh
    grown : radius to which a node short of points may grow, in edge lengths
    prior : points that the noise of the whole cloud is worth at each node
    unlike : a node whose points scatter so many times more than usual is not observed: they are not of one surface
    """

    wanted: int = 100
    radius: tuple[float, float] = (0.35, 0.75)
    grown: float = 1.2
    prior: float = 20.0
    unlike: float = 6.0

    def __call__(
        self, mesh: InspectionMesh, feet: Feet, part: Booleans, noise: float | None = None, shares: Floats | None = None
    ) -> NodeFit:
        """Return the measured surface over the nodes.

        Parameters
        ----------
        mesh : the inspection mesh
        feet : of the points (k,) on the nominal surface
        part : (k,), the points of the part; feet on a rim are left out in any case
        noise : mm, standard uncertainty of a point; None: estimated from the scatter
        shares : (k,), that of each point as a share of the usual one; None: all are alike
        """
        from inspect3d.deviate.local_fit_kernel import fit_nodes

        chosen = np.flatnonzero(part & ~feet.on_rim)
        if not len(chosen):
            nothing = np.full(len(mesh), np.nan)
            return NodeFit(nothing, nothing, np.zeros(len(mesh), bool), noise or np.nan, np.nan, nothing)
        edge = mesh.edge_length
        cell = edge / 2
        low = feet.points[chosen].min(axis=0)
        cells = np.floor((feet.points[chosen] - low) / cell).astype(np.int64)
        shape = cells.max(axis=0) + 1
        keys = (cells[:, 0] * shape[1] + cells[:, 1]) * shape[2] + cells[:, 2]
        order = np.argsort(keys, kind="stable")
        chosen, keys = chosen[order], keys[order]
        weights = np.ones(len(chosen)) if shares is None else 1 / shares[chosen]
        grid = (low, cell, shape, keys, feet.points[chosen], feet.normals[chosen], feet.distance[chosen], weights)
        radii = self._radii(mesh, keys, cell)
        value, factor, squares, freedom, change, uncertain = fit_nodes(
            mesh.nodes, mesh.normals, radii, noise or 0.0, *grid
        )
        observed = np.isfinite(factor) & ~mesh.crease
        usual = _pooled(squares[observed], freedom[observed])
        noise = noise or usual
        observed &= squares <= (self.unlike * max(noise, usual)) ** 2 * np.maximum(freedom, 1)
        pooled = (self.prior * noise**2 + squares) / (self.prior + freedom)
        variance = np.where(observed, pooled * np.where(observed, factor, 1.0), np.nan)
        told = observed & np.isfinite(uncertain)
        missed = np.where(observed, 0.0, np.nan)
        missed[told] = lack_of_fit(mesh, told, change[told], pooled[told] * uncertain[told], variance[told])
        return NodeFit(np.where(observed, value, np.nan), variance, observed, noise, float(radii[0, 0]), missed)

    def _radii(self, mesh: InspectionMesh, keys: np.ndarray, cell: float) -> Floats:
        """Return the radii to try at each node, (n, 3) mm, from the density of the points."""
        _, number = np.unique(keys, return_counts=True)
        density = float(np.median(number)) / cell**2
        wanted = np.sqrt(self.wanted / (np.pi * density))
        first = float(np.clip(wanted, self.radius[0] * mesh.edge_length, self.radius[1] * mesh.edge_length))
        return np.tile([first, self.radius[1] * mesh.edge_length, self.grown * mesh.edge_length], (len(mesh), 1))


def _pooled(squares: Floats, freedom: Floats) -> float:
    """Return the usual scatter of a point, mm: the median over the nodes of their own; 0 where no node has any."""
    told = freedom > 0
    if not told.any():
        return 0.0
    # the median of chi-square over its degrees of freedom is (1 - 2/(9 k))³ (Wilson & Hilferty 1931)
    share = (1 - 2 / (9 * freedom[told])) ** 3
    return float(np.sqrt(np.median(squares[told] / freedom[told] / share)))
