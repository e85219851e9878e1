"""Run a program with numba's compiler on or off."""

from __future__ import annotations

import os
import subprocess
import sys


def printed(program: str, jit: bool) -> str:
    """Return what a Python program prints in a process of its own."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "0" if jit else "1"}
    run = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout
