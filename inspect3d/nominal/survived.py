"""Work that may crash or never end, done first by a child process."""

from __future__ import annotations

import faulthandler
import os
import resource
import signal
import warnings
from collections.abc import Callable


def survived(work: Callable[[], object], seconds: int) -> bool:
    """Do some work in a child process and tell whether that lived to its end, be it by an exception.

    The child is a copy of this process, which is there in an instant, where a new one would need a second for its
    imports. It has none of the other threads and must not wait for one; what it prints is lost.

    Parameters
    ----------
    seconds : of processor time, after which the child is ended
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
        _, status = os.waitpid(child, 0)
    except KeyboardInterrupt:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise
    return os.WIFEXITED(status)


def _hush() -> None:
    """Let this process die without a word and without a dump of its memory."""
    faulthandler.disable()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
