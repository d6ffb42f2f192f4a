"""What plays the runs of a programme: a simulated bench, or the one that the daemon runs."""

from __future__ import annotations

import contextlib
import itertools
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from sim_device.plant.models import Model
from smad.checkup.programme import ProgrammeRun
from smad.checkup.series import Play, Player, Recorded
from smad.config import parse_config
from smad.control.plan import Plan
from smad.experiments.errors import EndedEarlyError, TrippedError
from smad.experiments.repeating import RecordedInputs, read_recorded_inputs
from smad.experiments.replayer import RestFirstDriver
from smad.experiments.virtual import VirtualDriver
from smad.progress import Say

if TYPE_CHECKING:
    from smad.client import Client

LEASE_S = 2.0
_SEED_STEP = 100_003


def _planned(run: ProgrammeRun, original: Path | None) -> tuple[Plan, RecordedInputs | None]:
    """The plan of a run as designed, or of the log that it repeats, with the inputs of that log."""
    if original is None:
        return run.plan(), None
    repeat = read_recorded_inputs(original)
    return repeat.plan(run.name), repeat


@contextlib.contextmanager
def simulated(model: Model, *, seed: int) -> Iterator[Player]:
    """A fresh simulated bench for each run, in virtual time."""
    with tempfile.TemporaryDirectory(prefix="smad-") as scratch:
        folder = Path(scratch)

        def player(series: int) -> Play:
            seeds = itertools.count(seed + series, _SEED_STEP)

            def play(run: ProgrammeRun, original: Path | None) -> Recorded:
                plan, _ = _planned(run, original)
                driver = VirtualDriver(model, seed=next(seeds) & 0xFFFF_FFFF, folder=folder)
                return Recorded(*_carried_out(driver, plan, original), run.duration_s)

            return play

        yield player


def live(client: Client, *, bench: str, say: Say, progress: Say) -> Player:
    """The bench of the running daemon, disarmed after each run.

    `client` is ready to arm. Each run begins from the same rest: cold, after a stroke of each
    spring. If a bench does not come back to where the recorded run began, `say` notes it, and the
    run is played all the same.
    """
    config = parse_config(client.config())
    board = client.status().board
    uid = "" if board is None else board.uid

    # One driver for all runs: it knows that after its own disarm the springs are still warm.
    driver = RestFirstDriver(
        client,
        strokes=True,
        elsewhere=say,
        who="smad gap",
        lease_s=LEASE_S,
        progress=progress,
        sleep=time.sleep,
    )

    def play(run: ProgrammeRun, original: Path | None) -> Recorded:
        plan, repeat = _planned(run, original)
        if repeat is not None:
            repeat.require_fit(config)
            repeat.require_bench(uid, bench)
        driver.start = None if repeat is None else repeat.start
        driver.log = None
        began_s = client.motion().board_time_s
        carried_out = _carried_out(driver, plan, original)
        return Recorded(*carried_out, client.motion().board_time_s - began_s)

    # One client plays all series: another would not know of a stop before it. Between the runs, and
    # after them, the bench is anybody's: nothing is disarmed that this client has not armed.
    return lambda series: play


def _carried_out(
    driver: VirtualDriver | RestFirstDriver, plan: Plan, original: Path | None
) -> tuple[Path, str, bool]:
    """Carry out a plan; return its log, why it was ended early, empty where it was not, and whether
    by a fault.

    A bench with a trouble may trip where it did not when it was good, so a run that repeats another
    counts as far as it goes. Raises TrippedError where nothing is repeated: that is no good run.
    """
    ended, tripped = "", False
    try:
        driver.run(plan)
    except EndedEarlyError as error:
        ended = error.cause
    except TrippedError as error:
        if original is None or driver.log is None:
            raise
        ended, tripped = f"{error.cause} ({error.value})", True
    assert driver.log is not None
    return driver.log, ended, tripped
