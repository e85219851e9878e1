"""The table of a recipe that says how a measurement is aligned to the CAD."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import model_validator

from inspect3d.recipe_types import Direction, Region, Row, Table, Vector

if TYPE_CHECKING:
    from inspect3d.pose import Pose


class Landmark(Table):
    """A point of the CAD and the same point as measured, mm; the name is for people."""

    cad: Vector
    measured: Vector
    name: str = ""


class Reference(Table):
    """A point at which the deviation is to be zero, mm, and the direction of the surface's normal there."""

    point: Vector
    direction: Direction


class Start(Table):
    """Where the alignment begins, what it is fitted to, and whether it is refined."""

    start: Literal["auto", "identity", "landmarks", "pose"] = "auto"
    matrix: tuple[Row, Row, Row, Row] | None = None
    landmarks: tuple[Landmark, ...] = ()
    refine: bool = True
    fit: Literal["best", "landmarks", "datum", "rps"] = "best"
    datum: tuple[Region, ...] = ()
    rps: tuple[Reference, ...] = ()
    locked: tuple[Literal["rx", "ry", "rz", "tx", "ty", "tz"], ...] = ()

    @model_validator(mode="after")
    def _complete(self) -> Self:
        from inspect3d.pose import Pose

        if (self.start == "pose") != (self.matrix is not None):
            raise ValueError('start = "pose" and matrix = [4 rows of 4 numbers] belong together')
        if "landmarks" in (self.start, self.fit) and len(self.landmarks) < 3:
            raise ValueError(
                f"an alignment by landmarks needs at least 3 landmarks, and there are {len(self.landmarks)}"
            )
        if self.matrix is not None:
            Pose.from_matrix(np.array(self.matrix))
        return self

    @model_validator(mode="after")
    def _fitted(self) -> Self:
        for kind in ("datum", "rps"):
            if self.fit == kind and not getattr(self, kind):
                raise ValueError(f'fit = "{kind}" needs {kind} = [ {{ ... }} ]')
        if not self.refine and (self.fit in ("datum", "rps") or self.locked):
            raise ValueError("refine = false keeps the start as it is: leave it away, or fit, datum, rps and locked")
        if self.locked and (self.start == "auto" or self.fit == "landmarks"):
            raise ValueError('locked motions stay those of the start: give one, such as start = "identity"')
        if any(region.tolerance for region in self.datum):
            raise ValueError("a datum has no tolerance")
        return self

    @property
    def place(self) -> Pose | None:
        """Return the CAD from the frame of the measurement where the table states it, or None."""
        from inspect3d.pose import Pose

        if self.matrix is not None:
            return Pose.from_matrix(np.array(self.matrix))
        return Pose.identity() if self.start == "identity" else None

    @property
    def refined(self) -> bool:
        """Return whether the map is fitted to the CAD; landmarks alone give the pose otherwise."""
        return self.refine and self.fit != "landmarks"
