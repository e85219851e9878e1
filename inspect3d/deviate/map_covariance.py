"""How the errors of a map hang together: what a comparison needs to bring two of them into one alignment."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from inspect3d.arrays import Floats, Integers, floats, integers
from inspect3d.measure import FieldCovariance


@dataclass(frozen=True, eq=False)
class Independent:
    """The covariance of k values whose errors have nothing to do with one another.

    Parameters
    ----------
    variances : (k,) mm²
    """

    variances: Floats

    def covariance(self, columns: Floats) -> Floats:
        """Return it times columns (k, m)."""
        return self.variances[:, None] * columns


@dataclass(frozen=True, eq=False)
class Selected:
    """The covariance of some of the nodes of a field.

    Parameters
    ----------
    whole : of all its nodes
    rows : (m,) the places of the chosen ones among them
    """

    whole: FieldCovariance
    rows: Integers

    @property
    def variances(self) -> Floats:
        """Return the diagonal, (m,) mm²."""
        return self.whole.variances[self.rows]

    def covariance(self, columns: Floats) -> Floats:
        """Return it times columns (m, k)."""
        spread = np.zeros((len(self.whole.variances), columns.shape[1]))
        spread[self.rows] = columns
        return self.whole.covariance(spread)[self.rows]


@dataclass(frozen=True, eq=False)
class MapCovariance:
    """The covariance of a map before any motion was taken out of it, by where it comes from.

    The chord of the tessellation is left out: it is an error of the model, and the same for every method.

    Parameters
    ----------
    node : (k,) numbers of the observed nodes, rising
    own : of the method's own errors at those nodes
    pose : (k, p) mm, errors that a given pose makes in all nodes at once, one column for each independent one
    coating : thickness of the paint and its standard uncertainty, mm; the error is one for all nodes
    calibration : mm, standard uncertainty that all nodes share
    refined : whether the map was fitted to the CAD, so that its rigid motion means nothing
    scale_known : False where the method cannot tell a larger part from a smaller one
    weak : (k, w) what the motions of cameras and shape that the method hardly tells do to the map, a column each, of
        any size; their errors are in `own`
    """

    node: Integers
    own: FieldCovariance
    pose: Floats
    coating: tuple[float, float] = (0.0, 0.0)
    calibration: float = 0.0
    refined: bool = True
    scale_known: bool = True
    weak: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        node = integers(self.node, "node", None)
        object.__setattr__(self, "node", node)
        object.__setattr__(self, "pose", floats(self.pose, "pose", len(node), None))
        weak = self.weak if self.weak.size else np.zeros((len(node), 0))
        object.__setattr__(self, "weak", floats(weak, "weak", len(node), None))


def pose_errors(rows: Floats, covariance: Floats) -> Floats:
    """Return the columns (k, p) with J C J' as the sum of their squares, for J = `rows` (k, 6) and C (6, 6)."""
    values, vectors = np.linalg.eigh(covariance)
    kept = values > 0
    return rows @ (vectors[:, kept] * np.sqrt(values[kept]))


def variances_without(field: FieldCovariance, modes: Floats, solver: Floats) -> Floats:
    """Return the diagonal of (I - J M) S (I - J M)' J = `modes` (k, q), M = `solver` (q, k), mm²."""
    crossed = field.covariance(np.ascontiguousarray(solver.T))
    between = np.einsum("ij,jk,ik->i", modes, solver @ crossed, modes)
    found = field.variances - 2 * np.einsum("ij,ij->i", modes, crossed) + between
    return np.maximum(found, np.finfo(float).tiny)
