"""For all tests: their order, the longest first, and signals as a shell leaves them."""

from __future__ import annotations

import gc
import signal
from collections.abc import Iterator

import pytest

LONGEST = ("tests/docs/test_commands.py", "tests/evaluation/")
"""One worker would else be left with them at the end."""


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
    items.sort(key=lambda item: not item.nodeid.startswith(LONGEST))


@pytest.fixture
def not_ignored() -> Iterator[None]:
    """Signals as a shell leaves them, whatever started the tests (nohup ignores SIGHUP)."""
    both = (signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(number, signal.SIG_DFL) for number in both]
    yield
    for number, handler in zip(both, before, strict=True):
        signal.signal(number, handler)
