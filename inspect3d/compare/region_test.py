"""Which regions of a field differ from zero beyond doubt, all places and sizes considered at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.compare.deviation_region import DeviationRegion
from inspect3d.compare.patches import Patches
from inspect3d.measure import FieldCovariance

ROUNDED = 1e-9  # share of the largest variance that keeps a covariance of which motions were taken out positive
HALF = 0.5  # share of a region's height at which it ends


@dataclass(frozen=True)
class RegionTest:
    """Look for regions with windows of several widths around every node.

    The mean over each window is divided by its standard uncertainty from the whole covariance of the field, neighbours'
    correlation included. The largest of these over all windows is compared with the largest in fields drawn from that
    covariance: a field without any deviation shows a region with the stated probability only. Windows beyond the limit
    that lie beside each other are one region, the clearest first; its deviation is then taken out of the field, so that
    a window far away that reaches into it finds no region of its own. A region ends where the deviation, in the
    narrowest windows that show it, falls to half its height.

    Parameters
    ----------
    probability : of finding a region anywhere on the part where there is none
    widths : of the Gaussian windows, in distances of the nodes; 0: the node alone
    draws : fields drawn
    most_regions : where the search ends
    most : nodes above which they are gathered into so many patches
    seed : of the draws

    Notes
    -----
    Single-step maxT: P. H. Westfall, S. S. Young, "Resampling-Based Multiple Testing", Wiley 1993, 2.3. Windows of
    several widths: K. J. Worsley et al., "Searching scale space for activation in PET images", Human Brain Mapping 4
    (1996).
    """

    probability: float = 0.05
    widths: tuple[float, ...] = (0.0, 1.0, 2.0, 4.0)
    draws: int = 1000
    most_regions: int = 50
    most: int = 2000
    seed: int = 0

    def __call__(
        self,
        values: Floats,
        covariance: FieldCovariance,
        nodes: Floats,
        normals: Floats,
        areas: Floats,
        explained: Floats | None = None,
    ) -> tuple[DeviationRegion, ...]:
        """Return the regions of a field, the clearest first; their nodes are numbered as in the field.

        Parameters
        ----------
        values : (k,) mm
        covariance : of the values
        nodes, normals : (k, 3) mm and unit
        areas : (k,) mm²
        explained : (k,) mm, by how much each value may differ from zero, up or down, for a reason that is known; what
            is beyond counts
        """
        patches = Patches.of(nodes, normals, areas, self.most)
        whole = patches.covariance(covariance)
        factor = linalg.cholesky(whole + ROUNDED * whole.diagonal().max() * np.eye(len(whole)), lower=True)
        drawn = factor @ np.random.default_rng(self.seed).normal(size=(len(whole), self.draws))
        beyond = values if explained is None else np.sign(values) * np.maximum(np.abs(values) - explained, 0.0)
        trust, field = patches.areas / whole.diagonal(), patches.means @ beyond
        windows = [patches.windows(width * patches.spacing, trust) for width in self.widths]
        sigmas = [np.sqrt(np.asarray(w.multiply(w @ whole).sum(axis=1)).ravel()) for w in windows]
        chance = np.max(
            [np.abs((w @ drawn) / sigma[:, None]).max(axis=0) for w, sigma in zip(windows, sigmas, strict=True)], axis=0
        )
        limit = float(np.quantile(chance, 1 - self.probability, method="higher"))
        beside = patches.windows(patches.spacing, trust)
        found: list[DeviationRegion] = []
        for _ in range(self.most_regions):
            smooth = np.array([w @ field for w in windows])
            scores = smooth / np.array(sigmas)
            width, peak = np.unravel_index(np.abs(scores).argmax(), scores.shape)
            if abs(scores[width, peak]) <= limit:
                break
            sign = np.sign(scores[width, peak])
            part = _around(int(peak), (sign * scores).max(axis=0) > limit, beside)
            narrowest = sign * smooth[int(np.argmax((sign * scores[:, part] > limit).any(axis=1)))]
            core = part & (narrowest >= HALF * narrowest[part].max())
            p_value = (1 + np.count_nonzero(chance >= abs(scores[width, peak]))) / (1 + self.draws)
            at = np.flatnonzero(core[patches.patch])
            found.append(region_of(at, values, covariance, nodes, areas, float(p_value)))
            field = np.where(part, 0.0, field)
        return tuple(found)


def region_of(
    at: Integers, values: Floats, covariance: FieldCovariance, nodes: Floats, areas: Floats, p_value: float | None
) -> DeviationRegion:
    """Return the region of the nodes `at` of a field."""
    share = np.zeros(len(values))
    share[at] = areas[at] / areas[at].sum()
    variance = float(share @ covariance.covariance(share[:, None])[:, 0])
    return DeviationRegion(
        nodes=at,
        area=float(areas[at].sum()),
        place=share @ nodes,
        height=float(values[at][np.abs(values[at]).argmax()]),
        mean=float(share @ values),
        sigma=float(np.sqrt(max(variance, np.finfo(float).tiny))),
        p_value=p_value,
    )


def _around(peak: int, beyond: Booleans, beside: sparse.csr_matrix) -> Booleans:
    """Return the connected part, with `peak` in it, of the patches `beyond` (m,) the limit."""
    at = np.flatnonzero(beyond)
    _, label = sparse.csgraph.connected_components(beside[at][:, at], directed=False)
    part = np.zeros(len(beyond), bool)
    part[at[label == label[np.searchsorted(at, peak)]]] = True
    return part
