"""What the tables of a recipe are made of."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator, model_validator


def _pointing(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(vector):
        raise ValueError("a direction is not zero")
    return vector


Text = Annotated[str, Field(min_length=1, max_length=1000, pattern=r"^[^\x00-\x1f\x7f]+$")]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Vector = tuple[float, float, float]
Interval = tuple[float, float]
Direction = Annotated[Vector, AfterValidator(_pointing)]
Row = tuple[float, float, float, float]
Unit = Literal["mm", "cm", "m", "um", "inch"]


def rising(interval: Interval | None) -> Interval | None:
    """Return an interval whose lower value is the lower one.

    Raises
    ------
    ValueError
        It is not.
    """
    if interval is not None and not interval[0] < interval[1]:
        raise ValueError(f"the lower value, {interval[0]:g}, comes first and is below the upper, {interval[1]:g}")
    return interval


class Table(BaseModel):
    """A table whose keys are all known."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Region(Table):
    """A part of the part: an axis-aligned box, mm, or faces of the STEP file by number, with its own tolerance."""

    name: str = ""
    box: tuple[Vector, Vector] | None = None
    faces: Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1)] | None = None
    tolerance: Interval | None = None

    _tolerance = field_validator("tolerance")(rising)

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        if (self.box is None) == (self.faces is None):
            raise ValueError("give either box = [[x, y, z], [x, y, z]] or faces = [...], one of the two")
        if self.box and not all(low < high for low, high in zip(*self.box, strict=True)):
            raise ValueError("the first corner of the box lies below the second in x, y and z")
        return self
