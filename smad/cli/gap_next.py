"""`smad gap next`: the experiment that best separates what runs leave confused, and its run."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.gap_print import SpringPair, print_verdict, require_answered
from smad.cli.gap_runs import (
    ManyRuns,
    good_option,
    hold_out_option,
    some_runs_argument,
    without_cut_runs,
)
from smad.cli.gap_simulator import map_option
from smad.cli.options import EXISTING, FOLDER, PATH, bench_option, flag, option, together
from smad.cli.output import ready_client
from smad.cli.quantity import Whole
from smad.cli.simulated import effect_option, simulated_model
from smad.files import display_path
from smad.view.terminal.progress import progress

if TYPE_CHECKING:
    from sim_device.plant.models import Model


@click.command(name="next", cls=ManyRuns)
def next_experiment(
    *,
    runs: tuple[Path, ...] = some_runs_argument,
    hold_out: tuple[Path, ...] = hold_out_option,
    good: tuple[Path, ...] = good_option,
    map_path: Path | None = map_option,
    chosen: str | None = option(
        "--run NAME", "Carry out this experiment now: arms the bench and heats it."
    ),
    baseline: Path | None = option(
        "--baseline", "Recommend a run to repeat after a check-up, in place of RUNs.", FOLDER
    ),
    sim: bool = flag("--sim", "With --run: in virtual time instead of on the bench."),
    model_path: Path | None = option(
        "--model", "With --sim: model of the simulated bench.", EXISTING
    ),
    effects: tuple[str, ...] = effect_option,
    folder: Path = option(
        "--folder", "With --sim: where the run log goes.", PATH, default=Path("runs")
    ),
    bench: str = bench_option,
    pair: SpringPair = together(SpringPair),
    seed: int = option(
        "--seed",
        "With --run: seed of random inputs, with --sim of all noise, too.",
        Whole(0, 2**32 - 1),
        default=0,
    ),
) -> None:
    """Recommend the experiment to record next, or run one.

    It recommends the experiment that best separates the causes that RUNs leave possible. Without
    RUNs it lists the catalogue. --run carries out an experiment of the catalogue and writes a log.
    """
    if chosen is not None and runs:
        raise click.UsageError("--run carries an experiment out; give RUNs without it")
    if (hold_out or good or map_path) and not runs:
        raise click.UsageError("--hold-out, --good and --map need RUNs; give runs to diagnose")
    if baseline is not None:
        if runs or chosen is not None:
            raise click.UsageError("--baseline has its own runs; give neither RUNs nor --run")
        _propose(baseline)
        return
    if chosen is not None:
        model = None
        if sim:
            model = simulated_model(effects, params=pair.params, model_file=model_path)
            if model_path is None:
                model = dataclasses.replace(model, variant=pair.variant)
        _carry_out(chosen, seed, model, folder, bench=bench)
        return
    if not runs:
        from smad.diagnosis.spring_pair.catalogue import catalogue_lines

        click.echo("\n".join(catalogue_lines()))
        return
    from smad.diagnosis.next_run import offer_lines, offers

    answer = pair.diagnose(runs, without_cut_runs(good), hold_out, map_path=map_path)
    print_verdict(answer.verdict)
    require_answered(answer.verdict)
    with progress() as line:
        confused, ranked = offers(answer, line.say)
    click.echo("\n".join(offer_lines(confused, ranked)))


def _propose(folder: Path) -> None:
    """Say what an investigation would play next, after the newest check-up or investigation."""
    from smad.checkup.check import proposed
    from smad.diagnosis.spring_pair import SmaPlant

    with progress() as line:
        judgement, proposal = proposed(folder, SmaPlant(), line.say)
    click.secho(judgement.verdict.headline, bold=True)
    click.echo("\n".join(proposal.lines()))


def _carry_out(name: str, seed: int, model: Model | None, folder: Path, *, bench: str) -> None:
    """Carry an experiment out: on the simulated bench of a model, else on that of the daemon."""
    from smad.checkup.play import LEASE_S
    from smad.diagnosis.spring_pair.catalogue import plan_named
    from smad.experiments.live import LiveDriver
    from smad.experiments.virtual import VirtualDriver

    plan = plan_named(name, seed)
    if model is None:
        with ready_client(bench, extra="gap") as connected, progress() as line:
            driver = LiveDriver(connected, who="smad gap next", lease_s=LEASE_S, progress=line.say)
            driver.run(plan)
        click.echo(f"done: {name}, recorded to {display_path(driver.log or plan.name)}")
        return
    if seed:
        plan = dataclasses.replace(plan, name=f"{plan.name} {seed}")
    with progress() as line:
        path = VirtualDriver(model, seed=seed, folder=folder, progress=line.say).record(
            plan, "give another --folder or --seed, or move it away"
        )
    click.echo(f"done: {path}")
