"""From the NURBS faces of a part to the motions of an inspection mesh that their control points allow."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats, Integers
from inspect3d.correlation.attachment import Attachment
from inspect3d.correlation.continuity import joints, kept_together
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.spline_space import SplineSpace
from inspect3d.nominal.brep import Brep
from inspect3d.nominal.nominal import Nominal
from inspect3d.nominal.nurbs import Nurbs
from inspect3d.nominal.nurbs_face import nurbs_of
from inspect3d.outcome import InputError, MeasurementError

RIDGE, TELLING = 1e-9, 0.01
ENOUGH = 1.5  # nodes for each control point, at the least


@dataclass(frozen=True)
class Splines:
    """Which faces move as NURBS surfaces, and how finely.

    Parameters
    ----------
    faces : their numbers; none: those that the cameras see
    refine : how often every span between two knots is halved
    degree : to which the surfaces are raised at least; 0: as in the CAD
    ways : in which each control point moves: 1, along its normal; 3, in all directions, of which only those count that
        move the surface otherwise than normal motions do
    continuity : degrees between neighbouring faces, below which they keep together; see `joints`; 0: they never do
    """

    faces: tuple[int, ...] = ()
    refine: int = 0
    degree: int = 0
    ways: int = 1
    continuity: float = 45.0

    def __call__(self, nominal: Nominal, seen: Scene) -> Scene:
        """Return those facets of a scene that lie on the chosen faces, their nodes moved by control points.

        Raises
        ------
        MeasurementError
            The model has no exact faces, the cameras see none of those that are named, a face cannot be converted, or
            the mesh is too coarse to tell its control points apart.
        """
        brep, of_surface = exact_faces(nominal)
        centres = seen.nodes[seen.triangles].mean(axis=1)
        face = of_surface[nominal.surface.closest(centres).triangle]
        patches = self._patches(brep, seen, face)
        kept = np.isin(face, list(patches)) & seen.whole[seen.triangles].all(axis=1)
        rest, _ = seen.restricted(kept)
        face = face[kept]
        rest = replace(rest, space=Attachment(nominal, rest, patches, face, self.ways).space)
        moved = np.asarray(abs(rest.space.rows(rest)).sum(axis=1)).ravel() > 0
        if not moved.all():  # corners round a sharp edge, which the face does not move
            kept = np.asarray(moved[rest.triangles].all(axis=1))
            rest, face = rest.restricted(kept)[0], face[kept]
        return self._joined(brep, patches, rest, face)

    def _joined(self, brep: Brep, patches: dict[int, Nurbs], apart: Scene, face: Integers) -> Scene:
        """Return a scene in which neighbouring faces keep together; `face` (f,) is that of each facet."""
        space = apart.space
        assert isinstance(space, SplineSpace)
        rows, shifts = joints(brep, patches, apart, face, self.continuity, self.ways)
        if self.ways > 1:
            free = telling(space.nodes, self.ways)
            space, rows = space.within(free), rows @ free
        if len(rows):
            joined = space.within(kept_together(rows, shifts, space.rows(apart), apart))
            space = replace(joined, apart=space)
        return replace(apart, space=space)

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


def exact_faces(nominal: Nominal) -> tuple[Brep, Integers]:
    """Return the exact part, and the face of each triangle of the nominal surface (m,).

    Raises
    ------
    MeasurementError
        The model has no exact faces.
    """
    if not isinstance(nominal.exact, Brep) or nominal.surface_face is None:
        raise MeasurementError(
            "Isogeometric stereocorrelation moves the control points of exact faces, and this CAD model is a mesh "
            'without any: give the STEP or IGES file, or measure with method = "stereocorrelation".'
        )
    return nominal.exact, nominal.surface_face


def telling(nodes: sparse.csr_matrix, ways: int) -> Floats:
    """Return motions (c, k) of the control points, orthonormal: all normal ones, and tangential ones that tell.

    Tangential motions mostly slide the surface in itself. Of what normal motions do not do as well, those count that
    move the nodes by a hundredth of what a normal motion does, or more.

    Parameters
    ----------
    nodes : (n, c), how control points move the nodes, `ways` columns for each, its normal first
    """
    along = np.arange(nodes.shape[1]) % ways == 0
    normal, sliding = nodes[:, along], nodes[:, ~along]
    square = (normal.T @ normal).toarray()
    typical = float(np.median(np.diag(square)))
    across = (normal.T @ sliding).toarray()
    square += RIDGE * typical * np.eye(len(square))
    values, modes = np.linalg.eigh((sliding.T @ sliding).toarray() - across.T @ np.linalg.solve(square, across))
    kept = values > TELLING**2 * typical
    free = np.zeros((nodes.shape[1], len(square) + np.count_nonzero(kept)))
    free[along, : len(square)] = np.eye(len(square))
    free[~along, len(square) :] = modes[:, kept]
    return free
