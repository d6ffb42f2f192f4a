"""`smad faults`: what a fault means, and what to do about it."""

import click

from firmware_protocol.enums import Fault
from firmware_protocol.nearest import instead
from firmware_protocol.supervisor.faults import FAULT_TEXTS
from smad.cli import complete
from smad.cli.options import Group, argument, bench_option
from smad.cli.output import client
from smad.view.terminal.tables import print_columns


def _named(ctx: click.Context, param: click.Parameter, value: str | None) -> Fault | None:
    """Return the fault that is given by name or number."""
    if value is None:
        return None
    spelling = value.upper().replace("-", "_")
    for fault in Fault:
        if fault and spelling in (fault.name, str(int(fault))):
            return fault
    names = [fault.name.lower() for fault in Fault if fault]
    suggestion = instead(value, names, "smad faults list shows them")
    raise click.BadParameter(f"there is no fault {value!r}; {suggestion}", ctx, param)


fault_argument = argument(callback=_named, required=False, shell_complete=complete.faults)


@click.group(cls=Group)
def faults() -> None:
    """Explain the faults that stop the board, and what to do."""


@faults.command()
def explain(fault: Fault | None = fault_argument, bench: str = bench_option) -> None:
    """Explain a FAULT by name or number, or the latched one."""
    if fault is None:
        with client(bench) as bench_client:
            latched = bench_client.motion().fault
        if latched is None:
            click.echo("no fault is latched")
            return
        click.echo(f"latched: {latched.in_words()}")
        fault = Fault(latched.number)
    text = FAULT_TEXTS[fault]
    click.echo(f"{fault.name} ({int(fault)})\n  cause:  {text.cause}\n  remedy: {text.remedy}")
    if text.clears:
        click.echo("  then:   smad clear, once the springs are cold; arming again is up to you")


@faults.command("list")
def list_command() -> None:
    """List every fault with its number."""
    rows = [(str(int(fault)), fault.name, FAULT_TEXTS[fault].cause) for fault in Fault if fault]
    print_columns(("number", "name", "cause"), rows, numeric=(0,))
