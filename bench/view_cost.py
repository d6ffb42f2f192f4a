"""What an open page costs the daemon: setpoint age with the page open and closed, in pairs.

python -m bench.view_cost [--pairs 8] [--seconds 5] [--rate 500] [--reader chromium]

One daemon and one simulated bench; each pair measures a stretch without `smad view` and one with it
and a reader, in an order that changes from pair to pair. The spread of the pairs says what a
difference is worth. The reader is a browser that draws, or (`--reader plain`) a WebSocket client
that takes the same frames and draws nothing: that is the share of daemon and server alone.
"""

from __future__ import annotations

import contextlib
import statistics
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import click
import msgspec
import psutil
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from bench.browser import (
    LivePage,
    browser,
    credentials_of,
    frames_drawn,
    heap_MiB,
    kB_received,
    live_page,
    open_counting,
    running_daemon,
    what_is_missing,
)
from smad.client import Client
from smad.control.commands import Sine
from smad.report.page import Table, text_table
from smad.view.strips import LAYOUT, XY_LAYOUT

_SETTLE_S = 2.0
_REFRESH_S = 1.2
"""The percentiles are worked out once a second."""
_MOTION = Sine(amplitude_mm=2.0, period_s=7.0, cycles=1000)
FIGURES = ("p50_us", "p99_us", "p999_us")


class Browser:
    """Chromium with the page, drawing; counts its frames and the memory of its objects."""

    def __init__(self, driver: Any, page: LivePage) -> None:
        self._driver = driver
        open_counting(driver, page)

    @property
    def frames(self) -> float:
        """Frames drawn so far."""
        return frames_drawn(self._driver)

    @property
    def kB(self) -> float:
        """What has come over the WebSocket so far."""
        return kB_received(self._driver)

    @property
    def heap_MiB(self) -> float:
        """Memory of the page's objects."""
        return heap_MiB(self._driver)


_SHOW = msgspec.json.encode(
    {
        "do": "show",
        "id": 1,
        "channels": [name for names in LAYOUT for name in names],
        "xy": sorted({name for pair in XY_LAYOUT for name in pair}),
    }
).decode()
"""What a page asks for that nobody has changed."""


class PlainReader:
    """A WebSocket client that takes what a page takes and draws nothing."""

    heap_MiB = 0.0

    def __init__(self, page: LivePage) -> None:
        self.frames = 0.0
        self.kB = 0.0
        address = urlsplit(page.command)
        cookie, key = credentials_of(page.command)
        self._connection = connect(
            f"ws://{address.netloc}/ws",
            origin=Origin(f"http://{address.netloc}"),
            additional_headers={"Cookie": cookie},
            subprotocols=[Subprotocol("smad"), Subprotocol(f"key.{key}")],
        )
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        # The type comes first in every message; parsing the rest would be work of ours.
        for message in self._connection:
            text = str(message)
            self.kB += len(message) / 1e3
            if text[:20].startswith('{"type":"frame"'):
                self.frames += 1
                self._connection.send('{"do":"drawn"}')
            elif text[:20].startswith('{"type":"status"'):
                self._connection.send('{"do":"alive"}')
            elif text[:20].startswith('{"type":"hello"'):
                self._connection.send(_SHOW)

    def close(self) -> None:
        """Go away."""
        self._connection.close()
        self._thread.join()


class OpenPage:
    """`smad view` and whoever reads its page; says what they used since it was made."""

    def __init__(self, process: int, reader: Browser | PlainReader) -> None:
        self._process = psutil.Process(process)
        self._reader = reader
        self._began = self._now()

    def _now(self) -> tuple[float, float, float, float]:
        used = sum(self._process.cpu_times()[:2])
        return time.monotonic(), used, self._reader.frames, self._reader.kB

    def used(self) -> dict[str, float]:
        """Return processor time, memory of the server and of the page, and frames a second."""
        (began_s, cpu_s, drawn, came), now = self._began, self._now()
        return {
            "cpu": 100 * (now[1] - cpu_s) / (now[0] - began_s),
            "frames": (now[2] - drawn) / (now[0] - began_s),
            "kB": (now[3] - came) / (now[0] - began_s),
            "MiB": self._process.memory_info().rss / 2**20,
            "heap": self._reader.heap_MiB,
        }


@contextlib.contextmanager
def page_open(folder: Path, profile: Path | None) -> Iterator[OpenPage]:
    """The page in a browser with that profile, or with a plain reader (None)."""
    with live_page(folder) as page, contextlib.ExitStack() as stack:
        reader: Browser | PlainReader
        if profile is None:
            reader = stack.enter_context(contextlib.closing(PlainReader(page)))
        else:
            reader = Browser(stack.enter_context(browser(profile)), page)
        time.sleep(_SETTLE_S)
        yield OpenPage(page.process.pid, reader)


def stretch(client: Client, seconds: float) -> dict[str, float]:
    """Return the percentiles of the setpoint age, and the samples lost, over so many seconds."""
    time.sleep(_SETTLE_S)
    client.reset_timing()
    before = client.status().counts
    time.sleep(seconds)
    time.sleep(_REFRESH_S)
    after = client.status()
    age = after.timing.setpoint_age
    lost = after.counts.missed + after.counts.skipped - before.missed - before.skipped
    return {**{name: getattr(age, name) for name in FIGURES}, "lost": float(lost)}


def measure(
    folder: Path, pairs: int, seconds: float, *, plain: bool
) -> tuple[list[dict[str, float]], ...]:
    """Return the figures of every stretch without and with the page, in the order of the pairs."""
    closed: list[dict[str, float]] = []
    opened: list[dict[str, float]] = []
    with Client(folder=folder, timeout_s=60.0) as client:
        client.arm()
        client.move(_MOTION)
        for number in range(pairs):
            click.echo(f"pair {number + 1} of {pairs} …", err=True)
            for with_page in (False, True) if number % 2 == 0 else (True, False):
                if not with_page:
                    closed.append(stretch(client, seconds))
                    continue
                profile = None if plain else folder / f"profile{number}"
                with page_open(folder, profile) as page:
                    opened.append(stretch(client, seconds) | page.used())
        client.disarm()
    return closed, opened


@click.command()
@click.option("--pairs", type=click.IntRange(2), default=8, show_default=True)
@click.option("--seconds", type=click.FloatRange(1.0), default=5.0, show_default=True)
@click.option("--rate", type=click.Choice(["100", "250", "500"]), default="500", show_default=True)
@click.option(
    "--reader", type=click.Choice(["chromium", "plain"]), default="chromium", show_default=True
)
def main(pairs: int, seconds: float, rate: str, reader: str) -> None:
    """Print the setpoint age with the page open and closed."""
    plain = reader == "plain"
    if not plain and (missing := what_is_missing()):
        raise SystemExit(missing)
    with tempfile.TemporaryDirectory(prefix="smad-view-") as name:
        folder = Path(name)
        with running_daemon(folder, rate_hz=int(rate)):
            closed, opened = measure(folder, pairs, seconds, plain=plain)
    rows = []
    for figure in (*FIGURES, "lost"):
        without, with_page = [one[figure] for one in closed], [one[figure] for one in opened]
        differences = [b - a for a, b in zip(without, with_page, strict=True)]
        rows.append(
            (
                f"setpoint age {figure}" if figure in FIGURES else "samples lost",
                f"{statistics.median(without):.0f}",
                f"{statistics.median(with_page):.0f}",
                f"{statistics.median(differences):+.0f}",
                f"{min(differences):+.0f} to {max(differences):+.0f}",
            )
        )
    header = (f"{rate} Hz, {reader}, {pairs} pairs", "closed", "open", "difference", "of the pairs")
    click.echo(text_table(Table(header, rows, numeric=frozenset({1, 2, 3, 4}))))
    for figure, what in (
        ("cpu", "% of a core for smad view"),
        ("MiB", "MiB for smad view"),
        ("heap", "MiB for the page's objects"),
        ("frames", "frames a second drawn"),
        ("kB", "kB a second to the page"),
    ):
        click.echo(f"{statistics.median(one[figure] for one in opened):.1f} {what}")


if __name__ == "__main__":
    main()
