"""More runs of a case's bench, under experiments of the catalogue, and the case asked again.

The experiment is simulated with the nominal model first, and the currents and duties that come out
are the program that the case's own bench is given, whatever is wrong with it.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from smad.gap.check.case import Part, Task, diagnosed
from smad.gap.check.names import OUTCOMES
from smad.gap.check.verdicts import CaseVerdict, NextExperiment
from smad.gap.plant import ModelPoint
from smad.gap.records import Diagnosis, Outcome
from smad.gap.sma import SmaPlant
from smad.gap.sma.signals import table_run
from tests.withheld.second_pass import Frozen, part_of

_COLUMNS = {
    "i_x_A": "i_applied_x_A",
    "i_y_A": "i_applied_y_A",
    "duty_x": "duty_x",
    "duty_y": "duty_y",
}
Follow = Callable[[str, Path, Path, int], None]
"""Records a case's bench under a program: case, program file, run file to write, its number."""
Ask = Callable[[Task, Mapping[str, Sequence[Path]]], Part]
"""Asks for a case once more, with the runs that were recorded: case → run files."""


def write_program(plant: SmaPlant, experiment: str, seed: int, path: Path) -> None:
    """The program file of an experiment of the catalogue, as `follow` reads it."""
    run = plant.perform(experiment, ModelPoint({}), seed)
    columns = [run.t_s - run.t_s[0], *(run.inputs[n] for n in _COLUMNS.values())]
    head = ",".join(("t_s", *_COLUMNS))
    partial = path.with_name(path.name + ".part")
    np.savetxt(
        partial, np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.6f"
    )
    partial.replace(path)


def names_after(found: Diagnosis) -> list[str]:
    """The effects a verdict leaves standing: one group, or nothing."""
    verdict = found.verdict
    if verdict.outcome is Outcome.AMBIGUOUS:
        return [*verdict.effects, *verdict.group]
    named = verdict.outcome in (Outcome.EFFECT, Outcome.PLUS_REST)
    return list(verdict.effects) if named else []


def judge_again(task: Task, runs: Mapping[str, Sequence[Path]]) -> Part:
    """The case with the runs of the recommended experiments beside those to fit on."""

    def say() -> CaseVerdict:
        files = runs[task.case.id]
        more = [table_run(f"next-{i + 1}", p) for i, p in enumerate(files)]
        found = diagnosed(task, task.how, more)
        said = NextExperiment("", names_after=names_after(found))
        return CaseVerdict(outcome=OUTCOMES[found.verdict.outcome], next_experiment=said)

    return part_of(task, say)


def recorded(
    frozen: Frozen, wanted: Mapping[str, Sequence[str]], parts: Path, follow: Follow
) -> dict[str, list[Path]]:
    """A run of each case's bench under each of its experiments, kept in `parts`: case → run files.

    Each is recorded on another day.
    """
    plant, seed = frozen.how.plant(), frozen.how.settings.seed
    runs: dict[str, list[Path]] = {}
    for case, experiments in wanted.items():
        runs[case] = []
        for number, experiment in enumerate(experiments, start=1):
            program = parts / f"{experiment.replace(' ', '-')}-{seed}.csv"
            if not program.exists():
                write_program(plant, experiment, seed, program)
            run = parts / f"{case}-{program.stem}.parquet"
            if not run.exists():
                follow(case, program, run, number)
            runs[case].append(run)
    return runs
