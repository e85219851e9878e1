"""Work that may crash or never end, done first by a child process."""

from __future__ import annotations

import faulthandler
import os
import resource
import signal
import time
import warnings
from collections.abc import Callable

PATIENCE = 10  # times the processor time that is granted: a child that waits for a thread it does not have uses none
TICK = 0.002  # s, between two looks at the child


def survived(work: Callable[[], object], seconds: int) -> bool:
    """Do some work in a child process and tell whether that lived to its end, be it by an exception.

    The child is a copy of this process, which is there in an instant, where a new one would need a second for its
    imports. It has none of the other threads and must not wait for one; what it prints is lost.

    Parameters
    ----------
    seconds : of processor time, after which the child is ended; of waiting, ten times as many
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # Python's, that a copy misses the other threads
        child = os.fork()
    if not child:
        try:
            _hush()
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
            work()
        finally:
            os._exit(0)
    try:
        return os.WIFEXITED(_ended(child, time.monotonic() + PATIENCE * seconds))
    except KeyboardInterrupt:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise


def _ended(child: int, deadline: float) -> int:
    """Return with what status a child ended, which it is made to at the deadline."""
    while time.monotonic() < deadline:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return status
        time.sleep(TICK)
    os.kill(child, signal.SIGKILL)
    return os.waitpid(child, 0)[1]


def _hush() -> None:
    """Let this process die without a word and without a dump of its memory."""
    faulthandler.disable()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
