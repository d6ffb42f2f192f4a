"""`smad gap plan`: what runs with given inputs could show, asked before a bench is heated."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.gap_print import clean_errors, params_option, plant_of, variant_option
from smad.cli.gap_runs import files
from smad.cli.gap_simulator import Simulator, warn_that_code_runs
from smad.cli.options import Command, json_option, option, together
from smad.cli.output import print_json
from smad.cli.quantity import Quantity

if TYPE_CHECKING:
    from smad.diagnosis.runs import GapRun
    from smad.diagnosis.spring_pair import SmaPlant
    from smad.simulators.planning import Plan


@click.command(cls=Command, name="plan")
def plan_runs(
    *,
    inputs: tuple[Path, ...] = option(
        "--inputs FILE…",
        str,
        "Tables or run logs with the inputs to play.",
        multiple=True,
        callback=files,
    ),
    experiments: tuple[str, ...] = option(
        "--experiment NAME", str, "A run of the spring pair, from `smad gap next`.", multiple=True
    ),
    within_s: float = option(
        "--within S", Quantity("s", 0.1, 3600.0), "Limit of the processor time.", default=5.0
    ),
    as_json: bool = json_option,
    simulator: Simulator = together(Simulator),
    params: str = params_option,
    variant: str = variant_option,
) -> None:
    """Rate what inputs could show, before measuring.

    Each parameter, effect and place is rated:

    \b
    identifiable  noticed below its typical size, and unlike any other
    weak          noticed only above its typical size, or like another
    not           nothing shows within its range, or parameters imitate it
    """
    simulator.require_pairs()
    map_path = simulator.map_path
    if not inputs and not experiments:
        raise click.UsageError("nothing would be played; give --inputs FILE or --experiment NAME")
    if map_path is not None and not simulator.given:
        raise click.UsageError("--map needs --fmu or --mjcf; give one of them")
    if experiments and map_path is not None:
        raise click.UsageError(
            "--experiment works with the spring pair only; with --map give --inputs"
        )
    with clean_errors():
        if simulator.mjcf is not None and map_path is not None:
            from smad.simulators.mjcf.asked import plan_mjcf

            planned = plan_mjcf(
                simulator.mjcf,
                map_path,
                inputs,
                window_s=simulator.window_s,
                within_s=_left_s(within_s),
            )
        elif simulator.fmu is not None and map_path is not None:
            from smad.fmi.asked import plan_unit

            warn_that_code_runs(simulator.fmu)
            planned = plan_unit(simulator.fmu, map_path, inputs, within_s=_left_s(within_s))
        else:
            from smad.simulators.planning import Plan
            from smad.simulators.rating import rate

            plant = plant_of(params, variant)
            played = _played(plant, inputs, experiments)
            planned = Plan(rate(plant, played, within_s=_left_s(within_s)), [])
    _print(planned, as_json=as_json)


def _left_s(within_s: float) -> float:
    """What of a time is left for replays; a little always is."""
    from smad.simulators.rating import LEAST_S

    return max(within_s - time.process_time(), LEAST_S)


def _played(
    plant: SmaPlant, inputs: tuple[Path, ...], experiments: tuple[str, ...]
) -> list[GapRun]:
    from smad.diagnosis.errors import GapError
    from smad.diagnosis.plant import nominal_point
    from smad.diagnosis.spring_pair.signals import read_gap_runs

    shown = [plant.perform(name, nominal_point(plant), 0) for name in experiments]
    given = read_gap_runs(inputs, inputs)
    for run in given:
        if lacking := [s.name for s in plant.inputs if s.name not in run.inputs]:
            raise GapError(
                f"{run.name} lacks inputs: {', '.join(lacking)}",
                action="name the columns of the table so",
            )
    return [*given, *shown]


def _print(planned: Plan, *, as_json: bool) -> None:
    import dataclasses

    if not as_json:
        click.echo(str(planned))
        return
    rows = [dataclasses.asdict(r) for r in planned.ratings]
    for row in rows:
        row["size"] = row["size"] if row["size"] < float("inf") else None
    print_json(rows)
