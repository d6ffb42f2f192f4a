"""`smad run repeat`: the inputs of a recorded run again, on a bench or in virtual time."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.output import FILE, FOLDER, axis_option, lease_option, progress, ready_client
from smad.cli.simulated import seed_option, sim_option

if TYPE_CHECKING:
    from smad.experiments.repeating import Repeat


@click.command()
@click.argument("run", type=FILE)
@click.option("--as-is", is_flag=True, help="Begin where the bench is, without cooling first.")
@click.option("--other-bench", is_flag=True, help="Also a run of another bench or board.")
@sim_option
@click.option(
    "--save-logs",
    type=FOLDER,
    default=Path("runs"),
    show_default=True,
    help="With --sim, the folder of the new run log.",
)
@seed_option
@lease_option
@axis_option
def repeat(
    *,
    run: Path,
    as_is: bool,
    other_bench: bool,
    sim: bool,
    save_logs: Path,
    seed: int,
    lease: float,
    bench: str,
) -> None:
    """Play the currents and pump duties of RUN again, sample by sample, into a new run log.

    Any run log can be repeated, also of closed-loop motion: what its board applied is played open
    loop. The springs are cooled first, until displacement and temperatures are where RUN began. All
    limits act, and the motion ends when a reading is further from RUN than `control.repeat` allows.
    """
    from smad.experiments.repeating import read_repeat

    recorded = read_repeat(run)
    if recorded.armed_s < recorded.whole_s - 0.1:
        click.echo(
            f"{run.name}: its board was armed for {recorded.armed_s:.1f} of "
            f"{recorded.whole_s:.1f} s; that part is repeated",
            err=True,
        )
    name = f"repeat-of-{run.stem}"[:64]
    path = (
        _virtual(recorded, name, save_logs, seed)
        if sim
        else _live(recorded, name, bench, lease, as_is=as_is, other_bench=other_bench)
    )
    click.echo(f"{run.name} repeated: {path}")


def _virtual(recorded: Repeat, name: str, folder: Path, seed: int) -> Path:
    from sim_device.plant.models import built_in
    from smad.config import Config
    from smad.experiments.driver import new_log_path
    from smad.experiments.errors import EndedEarlyError, TrippedError
    from smad.experiments.virtual import VirtualDriver

    recorded.require_fit(Config())
    plan = recorded.plan(name)
    path = new_log_path(folder, plan, "give another folder with --save-logs, or move it away")
    with progress() as line:
        driver = VirtualDriver(built_in("A"), seed=seed, folder=folder, progress=line.say)
        try:
            driver.run(plan)
        except (EndedEarlyError, TrippedError):
            line.note(f"recorded until then: {path}")
            raise
    return path


def _live(
    recorded: Repeat, name: str, bench: str, lease_s: float, *, as_is: bool, other_bench: bool
) -> Path:
    from smad.config import parse_config
    from smad.experiments.errors import EndedEarlyError, StoppedError, TrippedError
    from smad.experiments.leased import LeasedDriver
    from smad.experiments.replayer import Directly, Replayer

    with ready_client(bench, extra="log") as connected, progress() as line:
        recorded.require_fit(parse_config(connected.config()))
        if not other_bench:
            board = connected.status().board
            recorded.require_bench("" if board is None else board.uid, bench)
        driver: Directly | Replayer
        if as_is:
            driver = Directly(connected, progress=line.say)
        else:
            driver = Replayer(connected, progress=line.say, sleep=time.sleep)
            driver.start = recorded.start
        leased = LeasedDriver(
            connected, driver, lease_s=lease_s, progress=line.say, who="smad run repeat"
        )
        try:
            leased.run(recorded.plan(name))
        except (EndedEarlyError, StoppedError, TrippedError):
            if driver.log is not None:
                line.note(f"recorded until then: {driver.log}")
            raise
        assert driver.log is not None
        return driver.log
