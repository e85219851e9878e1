"""The colours of the deviation maps, one scale for all measurements, so that they can be compared at a glance."""

from __future__ import annotations

import numpy as np

from inspect3d.record import Record
from inspect3d.report.colours import ColourScale, deviation_scale, symmetric_limits


def map_scale(record: Record) -> ColourScale:
    """Return the recipe's limits as colours, or limits that suit the deviations of all measurements together."""
    if record.recipe.report.limits is not None:
        return deviation_scale(record.recipe.report.limits)
    maps = [part.deviation for part in record.parts if part.deviation is not None]
    values = np.concatenate([each.value[each.observed] for each in maps])
    areas = np.concatenate([record.nominal.mesh.areas[each.observed] for each in maps])
    return deviation_scale(symmetric_limits(values, areas))
