"""Sums that come out the same whatever the program around a diagnosis has set.

How many threads a BLAS uses decides in which order it adds, and so the last digits of a verdict.
Its threads also wait for each other on a loaded machine: the same work took ten times as long.
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
