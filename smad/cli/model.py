"""`smad model`: what is done with a model file beside simulating it."""

from __future__ import annotations

from pathlib import Path

import click

from smad.cli import complete
from smad.cli.effects import effect_lines
from smad.errors import SmadError


@click.group()
def model() -> None:
    """Export a model file, such as one of smad gap diagnose --apply, to other programs."""


@model.command()
@click.argument("source", metavar="[MODEL]", required=False, type=click.Path(path_type=Path))
@click.option("--params", default="A", show_default=True,
              help="Without MODEL: parameter file, or A, B, conserving.")  # fmt: skip
@click.option("--effect", "effects", multiple=True, metavar="NAME[:P=V,…]",
              shell_complete=complete.effects,
              help="Add an effect, or replace the model's of that name.")  # fmt: skip
@click.option(
    "--fixture",
    type=click.Choice(["antagonistic", "stretch", "blocked"]),
    default="antagonistic",
    show_default=True,
    help="What holds the springs; the stage moves in the last two.",
)
@click.option("--fmi", "unit", required=True, type=click.Path(dir_okay=False, path_type=Path),
              help="FMI 2.0 co-simulation unit to write.")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace a file that is there.")
def export(
    *,
    source: Path | None,
    params: str,
    effects: tuple[str, ...],
    fixture: str,
    unit: Path,
    overwrite: bool,
) -> None:
    """Write the plant of a MODEL file as a unit that Simulink, OpenModelica or Dymola imports.

    Without MODEL it is the plant of a parameter set. The importing machine needs Python with smad:
    see the page docs/guide/fmi.md.
    """
    from sim_device.plant.effects.registry import from_text
    from sim_device.plant.errors import PlantError
    from sim_device.plant.models import built_in, read_model
    from smad.fmi.export import export_unit
    from smad.fmi.pair import Mounted

    try:
        given = built_in(params) if source is None else read_model(source)
        given = given.with_effects(dict(from_text(text) for text in effects))
        for line in effect_lines(given.effects, effects):
            click.echo(line, err=True)
        written = export_unit(given, unit, mounted=Mounted(fixture), overwrite=overwrite)
    except PlantError as error:
        raise SmadError(str(error)) from error
    click.echo(written)
