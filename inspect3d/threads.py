"""Threads of libraries that get in each other's way."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from threadpoolctl import threadpool_limits

Function = TypeVar("Function", bound=Callable[..., object])


def blas_of_one_thread(function: Function) -> Function:
    """Return the function, during which BLAS has one thread.

    After each product its threads go on spinning for a while, and those of our kernels wait for a core.
    """
    return cast(Function, threadpool_limits.wrap(limits=1, user_api="blas")(function))
