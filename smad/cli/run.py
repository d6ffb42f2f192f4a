"""`smad run`: the experiments of the paper, in virtual time or on a running daemon."""

import importlib
from pathlib import Path
from typing import Any

import click

from smad.cli import complete
from smad.cli.complete import RUN_COMMANDS
from smad.cli.options import (
    FILE,
    FOLDER,
    OUTPUT,
    Command,
    argument,
    axis_option,
    flag,
    json_option,
    lease_option,
    option,
)
from smad.cli.output import print_json, ready_client
from smad.cli.quantity import Whole
from smad.cli.simulated import seed_option, simulated_model
from smad.view.terminal.progress import progress
from smad.view.terminal.tables import print_columns, print_table


class _Run(Command):
    """The command, and others under its name: `smad run repeat`, `smad run six-axes`."""

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,
    ) -> click.Context:
        """Return the context of the one that is meant."""
        if args and args[0] in RUN_COMMANDS:
            name = args[0].replace("-", "_")
            other: click.Command = getattr(importlib.import_module(RUN_COMMANDS[args[0]]), name)
            return other.make_context(f"{info_name} {args[0]}", args[1:], parent, **extra)
        return super().make_context(info_name, args, parent, **extra)


@click.command(cls=_Run)
def run(
    *,
    names: tuple[str, ...] = argument(
        nargs=-1, metavar="NAME…|all", shell_complete=complete.experiments
    ),
    listing: bool = flag("--list", "Show the experiments and what each needs."),
    as_json: bool = json_option,
    sim: bool = flag("--sim", "In virtual time, on a simulated bench."),
    parameters: str = option(
        "--parameters",
        "Parameter file (or A, B, conserving) of the simulated bench, also for comparison.",
        default="A",
    ),
    model: Path | None = option(
        "--model",
        "Model file of the diagnosis: parameters, variant and effects of the simulated bench.",
        FILE,
    ),
    settings: tuple[str, ...] = option(
        "--set [EXPERIMENT.]KEY=VALUE",
        "Change a setting of an experiment; may be repeated.",
        multiple=True,
    ),
    config_file: Path | None = option(
        "--config",
        "With --sim: configuration of the control in virtual time, as for `smad start`.",
        FILE,
    ),
    seed: int = seed_option,
    jobs: int | None = option(
        "--jobs", "With --sim: processes; by default one a core.", Whole(1, 256)
    ),
    logs: tuple[Path, ...] = option(
        "--from",
        "Without --sim: analyse these run logs instead of running anything; may be repeated.",
        FILE,
        multiple=True,
    ),
    fixture: str = option(
        "--fixture",
        "Without --sim or --from: how the springs of the bench are mounted.",
        click.Choice(["antagonistic", "stretch", "blocked"]),
        default="antagonistic",
    ),
    air: bool = flag("--air", "Without --sim or --from: the bench has no tubes mounted."),
    lacking: tuple[str, ...] = option(
        "--lacking PART",
        "With --sim: remove a sensor (a channel such as force_N) of the bench; may be repeated.",
        multiple=True,
    ),
    report: Path | None = option(
        "--report",
        "Page to write [default: experiments.html; experiments-2.html and so on if it exists]",
        OUTPUT,
    ),
    save_parameters: Path | None = option(
        "--save-parameters", "Write the recovered parameters to this parameter file.", OUTPUT
    ),
    save_logs: Path | None = option(
        "--save-logs", "With --sim, write the run logs into this folder.", FOLDER
    ),
    feedforward: bool = flag(
        "--feedforward", "Only print the section [control.feedforward] for --parameters."
    ),
    lease: float = lease_option,
    bench: str = axis_option,
) -> None:
    """Run experiments of the paper, analyse them, and write one page.

    NAME is an experiment, `all` is all of them. Without --sim they run on the bench of the
    running daemon, and arm it.

    Also, each with its own --help: `smad run repeat RUN` plays the inputs of a recorded run again,
    `smad run six-axes` draws circles with the segments of a robot, `smad run moves FILE` plays the
    trajectories of a file, `smad run endurance` cycles until a limit ends it.
    """
    from smad.experiments import report as reports
    from smad.experiments.campaign import CampaignBench, configured, run_here, run_on
    from smad.experiments.inverse import feedforward_section
    from smad.experiments.live import LiveDriver
    from smad.experiments.logs import LogDriver
    from smad.experiments.ready import require_ready
    from smad.experiments.registry import chosen_experiments
    from smad.runlog.paths import free_path

    if listing:
        _print_list(as_json=as_json)
        return
    bench_model = simulated_model(params=parameters, model_file=model)
    nominal = bench_model.parameters
    if feedforward:
        click.echo(feedforward_section(nominal, bench_model.variant), nl=False)
        return
    experiments = chosen_experiments(names, settings)
    page = report or free_path(Path("experiments.html"))
    require_ready(extra="report", outputs=[page, save_parameters])
    if logs:
        facts = ("logs", str(len(logs)))
        result = run_on(experiments, LogDriver(logs), nominal)
    elif sim:
        facts = ("bench", f"simulated, {bench_model.variant}, seed {seed}")
        simulated = CampaignBench(
            bench_model, configured(bench_model, config_file), seed, frozenset(lacking), save_logs
        )
        with progress() as line:
            result = run_here(experiments, simulated, jobs, line.say)
    else:
        facts = ("bench", bench)
        with ready_client(bench, extra="report") as connected, progress() as line:
            live: dict[str, Any] = {"who": "smad run", "lease_s": lease, "progress": line.say}
            live |= {"fixture": fixture, "cooling": "air" if air else "water"}
            driver = LiveDriver(connected, **live)
            result = run_on(experiments, driver, nominal, line.say)
    truth = nominal if sim and not logs else None
    files = reports.write_campaign(
        result, nominal, page, save_parameters, given=truth, facts=[facts]
    )
    if as_json:
        print_json({**reports.campaign_records(result, truth), **files})
        return
    print_table(reports.comparison_table(result))
    if result.estimates:
        print_table(reports.recovery_table(result.estimates, nominal, truth))
    for name, path in files.items():
        click.echo(f"{name}  {path}")


def _print_list(*, as_json: bool) -> None:
    from smad.cli.robot import TITLE
    from smad.experiments.registry import experiment_summaries

    summaries = experiment_summaries()
    if as_json:
        print_json(summaries)
        return
    rows = [(e.name, e.title, e.needs_in_words) for e in summaries]
    print_columns(("name", "what", "needs"), [*rows, ("six-axes", TITLE, "several axes")])
