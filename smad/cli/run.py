"""`smad run`: the experiments of the paper, in virtual time or on a running daemon."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from smad.cli import complete
from smad.cli.output import (
    FILE,
    FOLDER,
    OUTPUT,
    axis_option,
    json_option,
    lease_option,
    leased_driver,
    print_json,
    progress,
    ready_client,
    require_outputs,
)
from smad.cli.quantity import Whole
from smad.cli.simulated import seed_option, simulated_model
from smad.files import named_output

if TYPE_CHECKING:
    from sim_device.plant.models import Model
    from sim_device.plant.parameters import ParameterSet
    from smad.experiments.base import Experiment
    from smad.experiments.campaign import CampaignResult

_OTHERS = {
    "repeat": "smad.cli.repeat",
    "six-axes": "smad.cli.six_axes",
    "moves": "smad.cli.run_moves",
    "endurance": "smad.cli.run_endurance",
}
"""Commands under the name of this one, and their modules."""


class _Run(click.Command):
    """The command, and others under its name: `smad run repeat`, `smad run six-axes`."""

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,
    ) -> click.Context:
        """Return the context of the one that is meant."""
        if args and args[0] in _OTHERS:
            name = args[0].replace("-", "_")
            other: click.Command = getattr(importlib.import_module(_OTHERS[args[0]]), name)
            return other.make_context(f"{info_name} {args[0]}", args[1:], parent, **extra)
        return super().make_context(info_name, args, parent, **extra)


@click.command(cls=_Run)
@click.argument("names", nargs=-1, metavar="NAME…|all", shell_complete=complete.experiments)
@click.option("--list", "listing", is_flag=True, help="Show the experiments and what each needs.")
@json_option
@click.option("--sim", is_flag=True, help="In virtual time, on a simulated bench.")
@click.option(
    "--parameters",
    default="A",
    help="Parameter file (or A, B, conserving): of the simulated bench, and to compare with.",
)
@click.option(
    "--model",
    type=FILE,
    help="Model file of the diagnosis: parameters, variant and effects of the simulated bench.",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="[EXPERIMENT.]KEY=VALUE",
    help="Change a setting of an experiment; may be repeated.",
)
@click.option(
    "--config",
    "config_file",
    type=FILE,
    help="Configuration of the control in virtual time, as for `smad start`.",
)
@seed_option
@click.option("--jobs", type=Whole(1, 256), help="Processes for --sim; by default one a core.")
@click.option(
    "--from",
    "logs",
    multiple=True,
    type=FILE,
    help="Analyse these run logs instead of running anything; may be repeated.",
)
@click.option(
    "--fixture",
    type=click.Choice(["antagonistic", "stretch", "blocked"]),
    default="antagonistic",
    help="How the springs of the real bench are mounted.",
)
@click.option("--air", is_flag=True, help="The real bench has no tubes mounted.")
@click.option(
    "--lacking",
    multiple=True,
    metavar="PART",
    help="Remove a sensor (a channel such as force_N) of the simulated bench; may be repeated.",
)
@click.option(
    "--report",
    type=OUTPUT,
    help="Page to write [default: experiments.html; experiments-2.html and so on if it exists]",
)
@click.option(
    "--save-parameters", type=OUTPUT, help="Write the recovered parameters to this parameter file."
)
@click.option("--save-logs", type=FOLDER, help="With --sim, write the run logs into this folder.")
@click.option(
    "--feedforward",
    is_flag=True,
    help="Only print the section [control.feedforward] for --parameters.",
)
@lease_option
@axis_option
def run(names: tuple[str, ...], **options: Any) -> None:
    """Run experiments of the paper, analyse them, and write one page.

    NAME is an experiment, `all` is all of them. Without --sim they run on the bench of the
    running daemon, and arm it.

    Also, each with its own --help: `smad run repeat RUN` plays the inputs of a recorded run again,
    `smad run six-axes` draws circles with the segments of a robot, `smad run moves FILE` plays the
    trajectories of a file, `smad run endurance` cycles until a limit ends it.
    """
    from smad.experiments.ready import require_ready
    from smad.experiments.registry import chosen_experiments
    from smad.runlog.paths import free_path

    if options["listing"]:
        _print_list(as_json=options["as_json"])
        return
    require_outputs()
    given = simulated_model(params=options["parameters"], model_file=options["model"])
    model = given.parameters
    if options["feedforward"]:
        from smad.experiments.inverse import feedforward_section

        click.echo(feedforward_section(model, given.variant), nl=False)
        return
    experiments = chosen_experiments(names, options["settings"])
    if options["report"] is None:
        options["report"] = free_path(Path("experiments.html"))
    require_ready(extra="report", outputs=[options["report"], options["save_parameters"]])
    if options["logs"]:
        result, facts = _from_logs(experiments, model, options["logs"])
    elif options["sim"]:
        result, facts = _simulated(experiments, given, options)
    else:
        result, facts = _live(experiments, model, options)
    _finish(result, model, facts, options)


def _print_list(*, as_json: bool) -> None:
    from smad.cli.six_axes import TITLE
    from smad.cli.tables import print_table
    from smad.experiments.driver import PARTS
    from smad.experiments.registry import EXPERIMENTS, make_experiment
    from smad.report.page import Table

    experiments = [make_experiment(name) for name in EXPERIMENTS]
    if as_json:
        print_json(
            [
                {"name": e.name, "title": e.title, "needs": sorted(e.requirements())}
                for e in experiments
            ]
        )
        return
    rows = []
    for experiment in experiments:
        needs = [PARTS[part] for part in sorted(experiment.requirements())]
        rows.append((experiment.name, experiment.title, ", ".join(needs) or "a data file"))
    rows.append(("six-axes", TITLE, "several axes"))
    print_table(Table(("name", "what", "needs"), rows))


Facts = list[tuple[str, str]]


def _simulated(
    experiments: Sequence[Experiment[Any]], given: Model, options: dict[str, Any]
) -> tuple[CampaignResult, Facts]:
    from smad.config import load_config
    from smad.experiments.campaign import CampaignBench, run_here, usual_config

    file = options["config_file"]
    bench = CampaignBench(
        given,
        config=usual_config(given) if file is None else load_config(file),
        seed=options["seed"],
        lacking=frozenset(options["lacking"]),
        folder=options["save_logs"],
    )
    facts = [("bench", f"simulated, {given.variant}, seed {options['seed']}")]
    with progress() as line:
        return run_here(experiments, bench, options["jobs"], line.say), facts


def _live(
    experiments: Sequence[Experiment[Any]], model: ParameterSet, options: dict[str, Any]
) -> tuple[CampaignResult, Facts]:
    from smad.experiments.campaign import run_on

    with ready_client(options["bench"], extra="report") as connected, progress() as line:
        mounted = {"fixture": options["fixture"], "cooling": "air" if options["air"] else "water"}
        driver = leased_driver(connected, "smad run", options["lease"], line.say, **mounted)
        try:
            result = run_on(experiments, driver, model, line.say)
        finally:
            connected.disarm()
    return result, [("bench", options["bench"])]


def _from_logs(
    experiments: Sequence[Experiment[Any]], model: ParameterSet, logs: Sequence[Path]
) -> tuple[CampaignResult, Facts]:
    from smad.experiments.campaign import run_on
    from smad.experiments.logs import LogDriver

    return run_on(experiments, LogDriver(logs), model), [("logs", str(len(logs)))]


def _finish(
    result: CampaignResult, model: ParameterSet, facts: Facts, options: dict[str, Any]
) -> None:
    from sim_device.plant.parameters import parameters_text
    from smad.experiments.report import campaign_page, campaign_records
    from smad.report.page import write_page

    given = model if options["sim"] and not options["logs"] else None
    page = write_page(campaign_page(result, model, given=given, facts=facts), options["report"])
    files = {"page": str(page)}
    if options["save_parameters"] is not None:
        with named_output(options["save_parameters"]) as partial:
            partial.write_text(parameters_text(result.recovered))
        files["parameters"] = str(options["save_parameters"])
    if options["as_json"]:
        print_json({**campaign_records(result, given), **files})
        return
    _print_tables(result, model, given)
    for name, path in files.items():
        click.echo(f"{name}  {path}")


def _print_tables(result: CampaignResult, model: ParameterSet, given: ParameterSet | None) -> None:
    from smad.cli.tables import print_table
    from smad.experiments.report import comparison_table, recovery_table

    print_table(comparison_table(result))
    if result.estimates:
        print_table(recovery_table(result.estimates, model, given))
