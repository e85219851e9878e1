"""The installed methods, as `inspect3d methods` shows them."""

from __future__ import annotations

from collections.abc import Iterator
from inspect import getdoc

from inspect3d.outcome import InputError
from inspect3d.registry import method, method_names
from inspect3d.setting import settings_of


def listing() -> Iterator[str]:
    """Yield a line for each method and one for each of its settings; for a broken one, what is wrong with it."""
    for name in method_names():
        try:
            plugin = method(name)
        except InputError as error:
            yield f"{name}: {error}"
            continue
        yield f"{name}: {(getdoc(plugin) or plugin.__name__).splitlines()[0]}"
        for setting in settings_of(plugin):
            yield f"    {setting.name} ({setting.kind}; {setting.default}): {setting.meaning}".rstrip(": ")
