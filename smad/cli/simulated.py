"""Options of a simulated bench, and what the commands say of its effects."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli import complete
from smad.cli.output import F, note
from smad.cli.quantity import Whole
from smad.errors import SmadError
from smad.processes.boards import BOARDS

if TYPE_CHECKING:
    from sim_device.plant.models import Model

FIRMWARES = "the board: " + ", ".join(f"{name} ({b.about})" for name, b in BOARDS.items()) + "."

sim_option = click.option("--sim", is_flag=True, help="On a simulated bench in virtual time.")


def effects_option(about: str) -> Callable[[F], F]:
    """Return the option --effect, which may be repeated, of a simulated bench."""
    return click.option(
        "--effect",
        "effects",
        multiple=True,
        metavar="NAME[:P=V,…]",
        shell_complete=complete.effects,
        help=about,
    )


effect_option = effects_option("With --sim: an effect that the simulated bench has.")


def board_options(lead: str) -> Callable[[F], F]:
    """Return the options of the boards that `smad sim` runs, and `smad start --sim` begins.

    `lead` begins the help of each.
    """

    def about(text: str) -> str:
        return lead + text if lead else text[0].upper() + text[1:]

    number = Whole(0, 2**32 - 1)
    options = (
        click.option(
            "--rate", type=click.Choice(["100", "250", "500"]), help="Samples per second."
        ),
        click.option("--axes", type=Whole(1, 6), help=about("number of boards.")),
        click.option("--speed", type=float, help=about("board time over wall time.")),
        click.option("--seed", type=number, help=about("seed of all noise.")),
        click.option(
            "--paced-by-host", is_flag=True, help=about("the board waits for each setpoint.")
        ),
        click.option(
            "--fault",
            "faults",
            multiple=True,
            metavar="NAME@S[:KEY=VALUE,…]",
            help=about("a fault to inject; smad sim --fault list lists them."),
        ),
        click.option(
            "--firmware",
            type=click.Choice([*BOARDS]),
            default="python",
            help=about(FIRMWARES),
        ),
        # With --paced-by-host both ends wait so many times as long for each other.
        click.option("--patience", type=Whole(1, 1000), default=1, hidden=True),
        # End when this process does.
        click.option("--parent", type=int, hidden=True),
    )

    def add(command: F) -> F:
        return functools.reduce(lambda made, option: option(made), reversed(options), command)

    return add


seed_option = click.option(
    "--seed", type=Whole(0, 2**32 - 1), default=0, help="With --sim: seed of all noise."
)


def require_sim(effects: Iterable[str], *, sim: bool) -> None:
    """Raise UsageError for effects of a bench that is not simulated."""
    if effects and not sim:
        raise click.UsageError("--effect needs a simulated bench; add --sim")


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
