"""By how much the virtual part differs from its CAD: an exactly known function of the surface point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.outcome import InputError

Vector = tuple[float, float, float]


class DeviationField(Protocol):
    """A signed deviation along the nominal outward normal, mm; positive is too much material.

    The true surface is x + d(x) n(x), x running over the nominal surface; the deviation at a node of an inspection
    mesh is therefore d(node) itself. Fields add up: `Bump(...) + Uniform(0.02)`.
    """

    def __call__(self, points_cad: Floats) -> Floats:
        """Return the deviation (n,) mm at points (n, 3) mm of the nominal surface."""

    def __add__(self, other: DeviationField) -> Sum:
        """Return both deviations together."""


def together(first: DeviationField, second: DeviationField) -> Sum:
    """Return the sum of two fields; every field takes it as its `+`."""
    return Sum((first, second))


@dataclass(frozen=True)
class Sum:
    """Several deviations at once."""

    terms: tuple[DeviationField, ...] = ()
    __add__ = together

    def __call__(self, points_cad: Floats) -> Floats:
        """Return the sum of the terms, (n,) mm."""
        return np.sum([np.zeros(len(points_cad)), *(term(points_cad) for term in self.terms)], axis=0)


@dataclass(frozen=True)
class Uniform:
    """The same offset everywhere, mm: the part as designed (0), or a layer of paint."""

    offset: float = 0.0
    __add__ = together

    def __call__(self, points_cad: Floats) -> Floats:
        """Return the offset, (n,) mm."""
        return np.full(len(points_cad), self.offset)


@dataclass(frozen=True)
class Bump:
    """A Gaussian bump (or dent, where the height is negative).

    Parameters
    ----------
    centre : mm, CAD frame, on the surface
    height : mm, at the centre
    width : mm, full width at half the height
    """

    centre: Vector
    height: float
    width: float
    __add__ = together

    def __call__(self, points_cad: Floats) -> Floats:
        """Return height 2^(-(2 r / width)^2), r the distance to the centre, (n,) mm."""
        squared = np.sum((points_cad - np.array(self.centre)) ** 2, axis=1)
        return self.height * np.exp2(-4.0 * squared / self.width**2)


@dataclass(frozen=True)
class Wave:
    """One plane wave of form error.

    Parameters
    ----------
    amplitude : mm
    frequency : periods per mm along x, y, z
    phase : rad
    """

    amplitude: float
    frequency: Vector
    phase: float = 0.0
    __add__ = together

    def __call__(self, points_cad: Floats) -> Floats:
        """Return amplitude cos(2 pi frequency . x + phase), (n,) mm."""
        return self.amplitude * np.cos(2.0 * np.pi * (points_cad @ np.array(self.frequency)) + self.phase)


@dataclass(frozen=True)
class Step:
    """A mismatch: one side of a plane was cut by another tool, too high or too low.

    Parameters
    ----------
    height : mm, where (x - point) . normal > 0; none on the other side
    point, normal : mm and direction, the plane
    """

    height: float
    point: Vector
    normal: Vector
    __add__ = together

    def __call__(self, points_cad: Floats) -> Floats:
        """Return the height beyond the plane and zero before it, (n,) mm."""
        return np.where((points_cad - np.array(self.point)) @ np.array(self.normal) > 0, self.height, 0.0)


@dataclass(frozen=True)
class FacetErrors:
    """Facets of a milled part, each off by an amount of its own.

    Parameters
    ----------
    borders : mm, increasing; where facets meet, along `direction`
    heights : mm, one per facet; before the first and beyond the last border there is no error
    direction : across the facets
    """

    borders: tuple[float, ...]
    heights: tuple[float, ...]
    direction: Vector
    __add__ = together

    def __post_init__(self) -> None:
        if len(self.heights) != len(self.borders) - 1:
            raise ValueError(f"{len(self.borders)} borders enclose {len(self.borders) - 1} facets")

    def __call__(self, points_cad: Floats) -> Floats:
        """Return the height of the facet a point belongs to, (n,) mm."""
        facet = np.searchsorted(self.borders, points_cad @ _along(self.direction), side="right")
        return np.array([0.0, *self.heights, 0.0])[facet]


@dataclass(frozen=True)
class Scallops:
    """The ridges that a ball-nosed tool leaves between its passes.

    Parameters
    ----------
    height : mm, of the ridges above the floor of the grooves
    pitch : mm, from pass to pass
    direction : across the passes; a pass runs through the origin
    """

    height: float
    pitch: float
    direction: Vector
    __add__ = together

    def __call__(self, points_cad: Floats) -> Floats:
        """Return height (2 s / pitch)^2, s the distance to the nearest pass, (n,) mm."""
        passes = points_cad @ _along(self.direction) / self.pitch
        return self.height * (2.0 * (passes - np.round(passes))) ** 2


@dataclass(frozen=True)
class Within:
    """A field inside a box, and none outside.

    Parameters
    ----------
    field : what happens inside
    low, high : mm, opposite corners of the box
    """

    field: DeviationField
    low: Vector
    high: Vector
    __add__ = together

    def __call__(self, points_cad: Floats) -> Floats:
        """Return the field inside the box and zero outside, (n,) mm."""
        inside = np.all((points_cad >= np.array(self.low)) & (points_cad <= np.array(self.high)), axis=1)
        return np.where(inside, self.field(points_cad), 0.0)


KINDS = {kind.__name__: kind for kind in (Sum, Uniform, Bump, Wave, Step, FacetErrors, Scallops, Within)}


def described(field: DeviationField) -> dict[str, Any]:
    """Return a field as plain values that JSON can hold: its kind and its parameters."""
    return {"kind": type(field).__name__, **{name: _plain(value) for name, value in vars(field).items()}}


def field_of(description: Mapping[str, Any]) -> DeviationField:
    """Return the field that `described` wrote.

    Raises
    ------
    InputError
        The description is of no known kind.
    """
    kind = KINDS.get(description.get("kind", ""))
    if kind is None:
        raise InputError(f"{description.get('kind')!r} is no deviation field; the kinds are {', '.join(KINDS)}.")
    return kind(**{name: _live(value) for name, value in description.items() if name != "kind"})


def _along(direction: Vector) -> Floats:
    return np.array(direction) / np.linalg.norm(direction)


def _plain(value: Any) -> Any:
    if type(value).__name__ in KINDS:
        return described(value)
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


def _live(value: Any) -> Any:
    if isinstance(value, Mapping):
        return field_of(value)
    return tuple(_live(item) for item in value) if isinstance(value, list) else value
