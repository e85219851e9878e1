"""What a recipe may set in a measuring method."""

from __future__ import annotations

import re
from dataclasses import MISSING, dataclass, fields
from inspect import getdoc
from typing import Any, Literal, get_args, get_origin, get_type_hints

_PARAMETER = re.compile(r"^(\w+(?:, \w+)*) : (.*(?:\n[ ]+.*)*)", re.MULTILINE)
"""An entry of a NumPy-style docstring: names, a colon, and the text with its indented lines."""


@dataclass(frozen=True)
class Setting:
    """A setting of a method.

    Parameters
    ----------
    name : the key in the recipe
    kind : its type, as the method declares it
    default : as the recipe would leave it; "needed" where there is none
    meaning : a line of the method's documentation
    """

    name: str
    kind: str
    default: str
    meaning: str


def settings_of(plugin: type) -> tuple[Setting, ...]:
    """Return the settings of a method, in its order; their meaning stands in the docstring's `Parameters`."""
    meanings = {
        name: " ".join(text.split())
        for names, text in _PARAMETER.findall(getdoc(plugin) or "")
        for name in names.split(", ")
    }
    hints = get_type_hints(plugin)
    return tuple(
        Setting(field.name, _kind(hints[field.name]), _default(field), meanings.get(field.name, ""))
        for field in fields(plugin)
        if field.init
    )


def _kind(hint: Any) -> str:
    if get_origin(hint) is Literal:
        return " | ".join(map(repr, get_args(hint)))
    if isinstance(hint, type) and not get_args(hint):
        return hint.__name__
    return re.sub(r"(?:\w+\.)+(\w+)", r"\1", str(hint))


def _default(field: Any) -> str:
    if field.default is not MISSING:
        return repr(field.default)
    return "needed" if field.default_factory is MISSING else repr(field.default_factory())
