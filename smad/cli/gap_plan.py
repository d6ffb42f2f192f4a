"""`smad gap plan`: what runs with given inputs could show, asked before a bench is heated."""

from pathlib import Path

import click

from smad.cli.gap_print import SpringPair
from smad.cli.gap_runs import ManyRuns, files
from smad.cli.gap_simulator import Simulator
from smad.cli.options import json_option, option, together
from smad.cli.output import print_json
from smad.cli.quantity import Quantity
from smad.view.terminal.progress import progress


@click.command(cls=ManyRuns, name="plan")
def plan_runs(
    *,
    inputs: tuple[Path, ...] = option(
        "--inputs FILE…",
        "Tables or run logs with the inputs to play.",
        multiple=True,
        callback=files,
    ),
    experiments: tuple[str, ...] = option(
        "--experiment NAME",
        "Without --fmu or --mjcf: a run of the spring pair, from `smad gap next`.",
        multiple=True,
    ),
    within_s: float = option(
        "--within S", "Limit of the processor time.", Quantity("s", 0.1, 3600.0), default=5.0
    ),
    as_json: bool = json_option,
    simulator: Simulator = together(Simulator),
    pair: SpringPair = together(SpringPair),
) -> None:
    """Rate what inputs could show, before measuring.

    Each parameter, effect and place is rated:

    \b
    identifiable  noticed below its typical size, and unlike any other
    weak          noticed only above its typical size, or like another
    not           nothing shows within its range, or parameters imitate it
    unknown       no time was left for it, or the model gave no numbers
    """
    from smad.simulators.planning import left_of, plan_pair

    if not inputs and not experiments:
        raise click.UsageError("nothing would be played; give --inputs FILE or --experiment NAME")
    if simulator.map_path is not None and not simulator.given:
        raise click.UsageError("--map needs --fmu or --mjcf; give one of them")
    with progress() as line:
        if simulator.given:
            planned = simulator.plan(inputs, left_of(within_s), line.say)
        else:
            plant = pair.plant()
            planned = plan_pair(plant, inputs, experiments, within_s=within_s, progress=line.say)
    if as_json:
        print_json(planned.record())
    else:
        click.echo(str(planned))
