"""For all tests: their order, the longest first, and signals as a shell leaves them."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Iterator

import pytest

_PAGE = "tests/docs/test_commands.py::test_every_command_shown_runs["
LONGEST = (
    f"{_PAGE}docs/guide/check-up.md",
    f"{_PAGE}docs/guide/diagnose-a-gap.md",
    f"{_PAGE}docs/your-simulator.md",
    _PAGE,
)
"""Each worker begins with its share of them: one would else be left with them at the end."""


def pytest_configure() -> None:
    """Ctrl-C as a terminal leaves it.

    A shell that starts the tests in the background has them ignore it, and with them every program
    that a test starts and would end.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Nothing of what is collected becomes rubbish: the collector never looks through it."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items[:] = dealt(items, int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")))


def dealt(items: list[pytest.Item], workers: int) -> list[pytest.Item]:
    """Return the tests in an order of which xdist gives each worker one piece of equal length.

    The longest are dealt out, and each piece begins with its share; the others stay in their order,
    so that a fixture of a module is made once.
    """
    longest = sorted((item for item in items if _rank(item) < len(LONGEST)), key=_rank)
    others = [item for item in items if _rank(item) == len(LONGEST)]
    order: list[pytest.Item] = []
    for number in range(workers):
        share = longest[number::workers]
        size = (len(items) - len(order)) // (workers - number)
        more = max(0, size - len(share))
        order += share + others[:more]
        others = others[more:]
    return order


def _rank(item: pytest.Item) -> int:
    starts = (n for n, longest in enumerate(LONGEST) if item.nodeid.startswith(longest))
    return next(starts, len(LONGEST))


@pytest.fixture
def not_ignored() -> Iterator[None]:
    """Signals as a shell leaves them, whatever started the tests (nohup ignores SIGHUP)."""
    both = (signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(number, signal.SIG_DFL) for number in both]
    yield
    for number, handler in zip(both, before, strict=True):
        signal.signal(number, handler)
