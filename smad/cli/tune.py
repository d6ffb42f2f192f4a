"""`smad tune`: gains for this very bench, by a short experiment on it."""

import sys
from pathlib import Path

import click

from smad.cli.options import (
    OUTPUT,
    Command,
    argument,
    axis_option,
    flag,
    json_option,
    lease_option,
    option,
)
from smad.cli.output import print_json, ready_client
from smad.control.commands import Spring
from smad.errors import CommandError
from smad.files import write_whole
from smad.view.terminal.progress import progress
from smad.view.terminal.tables import print_table


@click.command(cls=Command)
def tune(
    *,
    loop: str = argument(click.Choice(["displacement", "temperature"]), default="displacement"),
    spring: Spring | None = option(
        "--spring", "For the temperature loop: the spring  [default: x]", click.Choice(["x", "y"])
    ),
    trial: bool = flag("--trial/--no-trial", "Try the old and the new gains.", default=True),
    apply: bool = flag("--apply", "Put the new gains in force on the running daemon."),
    save: Path | None = option(
        "--save FILE", "Write the section of the configuration to a new file.", OUTPUT
    ),
    as_json: bool = json_option,
    lease: float = lease_option,
    yes: bool = flag("--yes", "Do not ask before the bench is armed and heated."),
    bench: str = axis_option,
) -> None:
    """Find the gains of a control loop by a short experiment.

    It asks first. Then it arms the running bench, waits until the springs are cold, moves the pair
    by about ±4 mm, and disarms. This takes two to four minutes. --apply and --save do
    nothing if the trial is worse than with the present gains.
    """
    from smad.experiments.live import LiveDriver
    from smad.experiments.tuning import tune_bench
    from smad.experiments.tuning_report import facts, gains_table, trial_table

    if spring is not None and loop != "temperature":
        raise click.UsageError("--spring is for the temperature loop; leave it out")
    if save is not None and save.exists():
        raise CommandError(
            f"{save} exists", action="name a new file, and copy the section from it; nothing moved"
        )
    if not yes:
        _ask()
    with ready_client(bench, extra="sim") as connected, progress() as line:
        driver = LiveDriver(connected, who="smad tune", lease_s=lease, progress=line.say)
        warm = (spring or "x") if loop == "temperature" else None
        session = tune_bench(connected, driver, warm, trial=trial, apply=apply)
    section = session.tuned.toml()
    if save is not None and not session.worse:
        write_whole(save, section)
    if as_json:
        print_json(session.record(), indent=-1)
        return
    for text in (*facts(session), ""):
        click.echo(text)
    print_table(gains_table(session))
    click.echo("margins are those at full current")
    if (trials := trial_table(session)) is not None:
        click.echo()
        print_table(trials)
    click.echo(f"\n{section}", nl=False)
    if session.worse:
        click.echo(f"keep the gains you have: {session.worse}; nothing was changed")
        return
    if apply:
        click.echo("in force until the daemon ends; keep the section in its configuration")
    if save is not None:
        click.echo(f"written to {save}")


def _ask() -> None:
    """Ask before current flows. Raises CommandError where nobody can answer, or says no."""
    if not sys.stdin.isatty():
        raise CommandError(
            "smad tune arms the bench and heats its springs, and nobody can be asked here",
            action="add --yes",
        )
    click.echo(
        "This arms the bench, heats its springs and moves some ±4 mm, for 2 to 4 min.", err=True
    )
    if not click.confirm("Go on?", err=True):
        raise CommandError("not begun; nothing was armed")
