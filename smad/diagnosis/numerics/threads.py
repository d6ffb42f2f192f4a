"""Sums that come out the same whatever the program around a diagnosis has set; work in threads.

How many threads a BLAS uses decides in which order it adds, and so the last digits of a verdict.
Its threads also wait for each other on a loaded machine: the same work took ten times as long.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")


def repeatable(work: Callable[P, R]) -> Callable[P, R]:
    """`work` with a BLAS of one thread, whatever the caller has; theirs comes back afterwards."""

    @wraps(work)
    def alone(*args: P.args, **kwargs: P.kwargs) -> R:
        with threadpool_limits(limits=1, user_api="blas"):
            return work(*args, **kwargs)

    return alone


def each(work: Callable[[T], R], items: Iterable[T], together: int) -> list[R]:
    """`work` of each item, in their order; so many `together`, in threads."""
    if together < 2:
        return [work(item) for item in items]
    with ThreadPoolExecutor(together) as pool:
        return list(pool.map(work, items))
