"""The demo's job on a simulated bench, with its daemon beside us."""

import os
import tempfile
from pathlib import Path

from smad.client import Client
from smad.client.renewal import DEFAULT_LEASE_S
from smad.config import Config, RecorderConfig, TelemetryConfig, config_to_toml
from smad.demo import figures
from smad.demo.figures import Rows
from smad.demo.job import measured, naming_cause, run_cycle
from smad.processes.daemon import running_daemon
from smad.processes.simulator import PACED, PATIENCE
from smad.progress import Say
from smad.runlog.reader import read_run

SPEED = 40
CLIENT_TIMEOUT_S = 120.0
LEASE_S = PATIENCE * DEFAULT_LEASE_S
"""Board, daemon and client wait long for each other: on virtual time a busy machine makes the demo
slower, and nothing else. The processes end with each other all the same."""
REAL_TIME_S = 10.0


def play(folder: Path, seed: int, board: str, say: Say) -> tuple[Path, Path, Rows]:
    """Do the demo's job on one board; return its run log, its page and its table."""
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
            say(f"starting the simulated bench ({board}) and the daemon")

        fast = [*common, "--speed", str(SPEED), *PACED]
        with (
            running_daemon(fast, sockets, waiting=starting),
            Client(folder=sockets, timeout_s=CLIENT_TIMEOUT_S, lease_s=LEASE_S) as client,
            naming_cause(client),
        ):
            done = run_cycle(client, say)
        with (
            running_daemon(common, sockets, waiting=starting),
            Client(folder=sockets, timeout_s=CLIENT_TIMEOUT_S) as client,
        ):
            real = measured(client, REAL_TIME_S, say)
    say("reading the run log and drawing")
    run = read_run(done.path)
    table = figures.table(run, done.status, real)
    page = run.path.with_suffix(".html")
    figures.write(page, run, table)
    return run.path, page, table
