"""`smad arm`, `disarm`, `estop`, `clear`, `heat`, `current`, `pump`, `idle`."""

from collections.abc import Mapping

import click
from msgspec.structs import asdict

from firmware_protocol.enums import Fault
from smad.cli.faults import fault_argument
from smad.cli.options import (
    NEGATIVE,
    Command,
    argument,
    axis_option,
    bench_option,
    checked,
    flag,
    option,
    wait_option,
)
from smad.cli.output import carry_out, client
from smad.cli.quantity import Quantity
from smad.control.commands import DriveCurrent, HoldTemperature
from smad.view.terminal.progress import note

_SPRING = click.Choice(["x", "y"], case_sensitive=False)


@click.command(cls=Command)
def arm(bench: str = axis_option) -> None:
    """Arm the bench: the board checks itself and allows current.

    It stays armed after this command ends, without a lease, until a client disarms it.
    """
    from smad.client.arming import arm_and_tell

    with client(bench, lasting=True) as bench_client:
        arm_and_tell(bench_client, click.echo)


@click.command(cls=Command)
def disarm(bench: str = bench_option) -> None:
    """Switch heating off and cool down. Any client may do so."""
    with client(bench) as bench_client:
        bench_client.disarm()
    click.echo("disarmed: heating is off, and the board cools by itself")


@click.command(cls=Command)
def estop(bench: str = bench_option) -> None:
    """Switch everything off until the board's power is cycled."""
    with client(bench) as bench_client:
        bench_client.estop()
    click.echo("ESTOP sent: everything is off until you switch the board off and on again")


@click.command(cls=Command)
def clear(fault: Fault | None = fault_argument, bench: str = axis_option) -> None:
    """Acknowledge the latched fault.

    With FAULT (name or number) only that one. Its cause must be gone, and the springs cold.
    """
    with client(bench) as bench_client:
        bench_client.clear(fault)
    click.echo("cleared: the board is watched again; arming is up to you")


@click.command(cls=Command, context_settings=NEGATIVE)
def heat(
    *,
    spring: str = argument(_SPRING, metavar="SPRING"),
    temperature_degc: float = argument(Quantity("degC"), metavar="DEGC"),
    rate: float | None = option(
        "--rate K/S", "Ramp to the temperature at this rate instead of a step.", Quantity("K/s")
    ),
    duration_s: float | None = option("--for S", "Hold for this time.", Quantity("s")),
    water: bool = flag("--water/--no-water", "Cool with the pump while too warm.", default=True),
    wait: bool = wait_option,
    bench: str = axis_option,
) -> None:
    """Hold SPRING (x or y) at a temperature in °C."""
    command = HoldTemperature(
        spring="x" if spring == "x" else "y",
        temperature_degC=temperature_degc,
        rate_K_per_s=rate,
        duration_s=duration_s,
        use_water=water,
    )
    typed = {"temperature_degC": "DEGC", "rate_K_per_s": "--rate", "duration_s": "--for"}
    what = f"spring {spring} to {temperature_degc:g} °C"
    # Without a duration it holds for ever: there is nothing to wait for.
    _begin(command, typed, bench, wait=wait and duration_s is not None, what=what)


@click.command(cls=Command, context_settings=NEGATIVE)
def current(
    *,
    spring: str = argument(_SPRING, metavar="SPRING"),
    current_a: float = argument(Quantity("A"), metavar="A"),
    duration_s: float | None = option("--for S", "End after this time.", Quantity("s")),
    until_degc: float | None = option("--until DEGC", "End at this temperature.", Quantity("degC")),
    wait: bool = wait_option,
    bench: str = axis_option,
) -> None:
    """Send a constant current (A) through SPRING (x or y)."""
    heats_x = spring == "x"
    command = DriveCurrent(
        i_x_A=current_a if heats_x else 0.0,
        i_y_A=0.0 if heats_x else current_a,
        duration_s=duration_s,
        stop_spring="x" if heats_x else "y",
        stop_above_degC=until_degc,
    )
    typed = {"i_x_A": "A", "i_y_A": "A", "duration_s": "--for", "stop_above_degC": "--until"}
    ends = duration_s is not None or until_degc is not None
    _begin(command, typed, bench, wait=wait and ends, what=f"{current_a:g} A in spring {spring}")


@click.command(cls=Command, context_settings=NEGATIVE)
def pump(
    spring: str = argument(_SPRING, metavar="SPRING"),
    duty: float = argument(Quantity("1", 0.0, 1.0), metavar="DUTY"),
    duration_s: float | None = option("--for S", "End after this time.", Quantity("s")),
    wait: bool = wait_option,
    bench: str = axis_option,
) -> None:
    """Run the pump of SPRING (x or y) at a DUTY (0.5, or 50%)."""
    command = DriveCurrent(
        pump_x_duty=duty if spring == "x" else 0.0,
        pump_y_duty=duty if spring == "y" else 0.0,
        duration_s=duration_s,
    )
    what = f"pump {spring} at {duty:.0%}"
    _begin(command, {"duration_s": "--for"}, bench, wait=wait and duration_s is not None, what=what)


def _begin(
    command: HoldTemperature | DriveCurrent,
    typed: Mapping[str, str],
    bench: str,
    *,
    wait: bool,
    what: str,
) -> None:
    """Check a command by what was `typed` for its fields, begin it, and wait for its end."""
    from smad.view.terminal.status_lines import below_surroundings

    checked(command, typed)
    with client(bench) as bench_client:
        if isinstance(command, DriveCurrent):
            carry_out(bench_client, bench_client.current, command, wait=wait, what=what)
        else:
            if too_cold := below_surroundings(bench_client.status(), command.temperature_degC):
                note(f"smad: {too_cold}; give a higher one, or end the cooling with smad idle")
            carry_out(bench_client, bench_client.heat, wait=wait, what=what, **asdict(command))


@click.command(cls=Command)
def idle(bench: str = axis_option) -> None:
    """Stop the present motion: no current, no water. The bench stays armed."""
    from smad.view.terminal.status_lines import motion_words

    with client(bench) as bench_client:
        motion = bench_client.idle()
    click.echo(f"stopped: {motion_words(motion)}")
