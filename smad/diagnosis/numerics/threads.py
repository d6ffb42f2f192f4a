"""BLAS with one thread, so that sums are repeatable; work in threads.

The number of BLAS threads decides the order of additions, and so the last digits of a verdict. On a
loaded machine its threads also wait for each other: the same work took ten times as long.
"""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")


def repeatable(work: Callable[P, R]) -> Callable[P, R]:
    """`work` with BLAS limited to one thread; the caller's setting is restored afterwards."""

    @wraps(work)
    def alone(*args: P.args, **kwargs: P.kwargs) -> R:
        with threadpool_limits(limits=1, user_api="blas"):
            return work(*args, **kwargs)

    return alone


def each(work: Callable[[T], R], items: Iterable[T], together: int) -> list[R]:
    """Results of `work` for each item, in their order, with `together` threads."""
    if together < 2:
        return [work(item) for item in items]
    with ThreadPoolExecutor(together) as pool:
        return list(pool.map(work, items))
