"""`smad design`: what a pair of springs of a given geometry can do."""

from pathlib import Path

import click

from smad.cli.output import OUTPUT, PATH, json_option, print_json, require_outputs
from smad.cli.quantity import Quantity
from smad.errors import SmadError

_SIZES = ("wire_mm", "coil_mm", "turns", "pitch_mm", "tube_mm", "prestrain")


@click.command()
@click.argument("source", metavar="[GEOMETRY]", required=False, type=PATH)
@click.option("--wire", "wire_mm", type=Quantity("mm"), help="Diameter of the wire, mm.")
@click.option("--coil", "coil_mm", type=Quantity("mm"), help="Mean diameter of the coil, mm.")
@click.option("--turns", type=Quantity(), help="Active turns.")
@click.option(
    "--pitch",
    "pitch_mm",
    type=Quantity("mm"),
    help="Free space between turns, mm; used in still air.",
)
@click.option("--tube", "tube_mm", type=Quantity("mm"), help="Inner diameter of the tube, mm.")
@click.option("--prestrain", type=Quantity("1"), help="Shear strain of the mounted springs.")
@click.option(
    "--current",
    "current_A",
    type=Quantity("A", 0.01, 50.0),
    default=4.0,
    help="Current of the heated spring, A.",
)
@click.option(
    "--cooling",
    type=click.Choice(["water", "air", "bath"]),
    default="water",
    help="Water pumped through a tube around the wire, air, or water at rest around the spring.",
)
@click.option(
    "--air-speed",
    "air_m_per_s",
    type=Quantity("m/s"),
    default=0.0,
    help="With air: its speed from a fan, m/s; 0 is still air.",
)
@click.option("--params", help="The alloy: a parameter set.  [default: A, or the file's base]")
@click.option("--html", "page", type=OUTPUT, help="Page to write.")
@json_option
def design(
    *,
    source: Path | None,
    current_A: float,
    cooling: str,
    air_m_per_s: float,
    params: str | None,
    page: Path | None,
    as_json: bool,
    **given: float | None,
) -> None:
    """Compute stroke, force, period and power of a pair of springs.

    GEOMETRY is a file (base, wire_mm, coil_mm, turns, pitch_mm, tube_mm, prestrain); an option
    replaces its value. The default is the spring of the parameter set. The simulated pair makes
    a full stroke to and fro; docs/guide/design.md says what is scaled and what is not.
    """
    from dataclasses import replace

    from sim_device.plant.errors import PlantError
    from sim_device.plant.geometry import load_geometry
    from smad.cli.tables import print_table
    from smad.design.cycle import design_cycle
    from smad.design.page import design_page
    from smad.report.page import Table, write_page

    require_outputs()
    try:
        base, geometry = load_geometry(source, base=params)
        geometry = replace(geometry, **{n: v for n in _SIZES if (v := given[n]) is not None})
        made = design_cycle(
            base, geometry, current_A=current_A, cooling=cooling, air_m_per_s=air_m_per_s
        )
    except PlantError as error:
        raise SmadError(str(error)) from error
    for said in made.outside:
        click.echo(f"outside what was checked: {said}", err=True)
    if page is not None:
        shown = design_page(
            made,
            geometry,
            base.title,
            current_A=current_A,
            cooling=cooling,
            air_m_per_s=air_m_per_s,
        )
        write_page(shown, page)
    if as_json:
        print_json(made)
        return
    print_table(Table(("quantity", "value"), made.rows()))
    if page is not None:
        click.echo(str(page))
