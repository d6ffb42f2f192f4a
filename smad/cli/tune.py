"""`smad tune`: gains for this very bench, by a short experiment on it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from smad.cli.output import FILE, axis_option, leased_driver, progress, ready_client
from smad.errors import CommandError
from smad.files import write_whole

if TYPE_CHECKING:
    from smad.experiments.tuning import Session


@click.command()
@click.argument("loop", type=click.Choice(["displacement", "temperature"]), default="displacement")
@click.option(
    "--spring",
    type=click.Choice(["x", "y"]),
    default="x",
    show_default=True,
    help="Which spring to heat, for the temperature loop.",
)
@click.option("--trial/--no-trial", default=True, help="Try the old and the new gains.")
@click.option("--apply", is_flag=True, help="Put the new gains in force on the running daemon.")
@click.option(
    "--save",
    type=FILE,
    metavar="FILE",
    help="Write the section of the configuration to a new file.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option(
    "--lease",
    type=click.FloatRange(1.0, 600.0),
    default=2.0,
    show_default=True,
    metavar="S",
    help="Disarm after this time without a message from here.",
)
@click.option("--yes", is_flag=True, help="Do not ask before the bench is armed and heated.")
@axis_option
def tune(
    *,
    loop: str,
    spring: str,
    trial: bool,
    apply: bool,
    save: Path | None,
    as_json: bool,
    lease: float,
    yes: bool,
    bench: str,
) -> None:
    """Find gains of the displacement LOOP, or of the temperature loop, on the running bench.

    Asks, arms, waits until the springs are cold, moves by about ±4 mm, and disarms; takes two to
    four minutes. Nothing changes without --apply or --save, or if the trial is worse than with the
    present gains.
    """
    from smad.experiments.ready import require_ready

    if save is not None and save.exists():
        raise CommandError(
            f"{save} exists", action="name a new file, and copy the section from it; nothing moved"
        )
    require_ready(outputs=[save])
    if not yes:
        _ask()
    session = _session(loop, spring, trial=trial, apply=apply, lease_s=lease, bench=bench)
    section = session.tuned.toml()
    if save is not None and not session.worse:
        write_whole(save, section)
    if as_json:
        _print_json(session, section)
        return
    click.echo("\n".join(lines(session)))
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


def _session(
    loop: str, spring: str, *, trial: bool, apply: bool, lease_s: float, bench: str
) -> Session:
    from smad.config import parse_config
    from smad.control.commands import Tune
    from smad.experiments.tuning import tune_displacement, tune_temperature

    with ready_client(bench, extra="sim") as connected, progress() as line:
        config = parse_config(connected.config()).control
        driver = leased_driver(connected, "smad tune", lease_s, line.say)
        try:
            if loop == "temperature":
                session = tune_temperature(
                    driver, config, "x" if spring == "x" else "y", trial=trial
                )
            else:
                session = tune_displacement(driver, config, trial=trial)
        finally:
            connected.disarm()
        if apply and not session.worse:
            command = session.tuned.command(session.tuned.after)
            connected.tune(command)
            if session.tuned.band_mm:
                connected.tune(Tune(hold_band_mm=session.tuned.band_mm))
    return session


def lines(session: Session) -> list[str]:
    """The outcome as a person reads it."""
    tuned = session.tuned
    unit = "K" if tuned.loop == "temperature" else "mm"
    said = []
    for spring, model in tuned.models.items():
        said.append(
            f"spring {spring}: {model.gain:.3g} {unit}/s for each ampere at {model.at_A:.2g} A, "
            f"lag {model.lag_s:.2g} s, delay {1e3 * model.delay_s:.0f} ms "
            f"(accounts for {model.fit:.1%})"
        )
        if spring in tuned.cooling:
            cooling = tuned.cooling[spring]
            said.append(
                f"          water cools it from {cooling.from_K:.1f} K above, "
                f"time constant {cooling.time_s:.1f} s"
            )
    milli = "µm" if unit == "mm" else "mK"
    said.append(
        f"sensor: noise {1e3 * tuned.noise.noise:.2g} {milli} RMS, step "
        f"{1e3 * tuned.noise.count:.2g} {milli}"
        + (f", band of a quiet hold {1e3 * tuned.band_mm:.0f} µm" if tuned.band_mm else "")
    )
    header = ["gains", f"kp A/{unit}", f"ki A/({unit} s)", "gain margin", "delay margin", "phase"]
    rows = [
        [
            name,
            f"{gains.kp:g}",
            f"{gains.ki:g}",
            f"{margin.gain:.1f} times",
            f"{1e3 * margin.delay_s:.0f} ms",
            f"{margin.phase_deg:.0f}°",
        ]
        for name, gains, margin in (
            ("now", tuned.before, tuned.margins_before),
            ("new", tuned.after, tuned.margins_after),
        )
    ]
    said += ["", *_table(header, rows), "margins are those at full current"]
    if session.trials is not None:
        said += ["", *_table(*_trial_table(session))]
    return said


def _trial_table(session: Session) -> tuple[list[str], list[list[str]]]:
    from smad.control.tuning.tuned import Trial, WarmTrial

    assert session.trials is not None
    named = tuple(zip(("now", "new"), session.trials, strict=True))
    if isinstance(session.trials[0], Trial):
        header = ["trial of ±2 mm", "R²", "overshoot µm", "hold µm RMS", "ripple mA", "pump starts"]
        return header, [
            [
                name,
                f"{t.r2:.4f}",
                f"{1e3 * t.overshoot_mm:.0f}",
                f"{t.error_rms_um:.1f}",
                f"{t.ripple_mA:.0f}",
                f"{t.pump_starts}",
            ]
            for name, t in named
            if isinstance(t, Trial)
        ]
    header = ["trial of 8 K", "within 0.5 K s", "overshoot K", "hold mK RMS", "ripple mA"]
    return header, [
        [
            name,
            f"{t.settling_s:.1f}",
            f"{t.overshoot_K:.2f}",
            f"{1e3 * t.error_rms_K:.0f}",
            f"{t.ripple_mA:.0f}",
        ]
        for name, t in named
        if isinstance(t, WarmTrial)
    ]


def _table(header: list[str], rows: list[list[str]]) -> list[str]:
    widths = [max(len(row[k]) for row in (header, *rows)) for k in range(len(header))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (header, *rows)
    ]


def _print_json(session: Session, section: str) -> None:
    import msgspec

    fields: dict[str, Any] = msgspec.to_builtins(session)
    fields |= {"toml": section, "worse": session.worse}
    click.echo(msgspec.json.encode(fields).decode())
