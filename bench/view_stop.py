"""How long a click on STOP takes until the board is not armed, idle and under floods.

python -m bench.view_stop [--stops 30]

A daemon at 100 Hz, a simulated bench in real time, `smad view`, and chromium. Measured from the
click (the browser's clock) to the time stamp of the first sample in which the board is not armed.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import click
import zmq

from bench.browser import browser, live_page, running_daemon, what_is_missing
from bench.stop_latency import FLOODS, armed_and_driven, flooded
from firmware_protocol.enums import BoardState
from smad.api import TELEMETRY_TOPIC
from smad.client import Client
from smad.client.wire import subscribe, telemetry_of
from smad.view.terminal.tables import print_columns

GOAL_MS = 100.0
_DRIVING = (BoardState.ARMED, BoardState.HOLD)
_PATIENCE_S = 60.0
_CLICK = """const now = performance.timeOrigin + performance.now();
document.getElementById("stop").click(); return now / 1000;"""


def _until_not_armed(telemetry: Any, clicked_s: float) -> float:
    """Return the milliseconds from the click to the first sample that is not armed."""
    while telemetry.poll(int(_PATIENCE_S * 1000)):
        sample = telemetry_of(telemetry.recv_multipart()[1])
        if sample.timestamp >= clicked_s and sample.mode not in _DRIVING:
            return (sample.timestamp - clicked_s) * 1e3
    raise SystemExit("no sample came; is the bench running?")


def latencies_ms(folder: Path, driver: Any, name: str, stops: int) -> list[float]:
    """Click STOP so often under a flood; return how long each took."""
    taken = []
    context: zmq.Context[Any] = zmq.Context()
    with (
        Client(folder=folder, timeout_s=_PATIENCE_S) as owner,
        flooded(name, owner.connection.command),
    ):
        telemetry = subscribe(
            context, owner.connection.telemetry, TELEMETRY_TOPIC.encode(), 1_000_000
        )
        # The stream has to flow before the first click, or its beginning would be measured.
        telemetry.poll(int(_PATIENCE_S * 1000))
        for n in range(stops):
            armed_and_driven(owner)
            # Not in step with the board's samples.
            time.sleep(0.05 + 0.01 * (n * 0.618 % 1.0))
            taken.append(_until_not_armed(telemetry, driver.execute_script(_CLICK)))
        telemetry.close(linger=0)
    context.destroy(linger=0)
    return sorted(taken)


@click.command()
@click.option("--stops", type=click.IntRange(5), default=30, show_default=True)
@click.option("--only", type=click.Choice(tuple(FLOODS)), multiple=True)
def main(stops: int, only: tuple[str, ...]) -> None:
    """Print how long a click on STOP takes."""
    if missing := what_is_missing():
        raise SystemExit(missing)
    rows = []
    with tempfile.TemporaryDirectory(prefix="smad-view-") as name:
        folder = Path(name)
        with (
            running_daemon(folder),
            live_page(folder) as page,
            browser(folder / "profile") as driver,
        ):
            driver.get(page.command)
            time.sleep(2.0)
            for kind in only or FLOODS:
                click.echo(f"{kind} …", err=True)
                taken = latencies_ms(folder, driver, kind, stops)
                quantiles = [taken[int(share * (len(taken) - 1))] for share in (0.5, 0.9, 1.0)]
                within = "ok" if quantiles[-1] <= GOAL_MS else f"above {GOAL_MS:g} ms"
                rows.append((kind, str(stops), *(f"{value:.0f}" for value in quantiles), within))
    header = ("flood of", "stops", "p50 ms", "p90 ms", "max ms", "max")
    print_columns(header, rows, {1, 2, 3, 4})


if __name__ == "__main__":
    main()
