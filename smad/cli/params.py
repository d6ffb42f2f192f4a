"""`smad params`: the parameters stored on the board."""

import click

from smad.cli import complete
from smad.cli.options import NEGATIVE, Group, argument, axis_option
from smad.cli.output import client
from smad.cli.quantity import Quantity, typed_units
from smad.view.terminal.tables import print_columns


@click.group(cls=Group)
def params() -> None:
    """Show and change the parameters stored on the board."""


@params.command("list")
def list_command(bench: str = axis_option) -> None:
    """List all parameters of the board."""
    with client(bench) as bench_client:
        parameters = bench_client.params()
    rows = [
        (p.name, p.in_words(), f"{p.minimum:.10g} to {p.maximum:.10g}", p.description)
        for p in parameters
    ]
    print_columns(("name", "value", "allowed", "meaning"), rows, numeric=(1,))


@params.command()
def get(name: str = argument(shell_complete=complete.parameters), bench: str = axis_option) -> None:
    """Show one parameter of the board."""
    with client(bench) as bench_client:
        click.echo(bench_client.get_param(name).in_words())


def _in_its_unit(ctx: click.Context, param: click.Parameter, typed: str) -> float:
    """Return the number in the unit of the parameter that is named."""
    from firmware_protocol.parameters import BY_NAME

    parameter = BY_NAME.get(ctx.params["name"])
    number = Quantity(parameter.unit if parameter else "").convert(typed, param, ctx)
    if typed_units(ctx).get(param.name) in ("K", "degF"):
        # Some are differences, for which a kelvin and a degree Fahrenheit have another zero.
        raise click.BadParameter(f"{typed!r}: give it in cC or °C", ctx, param)
    # The board's are whole numbers; 95 °C are 9500 cC, and no 9499.99999999999.
    return round(number, 6)


@params.command("set", context_settings=NEGATIVE)
def set_command(
    name: str = argument(shell_complete=complete.parameters),
    value: float = argument(callback=_in_its_unit),
    bench: str = axis_option,
) -> None:
    """Change one parameter while not armed. `smad params save` keeps it over a power cycle.

    VALUE is in the unit that `smad params list` shows, or has its own: 3A.
    """
    with client(bench) as bench_client:
        param = bench_client.set_param(name, value)
    click.echo(f"{name} = {param.in_words()}; not yet kept over a power cycle (smad params save)")


@params.command("name")
def name_command(bench: str = axis_option) -> None:
    """Store the name of --axis on its board, while not armed."""
    from firmware_protocol.parameters import axis_name_crc

    with client(bench) as bench_client:
        if not bench_client.name:
            raise click.UsageError("name the axis whose board it is: --axis NAME.")
        bench_client.set_param("axis_name_crc", axis_name_crc(bench_client.name))
        bench_client.save_params()
    click.echo(f"stored on the board: it is that of {bench_client.name}")


@params.command()
def save(bench: str = axis_option) -> None:
    """Keep all parameters over a power cycle, while not armed."""
    with client(bench) as bench_client:
        count = len(bench_client.save_params())
    click.echo(f"saved {count} parameters on the board")
