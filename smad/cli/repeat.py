"""`smad run repeat` and `smad run moves`: the inputs of a run again, the trajectories of a file."""

from pathlib import Path

import click

from smad.cli.options import (
    FILE,
    FOLDER,
    Command,
    argument,
    axis_option,
    flag,
    lease_option,
    option,
)
from smad.cli.output import ready_client
from smad.cli.simulated import seed_option, sim_option
from smad.view.terminal.progress import progress


@click.command(cls=Command)
def repeat(
    *,
    run: Path = argument(FILE),
    as_is: bool = flag(
        "--as-is", "Without --sim: begin where the bench is, without cooling first."
    ),
    other_bench: bool = flag(
        "--other-bench", "Without --sim: allow a run of another bench or board."
    ),
    sim: bool = sim_option,
    save_logs: Path = option(
        "--save-logs", "With --sim, the folder of the new run log.", FOLDER, default=Path("runs")
    ),
    seed: int = seed_option,
    lease: float = lease_option,
    bench: str = axis_option,
) -> None:
    """Play the currents and pump duties of RUN again, sample by sample, into a new run log.

    Any run log can be repeated, also one of a closed-loop motion: the command plays what the board
    applied, in open loop. It cools the springs first. If the bench is then not where RUN began, it
    heats each spring once to 45 °C and cools it again. All limits act, and the motion ends when a
    reading is further from RUN than `control.repeat` allows.
    """
    from smad.experiments.repeated import repeat_on, repeat_simulated
    from smad.experiments.repeating import read_recorded_inputs

    recorded = read_recorded_inputs(run)
    if part := recorded.part_in_words():
        click.echo(part, err=True)
    if sim:
        with progress() as line:
            path = repeat_simulated(recorded, save_logs, seed, say=line.note, progress=line.say)
    else:
        with ready_client(bench, extra="log") as connected, progress() as line:
            path = repeat_on(
                connected,
                recorded,
                bench=bench,
                lease_s=lease,
                as_is=as_is,
                other_bench=other_bench,
                say=line.note,
                progress=line.say,
            )
    click.echo(f"{run.name} repeated: {path}")


@click.command(cls=Command)
def moves(
    *,
    path: Path = argument(FILE, metavar="FILE"),
    lease: float = lease_option,
    bench: str = axis_option,
) -> None:
    """Arm, follow the trajectories of FILE from rest, record them, and disarm.

    FILE is TOML with a table [[pieces]] for each piece: `kind` is step, ramp, sine …,
    the other keys are its fields (smad docs guide/clients). `timeout_s` ends a motion that hangs.
    """
    from smad.experiments.live import LiveDriver
    from smad.experiments.moves import read_moves

    plan = read_moves(path).plan(path.stem[:60])
    with ready_client(bench) as connected, progress() as line:
        driver = LiveDriver(connected, who="smad run moves", lease_s=lease, progress=line.say)
        try:
            driver.run(plan)
        finally:
            if driver.log is not None:
                click.echo(f"recorded: {driver.log}")
