"""Options of a simulated bench, and what the commands say of its effects."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli import complete
from smad.cli.output import note
from smad.errors import SmadError

if TYPE_CHECKING:
    from sim_device.plant.models import Model

sim_option = click.option("--sim", is_flag=True, help="On a simulated bench in virtual time.")
effect_option = click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="NAME[:P=V,…]",
    shell_complete=complete.effects,
    help="With --sim: an effect that the simulated bench has.",
)
seed_option = click.option(
    "--seed", type=click.IntRange(0, 2**32 - 1), default=0, help="With --sim: seed of all noise."
)


def require_sim(effects: Iterable[str], *, sim: bool) -> None:
    """Raise UsageError for effects of a bench that is not simulated."""
    if effects and not sim:
        raise click.UsageError("--effect is of a simulated bench; add --sim")


def simulated_model(
    effects: Sequence[str] = (), *, params: str = "A", model_file: Path | None = None
) -> Model:
    """Return the model of a file, else of a parameter set, with effects: NAME or NAME:P=V.

    An effect replaces the model's of that name; the values that it takes are printed. Raises
    UsageError for an effect, SmadError for the rest.
    """
    from sim_device.plant.effects.registry import from_text
    from sim_device.plant.errors import PlantError
    from sim_device.plant.models import built_in, read_model

    try:
        given = built_in(params) if model_file is None else read_model(model_file)
    except PlantError as error:
        raise SmadError(str(error)) from None
    try:
        model = given.with_effects(dict(from_text(text) for text in effects))
    except PlantError as error:
        raise click.UsageError(f"--effect: {error}") from None
    for line in effect_lines(model.effects, effects):
        note(line)
    return model


def effect_lines(effects: Mapping[str, Mapping[str, float]], named: Iterable[str]) -> Iterator[str]:
    """Yield a line for each effect of `named` (NAME or NAME:P=V): its values with their units."""
    from sim_device.plant.effects.registry import effect

    for text in named:
        name = text.partition(":")[0].strip()
        entry, values = effect(name), effects[name]
        shown = ", ".join(
            f"{p.name} = {values[p.name]:g} {'' if p.unit == '1' else p.unit}".rstrip()
            for p in entry.parameters
        )
        yield f"effect {name}: {shown}"
