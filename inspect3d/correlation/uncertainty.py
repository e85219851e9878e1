"""How sure the shape is: noise, correlated residuals, unknown cameras and a smooth systematic shift of the pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.lack_of_fit import lack_of_fit
from inspect3d.correlation.linear import noise_of, slides_of, system_of
from inspect3d.correlation.misfit import misfit, unresolved
from inspect3d.correlation.model_error import ModelError, model_error
from inspect3d.correlation.normal import Facets
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.shift import needed_columns, shift_blocks, shift_of, without_shift
from inspect3d.correlation.smoothing import Smoothing
from inspect3d.correlation.solver import held
from inspect3d.correlation.still import left_open, slides_in_pictures
from inspect3d.correlation.system import System
from inspect3d.correlation.systematic import Systematic


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """The covariance T (C + F F') T' + diag(m²) of the reported deviation of the scene's nodes, in mm².

    Where the map is smoothed the motions are S q, see `Smoothing`; C and F are S C S' and S F then.

    Parameters
    ----------
    system : the information of the pictures and priors; its inverse is C
    shifts : F (k, r), what of the systematic shift looks like a deviation, or is more than stated and moves the shape;
        and what of motions that are held the start leaves open, see `left_open`
    smoother : T (n, k), from the motions of the scene's space to the deviation of its nodes
    rough : m (n,) mm, of nodes where the elements do not fit, as at a step; 0 elsewhere. Of a smoothed map the bias too
    noise : variance of the residuals where they fit, grey levels²
    fitting : share of the facets that follow the part, as far as noise lets them tell
    correlated : κ >= 1, by which the residuals of neighbouring points add up to more than if they were independent
    smoothing : S, of a map that is smoothed
    model : what splines miss of the part, added to the covariance; None: nodes move by themselves
    """

    system: System
    shifts: Floats
    smoother: sparse.csr_matrix
    rough: Floats
    noise: float
    fitting: float
    correlated: float
    smoothing: Smoothing | None = None
    model: ModelError | None = None

    def deviation(self, motion: Floats) -> Floats:
        """Return the deviation (n,) mm to be reported of a motion (k,)."""
        return self.smoother @ (motion if self.smoothing is None else self.smoothing(motion))

    def smoothed(self, scene: Scene, found: Facets, weights: Floats, motion: Floats, stiffness: float) -> Uncertainty:
        """Return the uncertainty of the map smoothed by a plate.

        Parameters
        ----------
        found, weights : as for `uncertainty`
        motion : (k,) mm, found without the plate
        stiffness : see `Smoothing`
        """
        shares = weights * found.clean**2 / (self.noise * self.correlated)
        smoothing = Smoothing(scene, found.node * shares[:, None, None], self.system, stiffness)
        bias = self.smoother @ smoothing.taken(motion)
        return replace(self, shifts=smoothing(self.shifts), rough=np.hypot(self.rough, bias), smoothing=smoothing)

    @cached_property
    def variances(self) -> Floats:
        """Return the diagonal, (n,) mm²."""
        by_shifts = ((self.smoother @ self.shifts) ** 2).sum(axis=1)
        missed = 0.0 if self.model is None else self.model.variances
        return self._motions.variances(self.smoother) + by_shifts + self.rough**2 + missed

    def covariance(self, columns: Floats) -> Floats:
        """Return the covariance times columns (n, k)."""
        back = self.smoother.T @ columns
        smooth = self.smoother @ (self._motions.covariance(back) + self.shifts @ (self.shifts.T @ back))
        missed = 0.0 if self.model is None else self.model.covariance(columns)
        return smooth + self.rough[:, None] ** 2 * columns + missed

    def variances_without(self, modes: Floats, solver: Floats) -> Floats:
        """Return the diagonal for the field less its modes, (I - J M) v: J = `modes` (n, k) and M = `solver` (k, n)."""
        crossed = self.covariance(np.ascontiguousarray(solver.T))
        between = np.einsum("ij,jk,ik->i", modes, solver @ crossed, modes)
        return self.variances - 2 * np.einsum("ij,ij->i", modes, crossed) + between

    @property
    def _motions(self) -> System | Smoothing:
        return self.smoothing or self.system


def uncertainty(
    scene: Scene,
    found: Facets,
    views: Sequence[View],
    weights: Floats,
    freedom: Freedom,
    systematic: Systematic | None,
    size: float,
    shift: Floats,
    motion: Floats,
) -> Uncertainty:
    """Return how sure a solution is.

    The curvature H₀ = c A, with c the clean share of each facet's curvature A, is that of noiseless gradients; the
    estimate H₀⁻¹ J'W e has the covariance H₀⁻¹ A H₀⁻¹ = (c² A)⁻¹ for independent noise of the variance
    v = sum w r² / (degrees of freedom), and κ times that for residuals that are not. Where the elements do not fit, as
    at a step, residuals count for neither; the nodes there have an uncertainty of their own; see `misfit`. What splines
    miss is looked for with the cameras where they were found: nodes that are free would take cameras, of which the
    pictures tell little, far away with them.

    Parameters
    ----------
    found : what the pictures say about the facets without blur, by `needed_columns` and in the power 2, with each
        facet's camera block where there is a systematic field
    weights : (f,) of the facets
    systematic : the shift of the pictures as stated. What of it looks like a deviation is added; what the pictures show
        of it was found beside unknown cameras and is among the unknowns of the system
    size : px, of the shift as it is, at least as stated; what it is more the solution has taken for something else
    shift : (q,) what was found of it, see `State`
    motion : (k,) mm, the solution
    """
    columns, known = needed_columns(freedom, systematic), None
    if systematic is not None:
        known = shift_of(scene, views, systematic)
        if freedom.unknowns:
            found = without_shift(scene, found, columns, known, shift)
    rows, mixing = scene.space.rows(scene), freedom.spread(columns)[0]
    noise = noise_of(found, weights, rows.shape[1] + freedom.unknowns)
    factors = weights * found.clean**2
    scale, slides = freedom.scale(views, scene.sample), slides_of(scene, freedom, views)
    free, left, before, cameras = scene, found, noise, mixing
    still = held(freedom)
    if scene.space.confined:
        lack = lack_of_fit(scene, found, views, weights, still, columns)
        free, left, before, first = lack.scene, lack.left, lack.noise, lack.system
        cameras = still.spread(columns)[0]
    else:
        first = system_of(scene, found, factors, noise, freedom, columns, scale, slides)
    summed = misfit(free, left, weights / before, first, cameras)
    unknowns = len(scene.nodes) + freedom.unknowns
    noise = noise_of(left, weights * summed.fitted, round(unknowns * summed.fitted.mean()))
    total = noise * summed.correlated
    blocks = None
    if known is not None and freedom.unknowns:
        blocks = shift_blocks(scene, found, columns, mixing, known, factors / total, weights / total)
    motion_factor = None if scene.space.confined else first.motion.times(before / total)
    kept = slides_in_pictures(scene, freedom, views, slides)
    system = system_of(scene, found, factors, total, freedom, columns, scale, slides, 0.0, blocks, motion_factor, kept)
    rough, model = np.zeros(len(scene.nodes)), None
    if scene.space.confined:
        model = model_error(scene, found, views, weights, still, columns, lack, summed, total, motion, system.motion)
    else:
        rough = unresolved(scene, left, total, summed.fitted)
    shifts = left_open(scene, freedom, views)
    if systematic is not None and known is not None:
        looking = np.stack([scene.space.motion(scene, field) for field in known.deviation.T], axis=1)
        shifts = np.hstack([shifts, size / systematic.size * looking])
        if blocks is not None and size > systematic.size:
            response = system.solve(blocks.shape, np.vstack([blocks.cameras, blocks.own]))[0]
            shifts = np.hstack([shifts, np.sqrt((size / systematic.size) ** 2 - 1) * response])
    smoother = scene.space.smoother(scene, weights)
    fitting = float(summed.fitted.mean())
    return Uncertainty(system, shifts, smoother, rough, noise, fitting, summed.correlated, model=model)
