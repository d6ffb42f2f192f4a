"""`smad design`: what a pair of springs of a given geometry can do."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path

import click

from smad.cli.options import OUTPUT, PATH, Command, argument, json_option, option, together
from smad.cli.output import print_json
from smad.cli.quantity import Quantity


@dataclass(frozen=True, kw_only=True)
class _Sizes:
    """What replaces a size of the geometry; None: nothing does."""

    wire_mm: float | None = option("--wire", "Diameter of the wire, mm.", Quantity("mm"))
    coil_mm: float | None = option("--coil", "Mean diameter of the coil, mm.", Quantity("mm"))
    turns: float | None = option("--turns", "Active turns.", Quantity())
    pitch_mm: float | None = option(
        "--pitch", "Free space between turns, mm; used in still air.", Quantity("mm")
    )
    tube_mm: float | None = option("--tube", "Inner diameter of the tube, mm.", Quantity("mm"))
    prestrain: float | None = option(
        "--prestrain", "Shear strain of the mounted springs.", Quantity("1")
    )


@dataclass(frozen=True, kw_only=True)
class _Drive:
    """How the pair is heated and cooled, by the names of `design_cycle`."""

    current_A: float = option(
        "--current", "Current of the heated spring, A.", Quantity("A", 0.01, 50.0), default=4.0
    )
    cooling: str = option(
        "--cooling",
        "Water pumped through a tube around the wire, air, or water at rest around the spring.",
        click.Choice(["water", "air", "bath"]),
        default="water",
    )
    air_m_per_s: float = option(
        "--air-speed",
        "With air: its speed from a fan, m/s; 0 is still air.",
        Quantity("m/s"),
        default=0.0,
    )


@click.command(cls=Command)
def design(
    *,
    source: Path | None = argument(PATH, metavar="[GEOMETRY]", required=False),
    sizes: _Sizes = together(_Sizes),
    drive: _Drive = together(_Drive),
    params: str | None = option(
        "--params", "The alloy: a parameter set.  [default: A, or the file's base]"
    ),
    page: Path | None = option("--report", "Page to write.", OUTPUT),
    as_json: bool = json_option,
) -> None:
    """Compute stroke, force, period and power of a pair of springs.

    GEOMETRY is a file (base, wire_mm, coil_mm, turns, pitch_mm, tube_mm, prestrain); an option
    replaces its value. The default is the spring of the parameter set. The simulated pair makes
    a full stroke to and fro; docs/guide/design.md says what is scaled and what is not.
    """
    from sim_device.plant.geometry import load_geometry
    from smad.design.cycle import design_cycle, design_page
    from smad.report.page import Table, write_page
    from smad.view.terminal.tables import print_table

    base, geometry = load_geometry(source, base=params)
    geometry = replace(geometry, **{n: v for n, v in asdict(sizes).items() if v is not None})
    designed = design_cycle(base, geometry, **asdict(drive))
    for remark in designed.outside:
        click.echo(f"outside what was checked: {remark}", err=True)
    if page is not None:
        write_page(design_page(designed, geometry, base.title, **asdict(drive)), page)
    if as_json:
        print_json(designed)
        return
    print_table(Table(("quantity", "value"), designed.rows()))
    if page is not None:
        click.echo(str(page))
