"""`smad faults`: what a fault means, and what to do about it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from firmware_protocol.nearest import instead
from smad.cli import complete
from smad.cli.output import bench_option, client
from smad.cli.tables import print_columns
from smad.errors import CommandError

if TYPE_CHECKING:
    from firmware_protocol.enums import Fault


@click.group()
def faults() -> None:
    """Explain the faults for which the board stops, and what to do about each."""


@faults.command()
@click.argument("name", required=False, shell_complete=complete.faults)
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
        click.echo(f"latched: {latched.in_words()}")
        _print(Fault(latched.number))
        return
    _print(_fault(name))


@faults.command("list")
def list_command() -> None:
    """List every fault with its number."""
    from firmware_protocol.enums import Fault
    from firmware_protocol.supervisor.faults import FAULT_TEXTS

    rows = [(str(int(fault)), fault.name, FAULT_TEXTS[fault].cause) for fault in Fault]
    print_columns(("number", "name", "cause"), rows, numeric=(0,))


def _fault(name: str) -> Fault:
    from firmware_protocol.enums import Fault

    wanted = name.upper().replace("-", "_")
    for fault in Fault:
        if wanted in (fault.name, str(int(fault))):
            return fault
    raise CommandError(
        "there is no fault of this name or number",
        value=name,
        action=instead(
            name, [f.name.lower() for f in Fault if f], "smad faults list shows them all"
        ),
    )


def _print(fault: Fault) -> None:
    from firmware_protocol.supervisor.faults import FAULT_TEXTS

    text = FAULT_TEXTS[fault]
    click.echo(f"{fault.name} ({int(fault)})")
    click.echo(f"  cause:  {text.cause}")
    click.echo(f"  remedy: {text.remedy}")
    click.echo("  then:   smad clear, once the springs are cold; arming again is up to you")
