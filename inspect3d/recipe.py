"""The recipe of an inspection: a TOML file, checked before anything is measured."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Vector = tuple[float, float, float]
Interval = tuple[float, float]
Unit = Literal["mm", "cm", "m", "um", "inch"]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Region(_Table):
    """A part of the part: an axis-aligned box, or faces of the STEP file by number, with its own tolerance."""

    name: str = ""
    box: tuple[Vector, Vector] | None = None
    faces: tuple[int, ...] | None = None
    tolerance: Interval | None = None


class Part(_Table):
    """The part as designed, and what it must keep to."""

    name: str
    cad: str
    units: Unit = "mm"
    element_size: Annotated[float, Field(gt=0)] | None = None
    tolerance: Interval | None = None
    probability: Annotated[float, Field(gt=0.5, lt=1)] = 0.95
    flip: bool = False
    regions: tuple[Region, ...] = ()
    exclude: tuple[Region, ...] = ()


class Coating(_Table):
    """Paint on the part when it was measured, mm."""

    thickness: float
    sigma: Annotated[float, Field(ge=0)] = 0.0


class Landmark(_Table):
    """A point of the CAD and the same point as measured, mm."""

    cad: Vector
    measured: Vector


class Start(_Table):
    """Where the alignment begins, and whether it is refined."""

    start: Literal["auto", "identity", "landmarks", "pose"] = "auto"
    matrix: Any = None
    landmarks: tuple[Landmark, ...] = ()
    refine: bool = True


class MeasurementTable(BaseModel):
    """What every method shares; the other keys are the plugin's files and settings."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: str
    method: str
    reach: Annotated[float, Field(gt=0)] | None = None
    coating: Coating | None = None
    alignment: Start = Start()


class Section(_Table):
    """A cutting plane."""

    point: Vector
    normal: Vector


class Label(_Table):
    """A named point whose deviation is flagged in the pictures."""

    name: str
    point: Vector


class Budget(_Table):
    """What else adds to the uncertainty: temperature of the part, its expansion, the instrument's calibration."""

    temperature: float = 20.0
    expansion: float = 0.0
    calibration: Annotated[float, Field(ge=0)] = 0.0


class Report(_Table):
    """What the report shows."""

    formats: tuple[Literal["html", "pdf"], ...] = ("html",)
    limits: Interval | None = None
    sections: tuple[Section, ...] = ()
    labels: tuple[Label, ...] = ()
    budget: Budget = Budget()


class Recipe(_Table):
    """A whole recipe; the names are a contract with other programs."""

    schema_: Annotated[Literal[1], Field(alias="schema")]
    part: Part
    measurements: Annotated[tuple[MeasurementTable, ...], Field(min_length=1)]
    report: Report = Report()
