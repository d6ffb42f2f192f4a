"""Several experiments at once, in virtual time: trials spread over processes, then the analyses."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from sim_device.plant.errors import PlantError
from sim_device.plant.models import Model
from sim_device.plant.parameters import ParameterSet
from smad.config import Config, ControlConfig, load_config
from smad.experiments.base import Experiment, Findings
from smad.experiments.driver import Driver
from smad.experiments.errors import ExperimentError
from smad.experiments.estimate import Estimate, with_estimates
from smad.experiments.inverse import feedforward_of
from smad.experiments.recording import Recording
from smad.experiments.virtual import VirtualDriver
from smad.processes.parent import begin_worker, interrupts_held
from smad.progress import Say, silent
from smad.report.panels import Panels
from smad.report.planes import planes_of
from smad.report.runs import PENS


@dataclass(frozen=True)
class CampaignBench:
    """The simulated bench of a campaign: everything that a worker process needs to make it."""

    model: Model
    config: Config = field(default_factory=Config)
    seed: int = 0
    lacking: frozenset[str] = frozenset()
    folder: Path | None = None

    def driver(self, progress: Say | None = None) -> VirtualDriver:
        """A driver of this bench."""
        return VirtualDriver(**vars(self), progress=progress)


@dataclass(frozen=True)
class Result:
    """What one experiment found, and its runs as loops of one quantity against another."""

    experiment: Experiment[Any]
    findings: Findings
    loops: Panels | None = None


@dataclass(frozen=True)
class CampaignResult:
    """All results, and the parameter set with everything that was recovered."""

    results: tuple[Result, ...]
    estimates: tuple[Estimate, ...]
    recovered: ParameterSet


def run_campaign(
    experiments: Sequence[Experiment[Any]],
    bench: CampaignBench,
    executor: Executor | None = None,
    progress: Say = silent,
) -> CampaignResult:
    """Run the experiments on the simulated bench and analyse them against its model.

    Trials go to `executor` (a process pool, or anything that looks like one); without one they run
    here. What is lacking is found before anything runs. Raises BenchLacksError and ExperimentError.
    """
    for experiment in experiments:
        experiment.check(bench.driver())
    outcomes = (
        _one_by_one(experiments, lambda: bench.driver(progress), progress)
        if executor is None
        else _conduct_there(experiments, bench, executor, progress)
    )
    return conclude_all(experiments, outcomes, bench.model.parameters)


def configured(model: Model, path: Path | None) -> Config:
    """The configuration of a file, else the usual one with the inverse of the simulated model."""
    if path is not None:
        return load_config(path)
    return Config(
        control=ControlConfig(feedforward=feedforward_of(model.parameters, model.variant))
    )


def run_here(
    experiments: Sequence[Experiment[Any]], bench: CampaignBench, jobs: int | None, progress: Say
) -> CampaignResult:
    """As `run_campaign`, with `jobs` processes of this computer; None: one a core."""
    trials = sum(len(experiment.trials()) for experiment in experiments)
    processes = min(jobs or os.cpu_count() or 1, trials)
    if processes == 1:
        return run_campaign(experiments, bench, progress=progress)
    with ProcessPoolExecutor(
        processes, get_context("spawn"), initializer=begin_worker, initargs=(os.getpid(),)
    ) as pool:
        return run_campaign(experiments, bench, pool, progress)


def run_on(
    experiments: Sequence[Experiment[Any]],
    driver: Driver,
    model: ParameterSet,
    progress: Say = silent,
) -> CampaignResult:
    """The same, one after the other on one driver, such as a real bench."""
    for experiment in experiments:
        experiment.check(driver)
    return conclude_all(experiments, _one_by_one(experiments, lambda: driver, progress), model)


def conclude_all(
    experiments: Sequence[Experiment[Any]],
    outcomes: Mapping[str, Mapping[str, Any]],
    model: ParameterSet,
) -> CampaignResult:
    """Analyse the outcomes, each experiment with what the ones before it have recovered.

    A later estimate of the same parameter replaces an earlier one. Raises ExperimentError, naming
    the experiment, when the model cannot replay a run or the estimates make no parameter set.
    """
    estimates: dict[str, Estimate] = {}
    results = []
    current = model
    for experiment in experiments:
        try:
            findings = experiment.conclude(outcomes[experiment.name], current)
            estimates.update({estimate.name: estimate for estimate in findings.estimates})
            if findings.estimates:
                current = with_estimates(
                    model, list(estimates.values()), f"Recovered, starting from: {model.title}"
                )
        except PlantError as error:
            raise ExperimentError(
                f"{experiment.name} cannot be analysed with this model: {error}",
                action="check the run, the data file and the parameter file",
            ) from None
        results.append(Result(experiment, findings, _loops(outcomes[experiment.name])))
    return CampaignResult(tuple(results), tuple(estimates.values()), current)


def _loops(outcomes: Mapping[str, Any]) -> Panels | None:
    """The recordings among the outcomes, each from its own beginning; None where nothing moves."""
    runs = [
        (trial.rpartition("/")[2], f"run-{number % PENS + 1}", run.t_s - run.t_s[0], run.columns)
        for number, (trial, run) in enumerate(outcomes.items())
        if isinstance(run, Recording)
    ]
    planes = planes_of(runs)
    return Panels((), planes=planes) if planes else None


def time_left(done: int, total: int, took_s: float) -> str:
    """Return how long the rest may take, at the pace so far; empty before the first is done."""
    if not 0 < done < total:
        return ""
    rest_s = took_s / done * (total - done)
    return (
        f"; about {rest_s:.0f} s left" if rest_s < 120.0 else f"; about {rest_s / 60:.0f} min left"
    )


def _conduct_one(experiment: Experiment[Any], trial: str, bench: CampaignBench) -> Any:
    return experiment.conduct(trial, bench.driver())


def _one_by_one(
    experiments: Sequence[Experiment[Any]], driver: Callable[[], Driver], progress: Say
) -> dict[str, dict[str, Any]]:
    outcomes: dict[str, dict[str, Any]] = {}
    total, began_s = sum(len(e.trials()) for e in experiments), time.monotonic()
    for experiment in experiments:
        done = outcomes.setdefault(experiment.name, {})
        for trial in experiment.trials():
            count = sum(map(len, outcomes.values()))
            rest = time_left(count, total, time.monotonic() - began_s)
            progress(f"run {count + 1} of {total}: {trial}{rest}")
            done[trial] = experiment.conduct(trial, driver())
    return outcomes


def _conduct_there(
    experiments: Sequence[Experiment[Any]], bench: CampaignBench, executor: Executor, progress: Say
) -> dict[str, dict[str, Any]]:
    # The experiment with the most trials first: its long ones would otherwise be left at the end.
    order = sorted(experiments, key=lambda experiment: -len(experiment.trials()))
    with interrupts_held():
        places = {
            executor.submit(_conduct_one, experiment, trial, bench): (experiment.name, trial)
            for experiment in order
            for trial in experiment.trials()
        }
    outcomes: dict[str, dict[str, Any]] = {experiment.name: {} for experiment in experiments}
    began_s = time.monotonic()
    try:
        for count, future in enumerate(as_completed(places), 1):
            name, trial = places[future]
            outcomes[name][trial] = future.result()
            rest = time_left(count, len(places), time.monotonic() - began_s)
            progress(f"{count} of {len(places)} runs done, last {trial}{rest}")
    except BrokenExecutor as error:
        raise ExperimentError(
            "a process that simulates runs was killed",
            action="if memory was short, take fewer of them (--jobs 1)",
        ) from error
    finally:
        for future in places:
            future.cancel()
    return outcomes
