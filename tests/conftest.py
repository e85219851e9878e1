"""What all tests share: the folder of real data, and a fair share of the processor."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

DATA = Path(__file__).parents[1].parent / "shared" / "data"

_WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
_THREADS = max(1, (os.cpu_count() or 1) // _WORKERS)
for _variable in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, str(_THREADS))


@pytest.fixture(scope="session")
def data() -> Path:
    """Return the folder of real data beside the repository."""
    if not DATA.is_dir():
        pytest.skip(f"the real data are not in {DATA}")
    return DATA
