"""From the NURBS faces of a part to the motions of an inspection mesh that their control points allow."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats, Integers, unit
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.spline_space import SplineSpace, sample_points
from inspect3d.nominal.brep import Brep
from inspect3d.nominal.nominal import Nominal
from inspect3d.nominal.nurbs import Nurbs
from inspect3d.nominal.nurbs_face import nurbs_of
from inspect3d.outcome import InputError, MeasurementError

ENOUGH = 1.5  # nodes for each control point, at the least
NEAR = 1e-4  # mm; the next step would be far shorter
FAR = 10.0  # times the median distance from the surface


@dataclass(frozen=True)
class Splines:
    """Which faces move as NURBS surfaces, and how finely.

    Parameters
    ----------
    faces : their numbers; none: those that the cameras see
    refine : how often every span between two knots is halved
    degree : to which the surfaces are raised at least; 0: as in the CAD
    """

    faces: tuple[int, ...] = ()
    refine: int = 0
    degree: int = 0

    def __call__(self, nominal: Nominal, seen: Scene) -> Scene:
        """Return those facets of a scene that lie on the chosen faces, their nodes moved by control points.

        Raises
        ------
        MeasurementError
            The model has no exact faces, the cameras see none of those that are named, a face cannot be converted, or
            the mesh is too coarse to tell its control points apart.
        """
        brep = nominal.exact
        if not isinstance(brep, Brep) or nominal.surface_face is None:
            raise MeasurementError(
                "Isogeometric stereocorrelation moves the control points of exact faces, and this CAD model is a mesh "
                'without any: give the STEP or IGES file, or measure with method = "stereocorrelation".'
            )
        centres = seen.nodes[seen.triangles].mean(axis=1)
        face = nominal.surface_face[nominal.surface.closest(centres).triangle]
        patches = self._patches(brep, seen, face)
        kept = np.isin(face, list(patches))
        rest, _ = seen.restricted(kept)
        return replace(rest, space=_Attached(rest, patches, face[kept]).space)

    def _patches(self, brep: Brep, seen: Scene, face: Integers) -> dict[int, Nurbs]:
        """Return the chosen faces by number, those of a choice by itself only where the mesh is fine enough."""
        shown = set(np.unique(face).tolist())
        if beyond := [number for number in self.faces if not 1 <= number <= len(brep.faces)]:
            raise MeasurementError(f"There is no face {beyond[0]}: the model has faces 1 to {len(brep.faces)}.")
        if unseen := [number for number in self.faces if number not in shown]:
            seen_ones = ", ".join(map(str, sorted(shown)[:20]))
            raise MeasurementError(
                f"No two cameras see face {unseen[0]}: take it out of `faces` (they see {seen_ones})."
            )
        found = {}
        for number in self.faces or sorted(shown):
            try:
                patch = nurbs_of(brep, number, self.refine, self.degree)
            except InputError as error:
                if self.faces:
                    raise MeasurementError(str(error)) from error
                continue
            nodes = np.unique(seen.triangles[face == number])
            functions = np.unique(patch.functions(patch.parameters(seen.nodes[nodes])).indices)
            if len(nodes) >= ENOUGH * len(functions):
                found[number] = patch
            elif self.faces:
                raise MeasurementError(_too_coarse(number, len(functions), len(nodes)))
        if not found:
            raise MeasurementError(
                "None of the faces that two cameras see has enough nodes of the inspection mesh to tell its control "
                'points apart: set element_size lower, or measure with method = "stereocorrelation".'
            )
        return found


def _too_coarse(number: int, functions: int, nodes: int) -> str:
    return (
        f"The mesh is too coarse for face {number}: {functions} of its control points move the {nodes} nodes that two "
        "cameras see. Set element_size or `refine` lower."
    )


@dataclass(frozen=True, eq=False)
class _Attached:
    """A scene whose facets lie on NURBS patches.

    Parameters
    ----------
    patches : by the number of their face
    face : (f,), of each facet of the scene
    """

    scene: Scene
    patches: dict[int, Nurbs]
    face: Integers

    @property
    def space(self) -> SplineSpace:
        """Return the motions of the nodes that the control points allow."""
        scene, shapes = self.scene, sample_points()
        total = sum(patch.size for patch in self.patches.values())
        samples = np.einsum("si,fid->fsd", shapes, scene.nodes[scene.triangles])
        normals = unit(np.einsum("si,fid->fsd", shapes, scene.normals[scene.triangles]))
        of_nodes, of_samples = [], []
        order_of_nodes, order_of_facets = [], []
        first = 0
        for number, patch in self.patches.items():
            facets = np.flatnonzero(self.face == number)
            nodes, corners = np.unique(scene.triangles[facets], return_inverse=True)
            uv = patch.parameters(scene.nodes[nodes])
            own = np.flatnonzero(self._node_face[nodes] == number)
            of_nodes.append(_rows(patch, uv[own], scene.normals[nodes[own]], first, total))
            order_of_nodes.append(nodes[own])
            guess = np.einsum("si,fid->fsd", shapes, uv[corners.reshape(-1, 3)]).reshape(-1, 2)
            uv = _near(patch, samples[facets].reshape(-1, 3), guess)
            of_samples.append(_rows(patch, uv, normals[facets].reshape(-1, 3), first, total))
            order_of_facets.append(facets)
            first += patch.size
        return SplineSpace(
            _sorted(of_nodes, order_of_nodes, 1),
            _sorted(of_samples, order_of_facets, len(shapes)),
            tuple(self.patches.values()),
        )

    @cached_property
    def _node_face(self) -> Integers:
        """Return the face of each node, (n,), of those around it the one of the lowest number."""
        face = np.full(len(self.scene.nodes), np.iinfo(np.int64).max)
        np.minimum.at(face, self.scene.triangles.ravel(), np.repeat(self.face, 3))
        return face


def _sorted(blocks: list[sparse.csr_matrix], orders: list[Integers], each: int) -> sparse.csr_matrix:
    """Return blocks, with `each` rows for every number in their orders, as one matrix in the order of the numbers."""
    if len(blocks) == 1:
        return blocks[0]
    order = np.argsort(np.concatenate(orders))
    return sparse.vstack(blocks, format="csr")[(order[:, None] * each + np.arange(each)).ravel()]


def _near(patch: Nurbs, points: Floats, guess: Floats) -> Floats:
    """Return the parameters (p, 2) of points (p, 3) mm near the surface, from a guess that seams may have spoilt."""
    uv = patch.descended(points, guess, NEAR)
    low, high = patch.bounds
    away = np.linalg.norm(patch.points(uv) - points, axis=1)
    doubted = ((uv <= low) | (uv >= high)).any(axis=1) | (away > FAR * np.median(away))
    uv[doubted] = patch.parameters(points[doubted])
    return uv


def _rows(patch: Nurbs, uv: Floats, normals: Floats, first: int, total: int) -> sparse.csr_matrix:
    """Return how far each control point's motion along its normal moves places (p,) along theirs, (p, total).

    Parameters
    ----------
    first : column of the patch's first control point
    """
    rows = patch.along(uv, normals)
    return sparse.csr_matrix((rows.data, rows.indices + first, rows.indptr), shape=(len(uv), total))
