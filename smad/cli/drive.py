"""`smad arm`, `disarm`, `estop`, `clear`, `heat`, `current`, `pump`, `idle`."""

from __future__ import annotations

import click

from smad.cli.output import NEGATIVE, bench_option, client, described, wait_for_motion

_SPRING = click.Choice(["x", "y"], case_sensitive=False)
_wait = click.option(
    "--wait/--no-wait", default=True, help="Wait until it is done, or return at once."
)


@click.command()
@bench_option
def arm(bench: str) -> None:
    """Let current through: the board checks itself and arms."""
    with client(bench) as bench_client:
        bench_client.arm()
    click.echo("armed: current flows from now on when you command it; smad disarm ends it")


@click.command()
@bench_option
def disarm(bench: str) -> None:
    """Switch heating off and cool down; anyone may."""
    with client(bench) as bench_client:
        bench_client.disarm()
    click.echo("disarmed: heating is off, and the board cools by itself")


@click.command()
@bench_option
def estop(bench: str) -> None:
    """Switch everything off until the board's power is cycled."""
    with client(bench) as bench_client:
        bench_client.estop()
    click.echo("ESTOP sent: everything is off until you switch the board off and on again")


@click.command()
@click.argument("fault", type=int, required=False)
@bench_option
def clear(bench: str, fault: int | None) -> None:
    """Acknowledge the latched fault.

    Works once its cause is gone and the springs are cold.
    """
    with client(bench) as bench_client:
        bench_client.clear(fault)
    click.echo("cleared: the board is watched again; arming is up to you")


@click.command(context_settings=NEGATIVE)
@click.argument("spring", type=_SPRING, metavar="SPRING")
@click.argument("temperature_degC", type=float, metavar="DEGC")
@click.option("--rate", type=float, metavar="K/S", help="Ramp to it instead of going at once.")
@click.option("--for", "duration_s", type=float, metavar="S", help="Hold for so long.")
@click.option("--water/--no-water", default=True, help="Let the pump cool while too warm.")
@_wait
@bench_option
def heat(
    *,
    spring: str,
    temperature_degc: float,
    rate: float | None,
    duration_s: float | None,
    water: bool,
    wait: bool,
    bench: str,
) -> None:
    """Hold SPRING (x or y) at a temperature in °C."""
    with client(bench) as bench_client:
        bench_client.heat(
            "x" if spring == "x" else "y",
            temperature_degc,
            rate_K_per_s=rate,
            duration_s=duration_s,
            use_water=water,
        )
        # Without a duration it holds for ever: there is nothing to wait for.
        wait_for_motion(
            bench_client,
            wait=wait and duration_s is not None,
            what=f"spring {spring} to {temperature_degc:g} °C",
        )


@click.command(context_settings=NEGATIVE)
@click.argument("spring", type=_SPRING, metavar="SPRING")
@click.argument("current_a", type=float, metavar="A")
@click.option("--for", "duration_s", type=float, metavar="S", help="End after so long.")
@click.option("--until", "until_degc", type=float, metavar="DEGC", help="End when it is so warm.")
@_wait
@bench_option
def current(
    *,
    spring: str,
    current_a: float,
    duration_s: float | None,
    until_degc: float | None,
    wait: bool,
    bench: str,
) -> None:
    """Send a constant current (A) through SPRING (x or y)."""
    from smad.control.commands import DriveCurrent

    heats_x = spring == "x"
    command = DriveCurrent(
        i_x_A=current_a if heats_x else 0.0,
        i_y_A=0.0 if heats_x else current_a,
        duration_s=duration_s,
        stop_spring="x" if heats_x else "y",
        stop_above_degC=until_degc,
    )
    ends = duration_s is not None or until_degc is not None
    with client(bench) as bench_client:
        bench_client.current(command)
        wait_for_motion(
            bench_client, wait=wait and ends, what=f"{current_a:g} A in spring {spring}"
        )


@click.command(context_settings=NEGATIVE)
@click.argument("spring", type=_SPRING, metavar="SPRING")
@click.argument("duty", type=float)
@click.option("--for", "duration_s", type=float, metavar="S", help="End after so long.")
@_wait
@bench_option
def pump(spring: str, duty: float, duration_s: float | None, wait: bool, bench: str) -> None:
    """Run the pump of SPRING (x or y) at a DUTY of 0 to 1."""
    from smad.control.commands import DriveCurrent

    command = DriveCurrent(
        pump_x_duty=duty if spring == "x" else 0.0,
        pump_y_duty=duty if spring == "y" else 0.0,
        duration_s=duration_s,
    )
    with client(bench) as bench_client:
        bench_client.current(command)
        wait_for_motion(
            bench_client,
            wait=wait and duration_s is not None,
            what=f"pump {spring} at {duty:.0%}",
        )


@click.command()
@bench_option
def idle(bench: str) -> None:
    """End whatever runs: no current, no water. The bench stays armed."""
    with client(bench) as bench_client:
        motion = bench_client.idle()
    click.echo(f"idle: {described(motion)}")
