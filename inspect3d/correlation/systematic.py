"""A smooth shift of each picture that no model explains, as it is stated."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from inspect3d.arrays import Floats
from inspect3d.correlation.scene import Scene

LANDMARKS, RANK = 600, 1e-4
PLACES = 1000  # facets that tell how many patches of a shift the part has room for
CHANCE = 0.01  # of a shift of the stated size looking larger


@dataclass(frozen=True)
class Systematic:
    """A smooth shift of each picture that nothing explains, stated rather than estimated.

    Parameters
    ----------
    size : px, standard deviation of each coordinate in each picture
    length : mm over the part, of its Gaussian correlation exp(-d² / 2 L²)
    """

    size: float
    length: float

    def __post_init__(self) -> None:
        if not (self.size > 0 and self.length > 0):
            raise ValueError(
                f"a systematic shift has a size and a length above 0, not {self.size:g} and {self.length:g}"
            )

    def modes(self, scene: Scene) -> tuple[Floats, Floats]:
        """Return Φ (f, r) px of the facets and (n, r) of the nodes, with Φ Φ' the covariance of a coordinate.

        By landmarks among the facets (Nyström); shifts are Φ times independent numbers of the variance one.
        """
        centres = scene.nodes[scene.triangles].mean(axis=1)
        chosen = centres[np.linspace(0, len(centres) - 1, min(LANDMARKS, len(centres))).astype(np.int64)]
        values, vectors = np.linalg.eigh(self._alike(chosen, chosen))
        kept = values > RANK * values[-1]
        roots = self.size * vectors[:, kept] / np.sqrt(values[kept])
        return self._alike(centres, chosen) @ roots, self._alike(scene.nodes, chosen) @ roots

    def at_least(self, found: float, scene: Scene) -> Systematic:
        """Return the shift as it is stated, or of the size that was found where that is beyond chance.

        The mean square of a shift over the part has a spread of its own: that of chi-square over ν degrees of freedom,
        1 / ν being the mean of its squared correlation between two places, of each picture beyond the first.

        Parameters
        ----------
        found : px, see `inspect3d.correlation.disagreement`
        """
        centres = scene.nodes[scene.triangles].mean(axis=1)
        centres = centres[np.linspace(0, len(centres) - 1, min(PLACES, len(centres))).astype(np.int64)]
        patches = (scene.taking.shape[1] - 1) / (self._alike(centres, centres) ** 2).mean()
        usual = found**2 <= self.size**2 * chi2.isf(CHANCE, patches) / patches
        return self if usual else replace(self, size=found)

    def _alike(self, a: Floats, b: Floats) -> Floats:
        squared = ((a[:, None, :] - b[None, :, :]) ** 2).sum(axis=2)
        return np.exp(-squared / (2 * self.length**2))
