"""Sums that come out the same whatever the program around a diagnosis has set.

How many threads a BLAS uses decides in which order it adds. The last bit of a slope then decides,
after some hundred replays, in which of two nearly equal minima a fit of many laws ends: the same
runs would get another answer in a notebook than on the command line.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
R = TypeVar("R")


def repeatable(work: Callable[P, R]) -> Callable[P, R]:
    """`work` with a BLAS of one thread, whatever the caller has; theirs comes back afterwards."""

    @wraps(work)
    def alone(*args: P.args, **kwargs: P.kwargs) -> R:
        with threadpool_limits(limits=1, user_api="blas"):
            return work(*args, **kwargs)

    return alone
