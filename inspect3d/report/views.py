"""The few viewpoints that show what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.report.scene import scene
from inspect3d.report.viewpoint import Viewpoint, around

MOST = 4
WORTH = 0.03
"""Share of the observed area that one more picture must show better, or it is not taken."""


@dataclass(frozen=True, eq=False)
class Views:
    """What can be seen of a mesh from 26 viewpoints around it.

    Parameters
    ----------
    viewpoints : k of them
    cosine : (k, n) of the angle between a node's normal and the direction to the eye; 0 where it is hidden
    """

    viewpoints: tuple[Viewpoint, ...]
    cosine: Floats

    @classmethod
    def of(cls, mesh: InspectionMesh) -> Views:
        """Look at the mesh from all around."""
        viewpoints = around()
        cosine = np.zeros((len(viewpoints), len(mesh)))
        with scene(mesh.nodes, mesh.triangles, np.full(len(mesh), np.nan), None, (400, 400)) as window:
            for k, viewpoint in enumerate(viewpoints):
                seen = window.sight(viewpoint).sees(mesh.nodes, mesh.normals)
                cosine[k] = np.where(seen, mesh.normals @ viewpoint.direction, 0.0)
        return cls(viewpoints, cosine)

    def overview(self, areas: Floats) -> Viewpoint:
        """Return the corner of the surrounding cube from which most of the part is seen."""
        seen = (self.cosine @ areas) * [np.count_nonzero(np.abs(view.direction) > 0.1) == 3 for view in self.viewpoints]
        return self.viewpoints[int(seen.argmax())]

    def showing(self, observed: Booleans, areas: Floats, marked: Sequence[int] = ()) -> tuple[Viewpoint, ...]:
        """Return up to four viewpoints that show the observed area best, and further ones for marked nodes left out.

        Where nothing was observed it is the one that shows most of the part.

        A patch counts with its best foreshortening over the pictures taken; each viewpoint in turn is the one that
        adds most (greedy, hence within 1 - 1/e of the best choice: Nemhauser, Wolsey, Fisher, "An analysis of
        approximations for maximizing submodular set functions", 1978).
        """
        most = MOST if areas[observed].sum() > 0 else 1
        weights = np.where(observed, areas, 0.0) if most > 1 else areas
        chosen: list[int] = []
        best = np.zeros(self.cosine.shape[1])
        while len(chosen) < most:
            gain = (np.maximum(self.cosine, best) - best) @ weights
            k = int(gain.argmax())
            if chosen and gain[k] < WORTH * weights.sum():
                break
            chosen.append(k)
            best = np.maximum(best, self.cosine[k])
        missing = {node for node in marked if best[node] == 0}
        while missing:
            nodes = sorted(missing)
            k = int((self.cosine[:, nodes] > 0).sum(axis=1).argmax())
            shown = {node for node in nodes if self.cosine[k, node] > 0}
            if not shown:
                break
            chosen.append(k)
            missing -= shown
        return tuple(self.viewpoints[k] for k in chosen)
