"""The few viewpoints that show what was measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.nominal.nominal import InspectionMesh
from inspect3d.report.colours import ColourScale
from inspect3d.report.detail import Detail
from inspect3d.report.scene import Scene, scene
from inspect3d.report.viewpoint import Viewpoint, around

MOST = 4
ENOUGH, DRAWN = 20_000, 100_000
"""Nodes that are looked at to choose a viewpoint, and that a picture of a million pixels has room for."""
WORTH = 0.03
"""Share of the observed area that one more picture must show better, or it is not taken."""


@dataclass(frozen=True, eq=False)
class Views:
    """What can be seen of a mesh from 26 viewpoints around it.

    Parameters
    ----------
    viewpoints : k of them
    cosine : (k, m) of the angle between a node's normal and the direction to the eye; 0 where it is hidden
    place : (n,) of each node of the mesh, which of the m nodes looked at stands for it
    mesh : what is looked at
    drawn : the nodes that a picture has room for
    """

    viewpoints: tuple[Viewpoint, ...]
    cosine: Floats
    place: Integers
    mesh: InspectionMesh
    drawn: Detail

    @classmethod
    def of(cls, mesh: InspectionMesh) -> Views:
        """Look at the mesh from all around."""
        viewpoints, detail = around(), Detail.of(mesh, most=ENOUGH)
        nodes, normals = mesh.nodes[detail.nodes], mesh.normals[detail.nodes]
        cosine = np.zeros((len(viewpoints), len(nodes)))
        with scene(nodes, detail.triangles, np.full(len(nodes), np.nan), None, (400, 400)) as window:
            for k, viewpoint in enumerate(viewpoints):
                seen = window.sight(viewpoint).sees(nodes, normals)
                cosine[k] = np.where(seen, normals @ viewpoint.direction, 0.0)
        return cls(viewpoints, cosine, detail.place, mesh, Detail.of(mesh, most=DRAWN))

    @contextmanager
    def window(self, values: Floats, scale: ColourScale | None, size: tuple[int, int]) -> Iterator[Scene]:
        """Open a window of so many pixels on the mesh, in the colours of values (n,); NaN is grey."""
        nodes = self.drawn.nodes
        with scene(self.mesh.nodes[nodes], self.drawn.triangles, values[nodes], scale, size) as window:
            yield window

    def overview(self, areas: Floats) -> Viewpoint:
        """Return the corner of the surrounding cube from which most of the given areas (n,) mm² is seen."""
        seen = (self.cosine @ self._gathered(areas)) * [
            np.count_nonzero(np.abs(view.direction) > 0.1) == 3 for view in self.viewpoints
        ]
        return self.viewpoints[int(seen.argmax())]

    def showing(self, observed: Booleans, areas: Floats, marked: Sequence[int] = ()) -> tuple[Viewpoint, ...]:
        """Return up to four viewpoints that show the observed area best, and further ones for marked nodes left out.

        Where nothing was observed it is the one that shows most of the part.

        A patch counts with its best foreshortening over the pictures taken; each viewpoint in turn is the one that
        adds most (greedy, hence within 1 - 1/e of the best choice: Nemhauser, Wolsey, Fisher, "An analysis of
        approximations for maximizing submodular set functions", 1978).
        """
        most = MOST if areas[observed].sum() > 0 else 1
        weights = self._gathered(np.where(observed, areas, 0.0) if most > 1 else areas)
        chosen: list[int] = []
        best = np.zeros(self.cosine.shape[1])
        while len(chosen) < most:
            gain = (np.maximum(self.cosine, best) - best) @ weights
            k = int(gain.argmax())
            if chosen and gain[k] < WORTH * weights.sum():
                break
            chosen.append(k)
            best = np.maximum(best, self.cosine[k])
        missing = {node for node in self.place[list(marked)].tolist() if best[node] == 0}
        while missing:
            nodes = sorted(missing)
            k = int((self.cosine[:, nodes] > 0).sum(axis=1).argmax())
            shown = {node for node in nodes if self.cosine[k, node] > 0}
            if not shown:
                break
            chosen.append(k)
            missing -= shown
        return tuple(self.viewpoints[k] for k in chosen)

    def _gathered(self, areas: Floats) -> Floats:
        """Return the areas (n,) of the nodes of the mesh summed up at the nodes looked at, (m,)."""
        return np.bincount(self.place, areas, minlength=self.cosine.shape[1]).astype(np.float64)
