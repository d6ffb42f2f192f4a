"""What an open page or a bridge costs the daemon: setpoint age with it and without, in pairs.

python -m bench.view_cost [--pairs 8] [--seconds 5] [--rate 500] [--busy 0]
    [--reader chromium|plain|foxglove]

One daemon and one simulated bench; each pair measures a stretch without `smad view` and one with it
and a reader, in an order that changes from pair to pair. The spread of the pairs says what a
difference is worth. The reader is a browser that draws, or (`--reader plain`) a WebSocket client
that takes the same frames and draws nothing: that is the share of daemon and server alone.
`--reader foxglove` measures `smad bridge foxglove` with a viewer that takes every sample.
`--busy` keeps so many more processes busy.
"""

from __future__ import annotations

import contextlib
import json
import statistics
import subprocess
import sys
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
    served,
    what_is_missing,
)
from smad.bridge.foxglove import LINK, LOG, SUBPROTOCOLS, rows_of
from smad.client import Client
from smad.control.commands import Sine
from smad.style.strips import LAYOUT, XY_LAYOUT
from smad.view.terminal.tables import print_columns

_SETTLE_S = 2.0
_REFRESH_S = 1.2
"""The percentiles are worked out once a second."""
_MOTION = Sine(amplitude_mm=2.0, period_s=7.0, cycles=1000)
FIGURES = ("p50_us", "p99_us", "p999_us")
_COUNTED = {"lost": "samples lost", "refused": "setpoints refused", "held": "times in HOLD"}
_HELD = "ARMED → HOLD"
_BUSY = (sys.executable, "-c", "while True: pass")


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


class Viewer:
    """A viewer at the bridge that takes every sample and draws nothing. Counts its bytes, too."""

    heap_MiB = 0.0

    def __init__(self, address: str) -> None:
        self.frames = 0.0
        self.kB = 0.0
        self._stack = contextlib.ExitStack()
        self._connection = self._stack.enter_context(
            connect(address, subprotocols=[Subprotocol(SUBPROTOCOLS[0])])
        )
        wanted = [
            {"id": channel.id, "channelId": channel.id}
            for channel in (*rows_of(("",)).values(), LINK, LOG)
        ]
        self._connection.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        for message in self._connection:
            self.frames += isinstance(message, bytes)
            self.kB += len(message) / 1e3

    def close(self) -> None:
        """Go away."""
        self._stack.close()
        self._thread.join()


Reader = Browser | PlainReader | Viewer


class OpenPage:
    """`smad view` or a bridge, and its reader; says what they used since it was made."""

    def __init__(self, process: int, reader: Reader) -> None:
        self._process = psutil.Process(process)
        self._reader = reader
        self._began = self._now()

    def _now(self) -> tuple[float, float, float, float]:
        used = sum(self._process.cpu_times()[:2])
        return time.monotonic(), used, self._reader.frames, self._reader.kB

    def used(self) -> dict[str, float]:
        """Return processor time, memory of server and page, frames and bytes a second."""
        (began_s, cpu_s, drawn, came), now = self._began, self._now()
        return {
            "cpu": 100 * (now[1] - cpu_s) / (now[0] - began_s),
            "frames": (now[2] - drawn) / (now[0] - began_s),
            "kB": (now[3] - came) / (now[0] - began_s),
            "MiB": self._process.memory_info().rss / 2**20,
            "heap": self._reader.heap_MiB,
        }


@contextlib.contextmanager
def bridge_open(folder: Path) -> Iterator[OpenPage]:
    """The bridge with a viewer."""
    with (
        served(folder, ["bridge", "foxglove"]) as bridge,
        contextlib.closing(Viewer(bridge.said[0].split()[2])) as viewer,
    ):
        time.sleep(_SETTLE_S)
        yield OpenPage(bridge.process.pid, viewer)


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
    began_s, before = time.time(), client.status().counts
    time.sleep(seconds)
    time.sleep(_REFRESH_S)
    after = client.status()
    age = after.timing.setpoint_age
    lost = after.counts.missed + after.counts.skipped - before.missed - before.skipped
    refused = after.counts.setpoints_refused - before.setpoints_refused
    # Of a refused setpoint there is no age, nor of one that never came.
    holds = sum(event.time_s >= began_s and event.text == _HELD for event in after.events)
    more = {"lost": float(lost), "refused": float(refused), "held": float(holds)}
    return {**{name: getattr(age, name) for name in FIGURES}, **more}


def measure(
    folder: Path, pairs: int, seconds: float, reader: str
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
                profile = folder / f"profile{number}" if reader == "chromium" else None
                bridge = reader == "foxglove"
                with bridge_open(folder) if bridge else page_open(folder, profile) as page:
                    opened.append(stretch(client, seconds) | page.used())
        client.disarm()
    return closed, opened


@contextlib.contextmanager
def busy_processes(count: int) -> Iterator[None]:
    """So many processes that compute for nothing."""
    processes = [subprocess.Popen(_BUSY) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


@click.command()
@click.option("--pairs", type=click.IntRange(2), default=8, show_default=True)
@click.option("--seconds", type=click.FloatRange(1.0), default=5.0, show_default=True)
@click.option("--rate", type=click.Choice(["100", "250", "500"]), default="500", show_default=True)
@click.option(
    "--reader",
    type=click.Choice(["chromium", "plain", "foxglove"]),
    default="chromium",
    show_default=True,
)
@click.option("--busy", type=click.IntRange(0), default=0, show_default=True)
def main(pairs: int, seconds: float, rate: str, reader: str, busy: int) -> None:
    """Print the setpoint age with the page (or the bridge) open and closed."""
    if reader == "chromium" and (missing := what_is_missing()):
        raise SystemExit(missing)
    with tempfile.TemporaryDirectory(prefix="smad-view-") as name:
        folder = Path(name)
        with running_daemon(folder, rate_hz=int(rate)), busy_processes(busy):
            closed, opened = measure(folder, pairs, seconds, reader)
    rows = []
    for figure in (*FIGURES, *_COUNTED):
        without, with_page = (
            [figures[figure] for figures in closed],
            [figures[figure] for figures in opened],
        )
        differences = [b - a for a, b in zip(without, with_page, strict=True)]
        rows.append(
            (
                _COUNTED.get(figure, f"setpoint age {figure}"),
                f"{statistics.median(without):.0f}",
                f"{statistics.median(with_page):.0f}",
                f"{statistics.median(differences):+.0f}",
                f"{min(differences):+.0f} to {max(differences):+.0f}",
            )
        )
    load = f", {busy} busy" if busy else ""
    what = f"{rate} Hz, {reader}{load}, {pairs} pairs"
    header = (what, "closed", "open", "difference", "of the pairs")
    print_columns(header, rows, {1, 2, 3, 4})
    for figure, what in (
        ("cpu", "% of a core for the server"),
        ("MiB", "MiB for the server"),
        ("heap", "MiB for the page's objects"),
        ("frames", "frames (or samples) a second"),
        ("kB", "kB a second to the page or viewer"),
    ):
        click.echo(f"{statistics.median(figures[figure] for figures in opened):.1f} {what}")


if __name__ == "__main__":
    main()
