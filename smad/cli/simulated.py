"""Options of a simulated bench, and what the commands say of its effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from smad.cli import complete
from smad.cli.options import flag, option
from smad.cli.quantity import Quantity, Whole
from smad.processes.boards import BOARDS, effect_lines
from smad.view.terminal.progress import note
from smad.view.terminal.tables import print_columns

if TYPE_CHECKING:
    from sim_device.plant.models import Model
    from smad.config import Config

FIRMWARES = "The board: " + ", ".join(f"{name} ({b.about})" for name, b in BOARDS.items()) + "."

sim_option = flag("--sim", "On a simulated bench in virtual time.")
seed_option = option("--seed", "With --sim: seed of all noise.", Whole(0, 2**32 - 1), default=0)


def effects_option(about: str) -> Any:
    """Return the option --effect, which may be repeated, of a simulated bench."""
    return option("--effect NAME[:P=V,…]", about, multiple=True, shell_complete=complete.effects)


effect_option = effects_option("With --sim: an effect that the simulated bench has.")
rate_option = option("--rate", "Samples per second.", click.Choice(["100", "250", "500"]))


def _or_listed(ctx: click.Context, _: click.Parameter, faults: Sequence[str]) -> Sequence[str]:
    if "list" in faults:
        from sim_device.faults import fault_rows

        print_columns(("fault", "group", "what happens", "parameters"), fault_rows())
        ctx.exit()
    return faults


@dataclass(frozen=True, kw_only=True)
class Boards:
    """The boards that `smad sim` runs, and `smad start --sim` begins."""

    axes: int | None = option("--axes", "Number of boards.", Whole(1, 6))
    speed: float | None = option("--speed", "Board time divided by wall time.", Quantity())
    seed: int | None = option("--seed", "Seed of all noise.", Whole(0, 2**32 - 1))
    paced_by_host: bool = flag("--paced-by-host", "The board waits for each setpoint.")
    faults: tuple[str, ...] = option(
        "--fault NAME@S[:KEY=VALUE,…]",
        "A fault to inject; smad sim --fault list lists them.",
        multiple=True,
        callback=_or_listed,
    )
    firmware: str = option("--firmware", FIRMWARES, click.Choice([*BOARDS]), default="python")
    # With --paced-by-host both ends wait so many times as long for each other.
    patience: int = option("--patience", type=Whole(1, 1000), default=1, hidden=True)
    # End when this process does.
    parent: int | None = option("--parent", type=int, hidden=True)

    def configured(self, path: Path | None, rate: str | None) -> Config:
        """The configuration of a file, else the usual one, with what is asked of the boards.

        From then on this process ends with the one that `--parent` names.
        """
        from smad.config import Config, load_config, with_changes
        from smad.processes.parent import end_with

        if self.parent is not None:
            # A program that is killed must not leave a bench behind that nobody knows how to end.
            end_with(self.parent)
        config = Config() if path is None else load_config(path)
        link = {"rate_hz": None if rate is None else int(rate)}
        plant = {"seed": self.seed, "speed_ratio": self.speed}
        return with_changes(config, link=link, plant=plant).with_axes(self.axes)


def simulated_model(
    effects: Sequence[str] = (), *, params: str = "A", model_file: Path | None = None
) -> Model:
    """Return the model of a file, else of a parameter set, with effects: NAME or NAME:P=V.

    An effect replaces the model's of that name; the values that it takes are printed. Raises
    UsageError for an effect, PlantError for the rest.
    """
    from sim_device.plant.effects.registry import from_texts
    from sim_device.plant.errors import PlantError
    from sim_device.plant.models import built_in, read_model

    base = built_in(params) if model_file is None else read_model(model_file)
    try:
        model = base.with_effects(from_texts(effects))
    except PlantError as error:
        raise click.UsageError(f"--effect: {error}") from None
    for line in effect_lines(model.effects, effects):
        note(line)
    return model
