"""What plays the runs of a programme: a simulated bench, or the one that the daemon runs."""

from __future__ import annotations

import contextlib
import itertools
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.output import progress
from smad.client.signals import ended_by_signals

if TYPE_CHECKING:
    from smad.checkup.programme import ProgrammeRun
    from smad.checkup.series import Play, Recorded
    from smad.client import Client
    from smad.control.plan import Plan
    from smad.experiments.errors import TrippedError
    from smad.experiments.repeating import Repeat

LEASE_S = 2.0
_SEED_STEP = 100_003


def _planned(run: ProgrammeRun, original: Path | None) -> tuple[Plan, Repeat | None]:
    from smad.experiments.repeating import read_repeat

    if original is None:
        return run.plan(), None
    repeat = read_repeat(original)
    return repeat.plan(run.name), repeat


@contextlib.contextmanager
def simulated(*, seed: int, effects: Sequence[str]) -> Iterator[Play]:
    """A fresh simulated bench for each run, in virtual time."""
    from sim_device.plant.effects.registry import from_text
    from sim_device.plant.errors import PlantError
    from sim_device.plant.models import built_in
    from smad.checkup.series import Recorded
    from smad.experiments.driver import log_path
    from smad.experiments.errors import EndedEarlyError, TrippedError
    from smad.experiments.virtual import VirtualDriver

    try:
        simulated = built_in("A").with_effects(dict(from_text(text) for text in effects))
    except PlantError as error:
        raise click.UsageError(f"--effect: {error}") from None
    seeds = itertools.count(seed, _SEED_STEP)
    with tempfile.TemporaryDirectory(prefix="smad-") as scratch:
        folder = Path(scratch)

        def play(run: ProgrammeRun, original: Path | None) -> Recorded:
            plan, _ = _planned(run, original)
            driver = VirtualDriver(simulated, seed=next(seeds) & 0xFFFF_FFFF, folder=folder)
            try:
                driver.run(plan)
            except EndedEarlyError as error:
                return Recorded(log_path(folder, plan), error.cause, run.duration_s)
            except TrippedError as error:
                return Recorded(log_path(folder, plan), _trip(error, original), run.duration_s)
            return Recorded(log_path(folder, plan), took_s=run.duration_s)

        yield play


@contextlib.contextmanager
def live(bench: str, *, who: str) -> Iterator[Play]:
    """The bench of the running daemon, disarmed after each run and at the end.

    Each run begins from the same rest: cold, after a stroke of each spring. A bench that does not
    come back to where the recorded run began is told of and played all the same.
    """
    from smad.cli.output import client
    from smad.experiments.ready import require_ready

    with ended_by_signals(), client(bench) as connected:
        require_ready(connected, extra="gap")
        player = _LivePlayer(connected, bench, who)
        try:
            yield player
        finally:
            player.disarm()


class _LivePlayer:
    def __init__(self, client: Client, bench: str, who: str) -> None:
        from smad.config import parse_config

        self._client = client
        self._bench = bench
        self._who = who
        client.as_of(client.motion().generation)
        self._config = parse_config(client.config())
        board = client.status().board
        self._uid = "" if board is None else board.uid
        self._armed = False

    def __call__(self, run: ProgrammeRun, original: Path | None) -> Recorded:
        from smad.checkup.series import Recorded
        from smad.cli.leased import LeasedDriver
        from smad.experiments.errors import EndedEarlyError, TrippedError
        from smad.experiments.replayer import Replayer

        plan, repeat = _planned(run, original)
        if repeat is not None:
            repeat.require_fit(self._config)
            repeat.require_bench(self._uid, self._bench)
        with progress() as line:
            driver = Replayer(self._client, progress=line.say, sleep=time.sleep, strokes=True,
                              elsewhere=_warn)  # fmt: skip
            driver.start = None if repeat is None else repeat.start
            leased = LeasedDriver(
                self._client, driver, lease_s=LEASE_S, progress=line.say, who=self._who
            )
            self._armed = True
            ended, began_s = "", self._client.motion().board_time_s
            try:
                leased.run(plan)
            except EndedEarlyError as error:
                ended = error.cause
            except TrippedError as error:
                if driver.log is None:
                    raise
                ended = _trip(error, original)
            assert driver.log is not None
            return Recorded(driver.log, ended, self._client.motion().board_time_s - began_s)

    def disarm(self) -> None:
        """Leave the bench disarmed, if it was ever armed; a daemon that is gone has done so."""
        from smad.errors import SmadError

        if self._armed:
            with contextlib.suppress(SmadError):
                self._client.disarm()


def _trip(error: TrippedError, original: Path | None) -> str:
    """Why a run that repeats another was ended by a fault; it counts as far as it goes.

    A bench with a trouble may trip where it did not when it was good. Raises the error where
    nothing is repeated: that is no good run.
    """
    if original is None:
        raise error
    return f"{error.cause} ({error.value})"


def _warn(text: str) -> None:
    click.echo(text, err=True)
