"""`smad arm`, `disarm`, `estop`, `clear`, `heat`, `current`, `pump`, `idle`."""

import click

from firmware_protocol.enums import Fault
from smad.cli.faults import fault_argument
from smad.cli.output import (
    NEGATIVE,
    axis_option,
    bench_option,
    checked,
    client,
    described,
    wait_for_motion,
    wait_option,
)
from smad.cli.quantity import Quantity

_SPRING = click.Choice(["x", "y"], case_sensitive=False)


@click.command()
@axis_option
def arm(bench: str) -> None:
    """Arm the bench: the board checks itself and allows current.

    It stays armed after this command ends, without a lease, until a client disarms it.
    """
    with client(bench, lasting=True) as bench_client:
        bench_client.arm()
    click.echo("armed: the bench heats when you command it; smad disarm ends this")


@click.command()
@bench_option
def disarm(bench: str) -> None:
    """Switch heating off and cool down. Any client may do so."""
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


def _duty(ctx: click.Context, param: click.Parameter, value: str) -> float:
    """Return the share of full power: given as 0 to 1, or as a percentage with its sign."""
    try:
        duty = float(value.removesuffix("%")) / (100.0 if value.endswith("%") else 1.0)
    except ValueError:
        raise click.BadParameter(
            f"{value!r} is no duty; give 0 to 1, or 0% to 100%", ctx, param
        ) from None
    if not 0.0 <= duty <= 1.0:
        raise click.BadParameter(f"{value} is not within 0 to 1 (0% to 100%)", ctx, param)
    return duty


@click.command()
@fault_argument
@axis_option
def clear(bench: str, fault: Fault | None) -> None:
    """Acknowledge the latched fault, or only FAULT (name or number).

    Works once its cause is gone and the springs are cold.
    """
    with client(bench) as bench_client:
        bench_client.clear(fault)
    click.echo("cleared: the board is watched again; arming is up to you")


@click.command(context_settings=NEGATIVE)
@click.argument("spring", type=_SPRING, metavar="SPRING")
@click.argument("temperature_degC", type=Quantity("degC"), metavar="DEGC")
@click.option(
    "--rate", type=Quantity("K/s"), metavar="K/S", help="Ramp to it instead of going at once."
)
@click.option("--for", "duration_s", type=Quantity("s"), metavar="S", help="Hold for this time.")
@click.option("--water/--no-water", default=True, help="Cool with the pump while too warm.")
@wait_option
@axis_option
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
    from smad.control.commands import HoldTemperature

    command = checked(
        HoldTemperature(
            spring="x" if spring == "x" else "y",
            temperature_degC=temperature_degc,
            rate_K_per_s=rate,
            duration_s=duration_s,
            use_water=water,
        ),
        {"temperature_degC": "DEGC", "rate_K_per_s": "--rate", "duration_s": "--for"},
    )
    with client(bench) as bench_client:
        bench_client.heat(
            command.spring,
            command.temperature_degC,
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
@click.argument("current_a", type=Quantity("A"), metavar="A")
@click.option("--for", "duration_s", type=Quantity("s"), metavar="S", help="End after this time.")
@click.option(
    "--until", "until_degc", type=Quantity("degC"), metavar="DEGC", help="End at this temperature."
)
@wait_option
@axis_option
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
    command = checked(
        DriveCurrent(
            i_x_A=current_a if heats_x else 0.0,
            i_y_A=0.0 if heats_x else current_a,
            duration_s=duration_s,
            stop_spring="x" if heats_x else "y",
            stop_above_degC=until_degc,
        ),
        {"i_x_A": "A", "i_y_A": "A", "duration_s": "--for", "stop_above_degC": "--until"},
    )
    ends = duration_s is not None or until_degc is not None
    with client(bench) as bench_client:
        bench_client.current(command)
        wait_for_motion(
            bench_client, wait=wait and ends, what=f"{current_a:g} A in spring {spring}"
        )


@click.command(context_settings=NEGATIVE)
@click.argument("spring", type=_SPRING, metavar="SPRING")
@click.argument("duty", callback=_duty)
@click.option("--for", "duration_s", type=Quantity("s"), metavar="S", help="End after this time.")
@wait_option
@axis_option
def pump(spring: str, duty: float, duration_s: float | None, wait: bool, bench: str) -> None:
    """Run the pump of SPRING (x or y) at a DUTY (0.5, or 50%)."""
    from smad.control.commands import DriveCurrent

    command = checked(
        DriveCurrent(
            pump_x_duty=duty if spring == "x" else 0.0,
            pump_y_duty=duty if spring == "y" else 0.0,
            duration_s=duration_s,
        ),
        {"duration_s": "--for"},
    )
    with client(bench) as bench_client:
        bench_client.current(command)
        wait_for_motion(
            bench_client, wait=wait and duration_s is not None, what=f"pump {spring} at {duty:.0%}"
        )


@click.command()
@axis_option
def idle(bench: str) -> None:
    """Stop the present motion: no current, no water. The bench stays armed."""
    with client(bench) as bench_client:
        motion = bench_client.idle()
    click.echo(f"stopped: {described(motion)}")
