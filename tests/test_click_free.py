"""Without landmarks the pictures themselves tell where the cameras stand, or it is said why they do not."""

from __future__ import annotations

import numpy as np
import pytest

from inspect3d.inspection import run
from inspect3d.outcome import Status
from tests.speckled import rig
from tests.test_stereocorrelation import cad, landmarks, photographs, recipe, rms


@pytest.fixture(scope="module")
def views():
    """Return two cameras 27 degrees apart."""
    return rig()


@pytest.fixture(scope="module")
def folder(tmp_path_factory, views):
    """Return a folder with the part and its photographs."""
    folder = tmp_path_factory.mktemp("sheet")
    cad(folder)
    photographs(folder, views)
    return folder


def test_a_start_without_landmarks_ends_at_the_map_with_landmarks(folder, views):
    found = {}
    for name, start in (("picked", landmarks(views)), ("found", "")):
        record = run(recipe(folder, f"focal = 2450.0\n{start}"), folder / name)
        found[name] = record.parts[0]
        assert record.parts[0].status is Status.OK, record.parts[0].reason
    picked, free = (found[name].deviation for name in ("picked", "found"))
    both = picked.observed & free.observed
    assert both.sum() > 0.9 * picked.observed.sum()
    assert rms((picked.value - free.value)[both]) < 0.2 * np.median(picked.sigma[both])
    assert "found from the pictures alone" in " ".join(found["found"].remarks)
    assert {"start_picture_1", "start_picture_2"} <= {figure.name for figure in found["found"].figures}
