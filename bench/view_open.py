"""Whether a page that stays open grows: memory of server and page, and the page's elements.

python -m bench.view_open [--minutes 60] [--speed 20] [--rows 12]

The simulated bench moves on and on, at `--speed` times the wall clock, so that hours of samples
pass through the page. The page's objects are counted after a collection of garbage.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import click
import psutil

from bench.browser import (
    browser,
    frames_drawn,
    heap_MiB,
    live_page,
    open_counting,
    running_daemon,
    what_is_missing,
)
from smad.client import Client
from smad.control.commands import Sine
from smad.view.terminal.tables import print_columns

_MOTION = Sine(amplitude_mm=2.0, period_s=7.0, cycles=10_000)
_HEAD = ("board time, h", "frames drawn", "smad view, MiB", "page's objects, MiB", "elements")


def row(driver: Any, server: psutil.Process, board_s: float) -> tuple[str, ...]:
    """What the page and its server hold now."""
    driver.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
    elements = driver.execute_script("return document.getElementsByTagName('*').length")
    before = server.memory_info().rss
    return (
        f"{board_s / 3600:.2f}",
        f"{frames_drawn(driver):.0f}",
        f"{before / 2**20:.1f}",
        f"{heap_MiB(driver):.1f}",
        f"{elements}",
    )


@click.command()
@click.option("--minutes", type=click.FloatRange(0.1), default=60.0, show_default=True)
@click.option("--speed", type=click.FloatRange(1.0), default=20.0, show_default=True)
@click.option("--rows", type=click.IntRange(2), default=12, show_default=True)
def main(minutes: float, speed: float, rows: int) -> None:
    """Keep a page open, and print what it and its server hold."""
    if missing := what_is_missing():
        raise SystemExit(missing)
    sizes = []
    pace = ("--speed", f"{speed:g}", "--paced-by-host")
    with tempfile.TemporaryDirectory(prefix="smad-view-") as name:
        folder = Path(name)
        with (
            running_daemon(folder, *pace),
            Client(folder=folder, timeout_s=60.0) as client,
            live_page(folder) as page,
            browser(folder / "profile") as driver,
        ):
            open_counting(driver, page)
            client.arm()
            client.move(_MOTION)
            server = psutil.Process(page.process.pid)
            for number in range(1, rows + 1):
                time.sleep(60.0 * minutes / rows)
                sizes.append(row(driver, server, client.motion().board_time_s))
                click.echo(f"{number} of {rows}: {', '.join(sizes[-1])}", err=True)
    print_columns(_HEAD, sizes, range(len(_HEAD)))


if __name__ == "__main__":
    main()
