"""`smad demo`: the main job on a simulated bench, from arming to the page with the plots."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.output import Progress

if TYPE_CHECKING:
    from smad.demo.figures import Rows
    from smad.runlog.reader import Run

SPEED = 40
PATIENCE = 60
"""Board and daemon wait so many times as long for each other as on a bench: on virtual time a busy
machine makes the demo slower, and nothing else. The processes end with each other all the same."""
CLIENT_TIMEOUT_S = 120.0
REAL_TIME_S = 10.0


@click.command()
@click.option(
    "--folder",
    type=click.Path(path_type=Path),
    default=Path("runs"),
    show_default=True,
    help="Where the run log and the page go.",
)
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True)
@click.option(
    "--firmware",
    "boards",
    type=click.Choice(["python", "host", "avr"]),
    default=["python"],
    show_default=True,
    multiple=True,
    help="The board, see smad sim --help; give it again for another one beside it.",
)
def demo(folder: Path, seed: int, boards: tuple[str, ...]) -> None:
    """Run steps and a sinusoid on a simulated bench; show numbers.

    The same seed gives the same bench. The table's last digits still differ from run to run: the
    noise that a motion meets depends on when the bench was armed.
    """
    from smad.cli.tables import print_table
    from smad.demo import figures

    line = Progress()
    tables, places = {}, []
    for board in boards:
        run, tables[board] = _run(folder, seed, board, line)
        line.say("reading the run log and drawing")
        page = run.path.with_suffix(".html")
        figures.write(page, run, tables[board])
        places.append(f"run log  {run.path}\npage     {page}")
    line.done()
    print_table(figures.beside(tables))
    click.echo("\n".join(places))


def _run(folder: Path, seed: int, board: str, line: Progress) -> tuple[Run, Rows]:
    """Do the demo's job on one board; return its run and its table."""
    from smad.client import Client
    from smad.config import Config, RecorderConfig, TelemetryConfig, config_to_toml
    from smad.demo import figures
    from smad.demo.job import measured, run_cycle, told_by
    from smad.processes.daemon import running_daemon

    with tempfile.TemporaryDirectory(prefix="smad-demo-") as place:
        sockets = Path(place)
        config = Config(
            recorder=RecorderConfig(folder=str(folder.resolve()), automatic=False),
            telemetry=TelemetryConfig(endpoint=""),
        )
        (sockets / "demo.toml").write_text(config_to_toml(config))
        common = ["--sim", "--config", str(sockets / "demo.toml"), "--seed", str(seed)]
        common += ["--firmware", board, "--parent", str(os.getpid())]

        def starting() -> None:
            line.say(f"starting the simulated bench ({board}) and the daemon")

        fast = [*common, "--speed", str(SPEED), "--paced-by-host", "--patience", str(PATIENCE)]
        with (
            running_daemon(fast, sockets, waiting=starting),
            Client(folder=sockets, timeout_s=CLIENT_TIMEOUT_S) as client,
            told_by(client),
        ):
            done = run_cycle(client, line.say)
        with (
            running_daemon(common, sockets, waiting=starting),
            Client(folder=sockets, timeout_s=CLIENT_TIMEOUT_S) as client,
        ):
            real = measured(client, REAL_TIME_S, line.say)
    run = figures.load(done.path)
    return run, figures.table(run, done.status, real)
