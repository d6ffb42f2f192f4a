"""A simulated bench with its daemon, its page and a browser, for the tests of a module."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from bench.browser import browser, live_page, resize, running_daemon

from .browsing import MISSING, BrowsedBench, is_live, shown_generation, until


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BrowsedBench]:
    assert not MISSING, MISSING
    folder = tmp_path_factory.mktemp("view")
    with running_daemon(folder, paced=True) as daemon, live_page(folder) as page:
        made = BrowsedBench(folder, daemon, page)
        with made.client:
            yield made


@pytest.fixture(scope="module")
def chromium(bench: BrowsedBench) -> Iterator[Any]:
    with browser(bench.folder / "profile") as driver:
        yield driver


@pytest.fixture
def page(bench: BrowsedBench, chromium: Any) -> Iterator[Any]:
    """The page by its commanding link, live; the bench is disarmed afterwards."""
    bench.client.as_of(None)  # What a test before began and saw stopped is over.
    resize(chromium, 1200, 1000)
    chromium.get(bench.page.command)
    until(chromium, is_live)
    # A click on a page that has not shown the last stop yet is refused, as it should be.
    until(chromium, lambda d: shown_generation(d) == bench.client.motion().generation)
    yield chromium
    if bench.client.motion().armed:
        bench.client.disarm()
    # The page gives control back once it is disarmed; one that vanishes leaves its lease to lapse.
    until(chromium, lambda d: not bench.client.status().control.holder)
    assert [entry for entry in chromium.get_log("browser") if entry["level"] == "SEVERE"] == []
