"""The measuring methods that are installed; shipped and foreign ones take the same road."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import is_dataclass
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType
from typing import Any

from pydantic import TypeAdapter, ValidationError

from inspect3d.complaint import complaint, unknown, within
from inspect3d.measure import Measure
from inspect3d.outcome import InputError
from inspect3d.recipe import FILE_KEYS, MeasurementTable
from inspect3d.setting import settings_of

GROUP = "inspect3d.measurements"
"""The group of entry points that methods are registered under."""


def method_names() -> tuple[str, ...]:
    """Return the names of all installed methods in order, without loading any."""
    return tuple(sorted({entry.name for entry in entry_points(group=GROUP)}))


def methods() -> dict[str, type[Measure]]:
    """Return every installed method by its name.

    Raises
    ------
    InputError
        One of them cannot be loaded; see `method`.
    """
    return {name: method(name) for name in method_names()}


def method(name: str) -> type[Measure]:
    """Return the class of a method.

    Raises
    ------
    InputError
        There is no such method, two packages offer it, its package cannot be imported, or it is no method at all.
    """
    entries = {(entry.value, _package(entry)): entry for entry in entry_points(group=GROUP, name=name)}
    if not entries:
        raise InputError(_no_such(name))
    if len(entries) > 1:
        packages = " and ".join(sorted(package for _, package in entries))
        raise InputError(f"The packages {packages} both offer a method {name!r}: uninstall one of them.")
    (entry,) = entries.values()
    try:
        plugin = entry.load()
    except Exception as error:
        cause = f"{type(error).__name__}: {error}"
        raise InputError(f"The method {name!r} of the package {_package(entry)} cannot be loaded ({cause}).") from error
    if not _is_method(plugin):
        wanted = "a frozen dataclass with open(files) and __call__(source, nominal)"
        raise InputError(f"The method {name!r} of the package {_package(entry)} is not {wanted}: tell its authors.")
    return plugin


def build_for(table: MeasurementTable) -> Measure:
    """Return the method that a table of the recipe asks for; see `build`."""
    shared = {"alignment": table.alignment.model_dump(mode="json", exclude_defaults=True)}
    return build(table.method, table.settings, f"measurements[{table.name!r}]", shared)


def build(
    name: str, settings: Mapping[str, Any], where: str = "", shared: Mapping[str, Any] = MappingProxyType({})
) -> Measure:
    """Return a method with its settings.

    Parameters
    ----------
    name : of the method
    settings : from the recipe, less the keys every method shares and the files
    where : the recipe's table, to begin an error with; such as "measurements['laser']"
    shared : values of keys that every method shares, for a method that has a field of that name

    Raises
    ------
    InputError
        The method cannot be had (see `method`), or does not know a setting, or not the value it was given.
    """
    place = f"{where}: " if where else ""
    try:
        plugin = method(name)
    except InputError as error:
        raise InputError(f"{place}{error}") from error
    known = [setting.name for setting in settings_of(plugin)]
    settings = {**settings, **{key: value for key, value in shared.items() if key in known}}
    for key in settings:
        if key not in known:
            wrong = unknown(key, [*known, *MeasurementTable.model_fields, *FILE_KEYS])
            raise InputError(f"{within(where, key)}: {wrong}")
    try:
        return TypeAdapter(plugin).validate_json(json.dumps(settings, default=str, allow_nan=False), strict=True)
    except ValidationError as error:
        raise InputError(complaint(error, settings, where=where)) from error
    except ValueError as error:
        raise InputError(f"{place}a setting of the method {name!r} is not a finite number.") from error


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist else entry.module


def _is_method(plugin: Any) -> bool:
    if not (isinstance(plugin, type) and is_dataclass(plugin) and issubclass(plugin, Measure)):
        return False
    return "__setattr__" in vars(plugin)


def _no_such(name: str) -> str:
    installed = method_names()
    if not installed:
        return (
            "No measuring method is installed: install inspect3d again (`make setup`), since its entry points are gone."
        )
    near = get_close_matches(name.casefold(), installed, 1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    return f"There is no method {name!r}; installed are {', '.join(installed)}.{hint}"
