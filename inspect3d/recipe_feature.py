"""The table of a recipe that asks for a feature of the deviation in a marked place."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator

from inspect3d.recipe_types import Direction, Positive, Region, Table, Text, Vector


class Feature(Table):
    """A mismatch step, a waviness or scallops to be measured in a marked place.

    A step needs a `point` of the joint; waviness and scallops need a `wavelength`, mm, and a step may have one, of the
    waves around it that are not the step's. `across` is the direction across the joint, the waves or the scallops.
    """

    name: Text
    kind: Literal["step", "waviness", "scallops"]
    place: Region
    across: Direction
    point: Vector | None = None
    wavelength: Positive | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if (self.kind == "step") != (self.point is not None):
            raise ValueError('a step needs point = [x, y, z] on the joint, and only kind = "step" does')
        if self.kind != "step" and self.wavelength is None:
            raise ValueError(f"{self.kind} need a wavelength, mm")
        if self.place.tolerance:
            raise ValueError("the place of a feature has no tolerance")
        return self
