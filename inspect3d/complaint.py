"""One sentence about what is wrong in a recipe, in the words of the recipe."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

_WANTED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "a text in quotes",
    "string_too_short": "a text",
    "tuple_type": "a list in square brackets",
    "model_type": "a table",
    "dict_type": "a table",
    "dataclass_type": "a table",
    "finite_number": "a finite number",
}


def complaint(error: ValidationError, data: Any, model: type[BaseModel] | None = None, where: str = "") -> str:
    """Return what is wrong first and where: a sentence.

    Parameters
    ----------
    error : what pydantic found; unknown keys go first, since a misspelt key is also a missing one
    data : what was checked, to name tables by their `name`
    model : what it was checked against, to find the nearest right key
    where : the place of the data in the recipe, such as "measurements['laser']"
    """
    found = sorted(error.errors(), key=lambda detail: detail["type"] != "extra_forbidden")
    place, reason = _place_and_reason(found[0], data, model)
    sentence = ": ".join(filter(None, [within(where, place), reason]))
    return sentence if sentence.endswith("?") else f"{sentence}."


def within(where: str, place: str) -> str:
    """Return a place inside another one, as a recipe writes it; either may be empty."""
    return f"{where}.{place}" if where and place else where or place


def unknown(key: str, known: Iterable[str]) -> str:
    """Return that a key is unknown, and the nearest of the known ones, or all where none is near."""
    known = sorted(set(known))
    near = get_close_matches(key.casefold(), known, 1, cutoff=0.5)
    return f"unknown key; did you mean {near[0]}?" if near else f"unknown key; known are {', '.join(known)}"


def _place_and_reason(detail: ErrorDetails, data: Any, model: type[BaseModel] | None) -> tuple[str, str]:
    kind, where = detail["type"], detail["loc"]
    if kind == "missing" and isinstance(where[-1], int):
        return _place(where[:-1], data), f"too few values, {len(detail['input'])}"
    if kind == "extra_forbidden":
        return _place(where, data), unknown(str(where[-1]), _keys(where[:-1], model))
    return _place(where, data), _reason(detail)


def _reason(detail: ErrorDetails) -> str:
    kind, context = detail["type"], detail.get("ctx", {})
    if kind == "missing":
        return "missing"
    if kind == "value_error":
        return str(context["error"])
    if kind == "too_long":
        return f"too many values, {context['actual_length']} instead of {context['max_length']}"
    if kind == "too_short":
        return "at least one is needed"
    if kind == "string_pattern_mismatch":
        return "control characters are not allowed"
    wanted = f"wants {_WANTED[kind]}" if kind in _WANTED else detail["msg"].replace("Input should", "should")
    return f"{wanted}, not {_short(detail['input'])}"


def _short(value: Any) -> str:
    """Return a value as TOML writes it, near enough."""
    text = json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) < 60 else f"{text[:57]}..."


def _place(where: tuple[int | str, ...], data: Any) -> str:
    """Return the place as a recipe writes it; what is not in the data (a branch of a union) is left out."""
    place = ""
    for position, step in enumerate(where):
        if isinstance(step, str):
            if not (isinstance(data, Mapping) and (step in data or position == len(where) - 1)):
                break
            place = within(place, step)
            data = data.get(step)
        elif isinstance(data, list | tuple) and step < len(data):
            data = data[step]
            name = data.get("name") if isinstance(data, Mapping) else None
            place += f"[{name!r}]" if isinstance(name, str) else f"[no. {step + 1}]"
    return place


def _keys(where: tuple[int | str, ...], model: type[BaseModel] | None) -> list[str]:
    """Return the keys of the table at a place."""
    for step in where:
        if model is not None and isinstance(step, str):
            fields = {field.alias or name: field.annotation for name, field in model.model_fields.items()}
            model = _table(fields.get(step))
    return [] if model is None else [field.alias or name for name, field in model.model_fields.items()]


def _table(annotation: Any) -> type[BaseModel] | None:
    """Return the table in an annotation such as `tuple[Region, ...] | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_table, get_args(annotation))), None)
