"""`smad faults`: what a fault means, in plain words."""

from __future__ import annotations

import click

from smad.cli.output import bench_option, client
from smad.errors import CommandError


@click.group()
def faults() -> None:
    """What the board stops for, and what to do about it."""


@faults.command()
@click.argument("name", required=False)
@bench_option
def explain(name: str | None, bench: str) -> None:
    """Explain a fault by NAME or number; without one, the fault that is latched now."""
    from firmware_protocol.enums import Fault

    if name is None:
        with client(bench) as bench_client:
            latched = bench_client.motion().fault
        if latched is None:
            click.echo("no fault is latched")
            return
        click.echo(_seen(latched.channel, latched.measured, latched.limit, latched.unit))
        _print(Fault(latched.number))
        return
    _print(_fault(name))


@faults.command("list")
def list_command() -> None:
    """List every fault with its number."""
    from firmware_protocol.enums import Fault
    from firmware_protocol.supervisor.faults import FAULT_TEXTS

    for fault in Fault:
        click.echo(f"{int(fault):>3}  {fault.name:<24}  {FAULT_TEXTS[fault].cause}")


def _fault(name: str) -> object:
    from firmware_protocol.enums import Fault

    wanted = name.upper().replace("-", "_")
    for fault in Fault:
        if wanted in (fault.name, str(int(fault))):
            return fault
    raise CommandError(
        "there is no fault of this name or number", value=name, action="see smad faults list"
    )


def _print(fault: object) -> None:
    from firmware_protocol.enums import Fault
    from firmware_protocol.supervisor.faults import FAULT_TEXTS

    assert isinstance(fault, Fault)
    text = FAULT_TEXTS[fault]
    click.echo(f"{fault.name} ({int(fault)})")
    click.echo(f"  cause:  {text.cause}")
    click.echo(f"  remedy: {text.remedy}")
    click.echo("  then:   smad clear, once the springs are cold; arming again is up to you")


def _seen(channel: str, measured: float | None, limit: float | None, unit: str) -> str:
    parts = [f"latched at {channel}"]
    if measured is not None:
        parts.append(f"measured {measured:g} {unit}".rstrip())
    if limit is not None:
        parts.append(f"limit {limit:g} {unit}".rstrip())
    return ", ".join(parts)
