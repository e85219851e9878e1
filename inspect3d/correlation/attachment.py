"""How the control points of NURBS faces move the nodes and facets of an inspection mesh that lie on them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats, Integers, unit
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.spline_space import SplineSpace, sample_points
from inspect3d.nominal.nominal import Nominal
from inspect3d.nominal.nurbs import Nurbs

NEAR = 1e-4  # mm; the next step would be far shorter
FAR = 10.0  # times the median distance from the surface
BACKED = 0.2  # share of the evaluation points around a node that lie on the face that owns it, at the least
UPRIGHT = 0.3  # cosine of the angle between the normals of a face and of a node on it, at the least


@dataclass(frozen=True, eq=False)
class Attachment:
    """A scene whose facets lie on NURBS patches, some of them across a border.

    Parameters
    ----------
    patches : by the number of their face
    face : (f,), of the middle of each facet of the scene
    ways : in which each control point moves, see `Nurbs.along`
    """

    nominal: Nominal
    scene: Scene
    patches: dict[int, Nurbs]
    face: Integers
    ways: int = 1

    @property
    def space(self) -> SplineSpace:
        """Return the motions of the nodes that the control points allow; zero for nodes that they do not move."""
        scene, shapes = self.scene, sample_points()
        total = self.ways * sum(patch.size for patch in self.patches.values())
        normals = unit(np.einsum("si,fid->fsd", shapes, scene.normals[scene.triangles]))
        of_nodes, of_samples = [], []
        node_order, sample_order = [], []
        first = 0
        for number, patch in self.patches.items():
            facets, there = np.nonzero(self._sample_face == number)
            nodes = np.unique(np.append(scene.triangles[facets], np.flatnonzero(self._node_face == number)))
            uv = patch.parameters(scene.nodes[nodes])
            corners = uv[np.searchsorted(nodes, scene.triangles[facets])]
            guess = (shapes[there, :, None] * corners).sum(axis=1)
            near = _near(patch, self._samples[facets, there], guess)
            of_samples.append(_rows(patch, *near, normals[facets, there], first, total, self.ways))
            sample_order.append(facets * len(shapes) + there)
            own = self._node_face[nodes] == number
            places = uv[own], patch.normals(uv[own])
            of_nodes.append(_rows(patch, *places, scene.normals[nodes[own]], first, total, self.ways))
            node_order.append(nodes[own])
            first += self.ways * patch.size
        return SplineSpace(
            _sorted(of_nodes, node_order), _sorted(of_samples, sample_order), tuple(self.patches.values()), self.ways
        )

    @cached_property
    def _samples(self) -> Floats:
        """Return the sample points (f, 16, 3) mm."""
        return np.einsum("si,fid->fsd", sample_points(), self.scene.nodes[self.scene.triangles])

    @cached_property
    def _owner(self) -> Integers:
        """Return the face that owns each node, (n,)."""
        return self.nominal.mesh.face[self.scene.node]

    @cached_property
    def _sample_face(self) -> Integers:
        """Return the face of each sample point, (f, 16), of those that move; that of the facet where it is on none."""
        face = np.repeat(self.face[:, None], len(sample_points()), axis=1)
        across = (self._owner[self.scene.triangles] != self.face[:, None]).any(axis=1)
        assert self.nominal.surface_face is not None
        feet = self.nominal.surface.closest(self._samples[across].reshape(-1, 3))
        found = self.nominal.surface_face[feet.triangle].reshape(-1, face.shape[1])
        face[across] = np.where(np.isin(found, list(self.patches)), found, face[across])
        return face

    @cached_property
    def _node_face(self) -> Integers:
        """Return the face of each node, (n,): its owner if enough points around it lie there, else where most do."""
        counts = np.diff(self.scene.points.starts)
        numbers = np.sort(list(self.patches))
        votes = np.zeros((len(self.scene.nodes), len(numbers)))
        for corner, nearest in enumerate(sample_points().argmax(axis=0)):
            chosen = np.searchsorted(numbers, self._sample_face[:, nearest])
            np.add.at(votes, (self.scene.triangles[:, corner], chosen), counts)
        own = np.where(numbers == self._owner[:, None], votes, 0.0).max(axis=1)
        return np.where(own > BACKED * votes.sum(axis=1), self._owner, numbers[votes.argmax(axis=1)])


def _sorted(blocks: list[sparse.csr_matrix], orders: list[Integers]) -> sparse.csr_matrix:
    """Return blocks, with a row for every number in their orders, as one matrix in the order of the numbers."""
    if len(blocks) == 1:
        return blocks[0]
    return sparse.vstack(blocks, format="csr")[np.argsort(np.concatenate(orders))]


def _near(patch: Nurbs, points: Floats, guess: Floats) -> tuple[Floats, Floats]:
    """Return the parameters (p, 2) of points (p, 3) mm near the surface, and the normals of the surface there, (p, 3).

    Parameters
    ----------
    guess : (p, 2), which seams may have spoilt
    """
    uv = patch.descended(points, guess, NEAR)
    low, high = patch.bounds
    places, *tangents = patch.tangents(uv)
    normals = patch.normals(uv, (tangents[0], tangents[1]))
    away = np.linalg.norm(places - points, axis=1)
    usual = np.median(away) if len(away) else 0.0  # none: of this face no facet is seen whole
    doubted = ((uv <= low) | (uv >= high)).any(axis=1) | (away > FAR * usual)
    uv[doubted] = patch.parameters(points[doubted])
    normals[doubted] = patch.normals(uv[doubted])
    return uv, normals


def _rows(
    patch: Nurbs, uv: Floats, normals: Floats, towards: Floats, first: int, total: int, ways: int
) -> sparse.csr_matrix:
    """Return how far places (p,) move along directions to follow each control point's motion, (p, total).

    The surface moves by v . n along its normal n where the control points move it by v; along a direction m that leans,
    as round a sharp edge, it is met after (v . n) / (m . n). What leans too far is not moved.

    Parameters
    ----------
    normals, towards : n and m, (p, 3), unit
    first : column of the patch's first control point
    """
    upright = (normals * towards).sum(axis=1)
    shares = np.divide(1.0, upright, out=np.zeros(len(uv)), where=upright > UPRIGHT)
    rows = patch.along(uv, normals * shares[:, None], ways)
    if rows.shape[1] == total:
        return rows
    return sparse.csr_matrix((rows.data, rows.indices + first, rows.indptr), shape=(len(uv), total))
