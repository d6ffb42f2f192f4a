"""`smad model`: what is done with a model file beside simulating it."""

from pathlib import Path

import click

from smad.cli.output import FILE, PATH
from smad.cli.simulated import effects_option, simulated_model
from smad.errors import SmadError


@click.group()
def model() -> None:
    """Export a model to other programs."""


@model.command()
@click.argument("source", metavar="[MODEL]", required=False, type=PATH)
@click.option("--params", default="A", help="Without MODEL: parameter file, or A, B, conserving.")
@effects_option("Add an effect, or replace the model's of that name.")
@click.option(
    "--fixture",
    type=click.Choice(["antagonistic", "stretch", "blocked"]),
    default="antagonistic",
    help="How the springs are held; the last two have a stage.",
)
@click.option("--fmi", "unit", required=True, type=FILE, help="FMI co-simulation unit to write.")
@click.option(
    "--fmi-version",
    "version",
    type=click.Choice(["3", "2"]),
    default="3",
    help="2 for programs that do not import FMI 3.0.",
)
@click.option("--overwrite", is_flag=True, help="Replace a file that is there.")
def export(
    *,
    source: Path | None,
    params: str,
    effects: tuple[str, ...],
    fixture: str,
    unit: Path,
    version: str,
    overwrite: bool,
) -> None:
    """Write the plant of a MODEL file as an FMI unit.

    Programs that import FMI can run it. Without MODEL it takes the plant of a parameter set. The
    unit contains C source, and a binary for this machine if that has a compiler. More: smad docs
    guide/fmi.
    """
    from sim_device.plant.errors import PlantError
    from smad.fmi.export import Mounted, export_unit

    given = simulated_model(effects, params=params, model_file=source)
    try:
        written = export_unit(
            given, unit, version=int(version), mounted=Mounted(fixture=fixture), overwrite=overwrite
        )
    except PlantError as error:
        raise SmadError(str(error)) from error
    binary = f"binary for {written.platform}" if written.platform else "no C compiler, so no binary"
    click.echo(f"{written.path}: FMI {version}.0, C source, {binary}")
