"""The motion in a deviation field that features determine one after the other, as datums do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from inspect3d.arrays import Floats

STIFF = 1e-3  # share of the stiffest motion's stiffness from which on a feature determines a motion


@dataclass(frozen=True, eq=False)
class Level:
    """What one feature says of the motion: the least squares of readings, each a weighted mean of nodes.

    Parameters
    ----------
    readings : (m, n), sparse: from a field at the nodes to the readings; the rows sum to one
    weights : (m,) of the readings
    """

    readings: sparse.csr_matrix
    weights: Floats


def ordered_solver(jacobian: Floats, levels: tuple[Level, ...], basis: Floats) -> tuple[Floats, Floats, list[int]]:
    """Return the solver M (p, n) of the motion M v in a field v (n,), the motions left free, and what each level took.

    Each level fixes the motions it can among those that the levels before it have left, by least squares, and never
    moves what they have fixed: a plane, a second plane and a third fix 3, 2 and 1 motions.

    Parameters
    ----------
    jacobian : J (n, p) of the field, turns and shifts in comparable units
    levels : in order
    basis : (p, q) of the motions that may be made at all, orthonormal columns

    Returns
    -------
    M, the motions (p, r) that no level determines, and how many motions each level has determined
    """
    solver, free, taken = np.zeros((jacobian.shape[1], len(jacobian))), basis, []
    for level in levels:
        rows = level.readings @ jacobian
        stiffest = np.linalg.eigvalsh((rows * level.weights[:, None]).T @ rows)[-1]
        allowed = rows @ free
        values, vectors = np.linalg.eigh((allowed * level.weights[:, None]).T @ allowed)
        stiff = values >= STIFF * stiffest
        inverse = (vectors[:, stiff] / values[stiff]) @ vectors[:, stiff].T
        gain = free @ inverse @ (allowed * level.weights[:, None]).T
        solver = solver + np.asarray(gain @ level.readings) - gain @ (rows @ solver)
        free = free @ vectors[:, ~stiff]
        taken.append(int(np.count_nonzero(stiff)))
    return solver, free, taken
