"""The recipe of an inspection: a TOML file, checked before anything is measured."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError, field_validator, model_validator

from inspect3d.complaint import complaint
from inspect3d.file_name import file_name
from inspect3d.measure import Files
from inspect3d.outcome import InputError
from inspect3d.readable import pictures_in, readable
from inspect3d.recipe_alignment import Start
from inspect3d.recipe_feature import Feature
from inspect3d.recipe_types import (
    Direction,
    Interval,
    NotNegative,
    Positive,
    Region,
    Table,
    Text,
    Unit,
    Vector,
    rising,
)

FILE_KEYS = ("files", "images", "masks", "cameras")
"""The keys of a measurement that name files: one, or a list of them."""

BREP_SUFFIXES = (".step", ".stp", ".iges", ".igs")


class Part(Table):
    """The part as designed, and what it must keep to."""

    name: Text
    cad: Text
    units: Unit = "mm"
    element_size: Positive | None = None
    tolerance: Interval | None = None
    probability: Annotated[float, Field(gt=0.5, lt=1)] = 0.95
    flip: bool = False
    regions: tuple[Region, ...] = ()
    exclude: tuple[Region, ...] = ()
    features: tuple[Feature, ...] = ()

    _tolerance = field_validator("tolerance")(rising)

    @model_validator(mode="after")
    def _of_this_model(self) -> Self:
        brep = self.cad.lower().endswith(BREP_SUFFIXES)
        if brep and self.units != "mm":
            raise ValueError(f"units = {self.units!r} is for mesh files; {self.cad} carries its own: remove the key")
        if not brep and any(region.faces for region in self.regions + self.exclude + self._places):
            raise ValueError(f"regions by faces need a STEP or IGES file, and {self.cad} is a mesh: use boxes")
        if any(region.tolerance for region in self.exclude):
            raise ValueError("what exclude names has no tolerance")
        return self

    @property
    def _places(self) -> tuple[Region, ...]:
        return tuple(feature.place for feature in self.features)


class Coating(Table):
    """Paint on the part when it was measured, mm."""

    thickness: NotNegative
    sigma: NotNegative = 0.0


class MeasurementTable(BaseModel):
    """What every method shares; the other keys are the plugin's files and settings."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    name: str
    method: Text
    reach: Positive | None = None
    coating: Coating | None = None
    alignment: Start = Start()

    _name = field_validator("name")(file_name)

    @model_validator(mode="before")
    @classmethod
    def _landmarks_of_a_cloud(cls, data: Any) -> Any:
        """Take `landmarks` with a `measured` point into the alignment: those with `pixels` are the plugin's."""
        landmarks = data.get("landmarks") if isinstance(data, dict) else None
        of_cloud = isinstance(landmarks, list | tuple) and any(
            isinstance(point, dict) and "measured" in point for point in landmarks
        )
        if not (of_cloud and isinstance(data.get("alignment", {}), dict)):
            return data
        alignment = {"landmarks": landmarks, **data.get("alignment", {})}
        return {**{key: value for key, value in data.items() if key != "landmarks"}, "alignment": alignment}

    @model_validator(mode="after")
    def _files_have_names(self) -> Self:
        for key in FILE_KEYS:
            self.listed(key)
        return self

    @property
    def settings(self) -> dict[str, Any]:
        """Return the keys that are the method's own."""
        return {key: value for key, value in (self.model_extra or {}).items() if key not in FILE_KEYS}

    def listed(self, key: str) -> tuple[str, ...]:
        """Return the names of the files under a key as the recipe writes them; empty where there is no such key."""
        value = (self.model_extra or {}).get(key, ())
        names = tuple(value) if isinstance(value, list | tuple) else (value,)
        if not all(isinstance(name, str) and name for name in names):
            raise ValueError(f"{key} wants the name of a file in quotes, or a list of names")
        return names


class Section(Table):
    """A cutting plane."""

    point: Vector
    normal: Direction


class Label(Table):
    """A named point whose deviation is flagged in the pictures."""

    name: Text
    point: Vector


class Budget(Table):
    """What else adds to the uncertainty: temperature of the part, its expansion, the instrument's calibration."""

    temperature: float = 20.0
    expansion: float = 0.0
    calibration: NotNegative = 0.0


class Report(Table):
    """What the report shows."""

    formats: tuple[Literal["html", "pdf"], ...] = ("html",)
    limits: Interval | None = None
    sections: tuple[Section, ...] = ()
    labels: tuple[Label, ...] = ()
    budget: Budget = Budget()

    _limits = field_validator("limits")(rising)


class Recipe(Table):
    """A whole recipe; the names are a contract with other programs."""

    schema_: Annotated[Literal[1], Field(alias="schema")]
    part: Part
    measurements: Annotated[tuple[MeasurementTable, ...], Field(min_length=1)]
    report: Report = Report()
    _source: Path = PrivateAttr(default=Path("recipe.toml"))

    def model_post_init(self, context: Any, /) -> None:
        """Keep where the recipe was read from, which pydantic hands over as `context`."""
        if context is not None:
            self._source = context

    @field_validator("measurements")
    @classmethod
    def _different_files(cls, tables: tuple[MeasurementTable, ...]) -> tuple[MeasurementTable, ...]:
        taken: dict[str, str] = {}
        for table in tables:
            for file in (table.name, f"{table.name}_points"):
                other = taken.setdefault(file.casefold(), table.name)
                if other is not table.name:
                    raise ValueError(f"{other!r} and {table.name!r} would write the same files: rename one")
        return tables

    @property
    def source(self) -> Path:
        """Return the recipe's own file."""
        return self._source

    @property
    def folder(self) -> Path:
        """Return where relative paths start."""
        return self._source.parent

    @property
    def cad(self) -> Path:
        """Return the CAD file."""
        return readable(self.folder / self.part.cad, "part.cad")

    def files(self, table: MeasurementTable) -> Files:
        """Return the files one of the measurements names, all of them readable; `images` may name a folder of pictures.

        Raises
        ------
        InputError
            One is missing, is a folder, or may not be read.
        """
        paths = {
            key: tuple(
                readable(path, f"measurements[{table.name!r}].{key}")
                for name in names
                for path in (pictures_in(self.folder / name) if key == "images" else (self.folder / name,))
            )
            for key in FILE_KEYS
            if (names := table.listed(key))
        }
        return Files(self.folder, paths)


def load_recipe(path: Path) -> Recipe:
    """Return the recipe of a TOML file, with all files it names readable.

    Raises
    ------
    InputError
        A sentence on the first mistake: where it stands, and what is right there.
    """
    return checked_recipe(readable(path, "recipe").read_bytes(), path)


def checked_recipe(content: bytes, path: Path) -> Recipe:
    """Return the recipe that a TOML text is, if it lies at `path`, with all files it names readable.

    Raises
    ------
    InputError
        A sentence on the first mistake: where it stands, and what is right there.
    """
    data = _toml(content, path)
    if data.get("schema", 1) != 1:
        raise InputError(
            f"{path.name}: schema = {data['schema']!r} is unknown; this version of inspect3d reads schema = 1."
        )
    try:
        recipe = Recipe.model_validate(data, strict=True, context=path)
    except ValidationError as error:
        raise InputError(f"{path.name}: {complaint(error, data, Recipe)}") from error
    readable(recipe.cad, "part.cad")
    for table in recipe.measurements:
        recipe.files(table)
    return recipe


def _toml(content: bytes, path: Path) -> dict[str, Any]:
    try:
        return _immutable(tomllib.loads(content.decode("utf-8-sig")))
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not a recipe: a recipe is a TOML text file in UTF-8.") from error
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{path.name} is not valid TOML: {error}.") from error


def _immutable(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _immutable(item) for key, item in value.items()}
    return tuple(map(_immutable, value)) if isinstance(value, list) else value
