"""What all tests share: the folder of real data, a fair share of the processor, and a worker's cache of kernels."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

DATA = Path(__file__).parents[1].parent / "shared" / "data"

_WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
_THREADS = max(1, (os.cpu_count() or 1) // _WORKERS)
for _variable in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, str(_THREADS))
if _WORKER := os.environ.get("PYTEST_XDIST_WORKER"):  # two that compile a kernel at once spoil the cache they share
    os.environ.setdefault("NUMBA_CACHE_DIR", str(Path(__file__).parents[1] / ".numba_cache" / _WORKER))


@pytest.fixture(scope="session")
def data() -> Path:
    """Return the folder of real data beside the repository."""
    if not DATA.is_dir():
        pytest.skip(f"the real data are not in {DATA}")
    return DATA
