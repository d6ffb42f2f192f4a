"""`smad run`: the experiments of the paper, in virtual time or on a running daemon."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    together,
)
from smad.cli.output import print_json, ready_client
from smad.cli.quantity import Whole
from smad.cli.simulated import seed_option, simulated_model
from smad.view.terminal.progress import progress
from smad.view.terminal.tables import print_columns, print_table

if TYPE_CHECKING:
    from sim_device.plant.models import Model
    from smad.experiments.base import Experiment
    from smad.experiments.campaign import CampaignResult


class _Run(Command):
    """The command, and others under its name: `smad run repeat`, `smad run six-axes`."""

    def make_context(
        self, info_name: Any, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        """Return the context of the one that is meant."""
        if args and args[0] in RUN_COMMANDS:
            name = args[0].replace("-", "_")
            other: click.Command = getattr(importlib.import_module(RUN_COMMANDS[args[0]]), name)
            return other.make_context(f"{info_name} {args[0]}", args[1:], parent, **extra)
        return super().make_context(info_name, args, parent, **extra)


@dataclass(frozen=True, kw_only=True)
class _Campaign:
    """What the experiments run on, and what is written."""

    sim: bool = flag("--sim", "In virtual time, on a simulated bench.")
    parameters: str = option(
        "--parameters",
        "Parameter file (or A, B, conserving) of the simulated bench, also for comparison.",
        default="A",
    )
    model: Path | None = option(
        "--model",
        "Model file of the diagnosis: parameters, variant and effects of the simulated bench.",
        FILE,
    )
    settings: tuple[str, ...] = option(
        "--set [EXPERIMENT.]KEY=VALUE",
        "Change a setting of an experiment; may be repeated.",
        multiple=True,
    )
    config_file: Path | None = option(
        "--config",
        "With --sim: configuration of the control in virtual time, as for `smad start`.",
        FILE,
    )
    seed: int = seed_option
    jobs: int | None = option(
        "--jobs", "With --sim: processes; by default one a core.", Whole(1, 256)
    )
    logs: tuple[Path, ...] = option(
        "--from",
        "Without --sim: analyse these run logs instead of running anything; may be repeated.",
        FILE,
        multiple=True,
    )
    fixture: str = option(
        "--fixture",
        "Without --sim or --from: how the springs of the bench are mounted.",
        click.Choice(["antagonistic", "stretch", "blocked"]),
        default="antagonistic",
    )
    air: bool = flag("--air", "Without --sim or --from: the bench has no tubes mounted.")
    lacking: tuple[str, ...] = option(
        "--lacking PART",
        "With --sim: remove a sensor (a channel such as force_N) of the bench; may be repeated.",
        multiple=True,
    )
    report: Path | None = option(
        "--report",
        "Page to write [default: experiments.html; experiments-2.html and so on if it exists]",
        OUTPUT,
    )
    save_parameters: Path | None = option(
        "--save-parameters", "Write the recovered parameters to this parameter file.", OUTPUT
    )
    save_logs: Path | None = option(
        "--save-logs", "With --sim, write the run logs into this folder.", FOLDER
    )
    feedforward: bool = flag(
        "--feedforward", "Only print the section [control.feedforward] for --parameters."
    )
    lease: float = lease_option
    bench: str = axis_option

    def carried_out(self, experiments: list[Experiment[Any]], model: Model) -> CampaignResult:
        """Carry the experiments out on run logs, in virtual time or on the daemon's bench."""
        from smad.experiments.campaign import CampaignBench, configured, run_here, run_on
        from smad.experiments.live import LiveDriver
        from smad.experiments.logs import LogDriver

        if self.logs:
            return run_on(experiments, LogDriver(self.logs), model.parameters)
        if self.sim:
            config = configured(model, self.config_file)
            bench = CampaignBench(model, config, self.seed, frozenset(self.lacking), self.save_logs)
            with progress() as line:
                return run_here(experiments, bench, self.jobs, line.say)
        with ready_client(self.bench, extra="report") as connected, progress() as line:
            live: dict[str, Any] = {"who": "smad run", "lease_s": self.lease, "progress": line.say}
            live |= {"fixture": self.fixture, "cooling": "air" if self.air else "water"}
            return run_on(experiments, LiveDriver(connected, **live), model.parameters, line.say)

    def fact(self, model: Model) -> tuple[str, str]:
        """Return what was run on, for the page."""
        if self.logs:
            return "logs", str(len(self.logs))
        return "bench", f"simulated, {model.variant}, seed {self.seed}" if self.sim else self.bench


@click.command(cls=_Run)
def run(
    *,
    names: tuple[str, ...] = argument(
        nargs=-1, metavar="NAME…|all", shell_complete=complete.experiments
    ),
    listing: bool = flag("--list", "Show the experiments and what each needs."),
    as_json: bool = json_option,
    campaign: _Campaign = together(_Campaign),
) -> None:
    """Run experiments of the paper, analyse them, and write one page.

    NAME is an experiment, `all` is all of them. Without --sim they run on the bench of the
    running daemon, and arm it.

    Also, each with its own --help: `smad run repeat RUN` plays the inputs of a recorded run again,
    `smad run six-axes` draws circles with the segments of a robot, `smad run moves FILE` plays the
    trajectories of a file, `smad run endurance` cycles until a limit ends it.
    """
    from smad.experiments import report as reports
    from smad.experiments.inverse import feedforward_section
    from smad.experiments.ready import require_ready
    from smad.experiments.registry import chosen_experiments
    from smad.runlog.paths import free_path

    if listing:
        _print_list(as_json=as_json)
        return
    model = simulated_model(params=campaign.parameters, model_file=campaign.model)
    nominal = model.parameters
    if campaign.feedforward:
        click.echo(feedforward_section(nominal, model.variant), nl=False)
        return
    experiments = chosen_experiments(names, campaign.settings)
    page = campaign.report or free_path(Path("experiments.html"))
    require_ready(extra="report", outputs=[page, campaign.save_parameters])
    result = campaign.carried_out(experiments, model)
    truth = nominal if campaign.sim and not campaign.logs else None
    files = reports.write_campaign(
        result, nominal, page, campaign.save_parameters, given=truth, facts=[campaign.fact(model)]
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
