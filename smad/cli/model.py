"""`smad model`: what is done with a model file beside simulating it."""

from pathlib import Path

import click

from smad.cli.options import FILE, PATH, Group, argument, flag, option
from smad.cli.simulated import effects_option, simulated_model


@click.group(cls=Group)
def model() -> None:
    """Export a model to other programs."""


@model.command()
def export(
    *,
    source: Path | None = argument(PATH, metavar="[MODEL]", required=False),
    params: str = option(
        "--params", "Without MODEL: parameter file, or A, B, conserving.", default="A"
    ),
    effects: tuple[str, ...] = effects_option(
        "Add an effect, or replace the model's of that name."
    ),
    fixture: str = option(
        "--fixture",
        "How the springs are held; the last two have a stage.",
        click.Choice(["antagonistic", "stretch", "blocked"]),
        default="antagonistic",
    ),
    unit: Path = option("--fmi", "FMI co-simulation unit to write.", FILE, required=True),
    version: str = option(
        "--fmi-version",
        "2 for programs that do not import FMI 3.0.",
        click.Choice(["3", "2"]),
        default="3",
    ),
    overwrite: bool = flag("--overwrite", "Replace a file that is there."),
) -> None:
    """Write the plant of a MODEL file as an FMI unit.

    Programs that import FMI can run it. Without MODEL it takes the plant of a parameter set. The
    unit contains C source, and a binary for this machine if that has a compiler. More: smad docs
    guide/fmi.
    """
    from smad.fmi.export import Mounted, export_unit

    configured = simulated_model(effects, params=params, model_file=source)
    mounted = Mounted(fixture=fixture)
    written = export_unit(
        configured, unit, version=int(version), mounted=mounted, overwrite=overwrite
    )
    binary = f"binary for {written.platform}" if written.platform else "no C compiler, so no binary"
    click.echo(f"{written.path}: FMI {version}.0, C source, {binary}")
