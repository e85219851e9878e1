"""The colours a page offers, all of them safe for the colour-blind."""

from __future__ import annotations

import numpy as np

SIGNED = {"blue, yellow, red": "RdYlBu_r", "purple, white, orange": "PuOr_r"}
RISING = {"viridis": "viridis", "cividis": "cividis"}


def palettes() -> dict[str, list[dict[str, object]]]:
    """Return for fields with a sign and for those without the names and colours (256 steps, 0 to 255) of palettes.

    The middle of a signed palette is pale and belongs to zero. ColorBrewer marks RdYlBu and PuOr as safe for the
    colour-blind; viridis and cividis were made so.
    """
    return {"signed": _listed(SIGNED), "rising": _listed(RISING)}


def _listed(names: dict[str, str]) -> list[dict[str, object]]:
    from matplotlib import colormaps

    steps = np.linspace(0, 1, 256)
    return [
        {"name": words, "colours": np.round(255 * colormaps[name](steps)[:, :3]).astype(int).ravel().tolist()}
        for words, name in names.items()
    ]
