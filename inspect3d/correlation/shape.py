"""The shape that stereocorrelation found."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import View
from inspect3d.correlation.hidden import HiddenMotion
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.state import State
from inspect3d.correlation.systematic import Systematic
from inspect3d.correlation.uncertainty import Uncertainty
from inspect3d.deviate.deviation import Deviation
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.register.gauge import Gauge, best_fit


@dataclass(frozen=True, eq=False)
class Shape:
    """A deviation field in the gauge of the solver, its covariance, and what the pictures do not tell.

    Parameters
    ----------
    mesh : all nodes
    scene : the facets that were measured, and their nodes
    state : nodal motions, cameras, and the way there
    uncertainty : of the nodes of the scene
    hidden : motions that the pictures do not show or show weakly
    facets : residuals and correlation of the scene's facets
    calibrated : the cameras as they were found on the nominal shape, before it moved; None where they were known
    systematic : the shift of the pictures that is in the uncertainty
    quarterings : how many times the facets of the mesh were cut in four, since they did not follow the part
    """

    mesh: InspectionMesh
    scene: Scene
    state: State
    uncertainty: Uncertainty
    hidden: tuple[HiddenMotion, ...]
    facets: Facets
    calibrated: tuple[View, ...] | None = None
    systematic: Systematic | None = None
    quarterings: int = 0

    @property
    def views(self) -> tuple[View, ...]:
        """Return the cameras as they were found."""
        return self.state.views

    @property
    def settled(self) -> bool:
        """Tell whether the last step was shorter than the tolerance."""
        return self.state.settled

    @cached_property
    def values(self) -> Floats:
        """Return the deviation of the scene's nodes, (n,) mm, without the bias of linear elements."""
        return self.uncertainty.deviation(self.state.motion)

    @cached_property
    def sound(self) -> Booleans:
        """Tell which nodes of the scene count as observed, (n,).

        Those with at least half their evaluation points in facets on which the pictures agree, off creases, and that
        move across these facets.
        """
        scene = self.scene
        return scene.own & scene.whole & scene.upright & ~self.mesh.crease[scene.node]

    @property
    def observed(self) -> Booleans:
        """Tell which nodes of the mesh are observed."""
        observed = np.zeros(len(self.mesh), dtype=bool)
        observed[self.scene.node[self.sound]] = True
        return observed

    @cached_property
    def residual(self) -> Floats:
        """Return sqrt((1 - r) / 2) of each node of the mesh, r the mean correlation of its facets; NaN where unseen."""
        scene = self.scene
        weights = self.scene.gathered(np.ones((len(scene.triangles), 3)))
        sums = scene.gathered(np.repeat(self.facets.correlation[:, None], 3, axis=1))
        residual = np.full(len(self.mesh), np.nan)
        residual[scene.node[scene.own]] = np.sqrt(np.clip(1 - sums / weights, 0, 2) / 2)[scene.own]
        return residual

    @property
    def unresolved(self) -> Booleans | None:
        """Tell at which observed nodes of the mesh splines do not follow the part; None where none move it."""
        model = self.uncertainty.model
        if model is None:
            return None
        unresolved = np.zeros(len(self.mesh), dtype=bool)
        unresolved[self.scene.node[self.sound & model.missed]] = True
        return unresolved

    @cached_property
    def gauge(self) -> Gauge:
        """Return the common alignment, the robust best fit over the observed nodes."""
        nodes = self.scene.node[self.sound]
        mesh = self.mesh
        return best_fit(mesh.nodes[nodes], mesh.normals[nodes], mesh.areas[nodes], self.values[self.sound])

    def deviation(self, gauge: Gauge | None = None) -> Deviation:
        """Return the deviation map of all nodes.

        Parameters
        ----------
        gauge : the alignment to bring it into, over the observed nodes; none: the solver's own, where only cameras that
            are known give the part its place
        """
        sound, n = self.sound, len(self.scene.nodes)
        values, variances = self.values[sound], self.uncertainty.variances[sound]
        if gauge is not None:
            modes, solver = np.zeros((n, 6)), np.zeros((6, n))
            modes[sound], solver[:, sound] = gauge.jacobian, gauge.solver
            values, variances = gauge(values), self.uncertainty.variances_without(modes, solver)[sound]
        return Deviation(self._spread(values), self._spread(np.sqrt(np.maximum(variances, 1e-300))), self.observed)

    def _spread(self, values: Floats) -> Floats:
        """Return values of the observed nodes at their places among all, NaN elsewhere."""
        everywhere = np.full(len(self.mesh), np.nan)
        everywhere[self.scene.node[self.sound]] = values
        return everywhere
