"""Whether the recommended experiment resolves an ambiguity: it is carried out, and asked again.

The experiment is simulated with the nominal model first, and the currents and duties that come out
are the program that the case's own bench is given, whatever is wrong with it.
"""

import functools
from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec
import numpy as np

from smad.errors import SmadError
from smad.gap.check.bank import read_columns
from smad.gap.check.case import Part, Task
from smad.gap.check.verdicts import CaseVerdict, NextExperiment, write_verdicts
from smad.gap.plant import ModelPoint
from smad.gap.records import Diagnosis, Outcome
from smad.gap.sma import SmaPlant
from smad.gap.sma_signals import run_from_columns
from tests.withheld.errors import WithheldError
from tests.withheld.second_pass import Frozen, diagnosed, opened, part_of, through

_COLUMNS = {
    "i_x_A": "i_applied_x_A",
    "i_y_A": "i_applied_y_A",
    "duty_x": "duty_x",
    "duty_y": "duty_y",
}
Follow = Callable[[str, Path, Path], None]
"""Records a case's bench under a program: case, program file, run file to write."""


def write_program(plant: SmaPlant, experiment: str, seed: int, path: Path) -> None:
    """The program file of an experiment of the catalogue, as `follow` reads it."""
    run = plant.perform(experiment, ModelPoint({}), seed)
    columns = [run.t_s - run.t_s[0], *(run.inputs[n] for n in _COLUMNS.values())]
    head = ",".join(("t_s", *_COLUMNS))
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.6f")


def names_after(found: Diagnosis) -> list[str]:
    """The effects a verdict leaves standing: one group, or nothing."""
    verdict = found.verdict
    if verdict.outcome is Outcome.AMBIGUOUS:
        return [*verdict.effects, *verdict.group]
    named = verdict.outcome in (Outcome.EFFECT, Outcome.PLUS_REST)
    return list(verdict.effects) if named else []


def judge_again(task: Task, runs: dict[str, Path]) -> Part:
    """The case with the run of the recommended experiment beside those to fit on."""

    def say() -> CaseVerdict:
        more = run_from_columns("next", read_columns(runs[task.case.id]))
        found = diagnosed(task, task.how, [more])
        said = NextExperiment("", names_after=names_after(found))
        return CaseVerdict(outcome="effect", next_experiment=said)

    return part_of(task, say)


def recommended(frozen: Frozen) -> dict[str, str]:
    """Case → experiment, where two or more causes are left and an experiment was recommended."""
    return {
        p.case: p.said.next_experiment.name
        for p in frozen.pairs
        if p.said.outcome == "ambiguous" and p.said.next_experiment is not None
    }


def run(verdicts: Path, key: Path, bank: Path, out: Path, *, jobs: int, follow: Follow) -> None:
    """Carry out each recommended experiment, ask again, write the verdicts with `names_after`.

    Raises WithheldError as `second_pass.opened`.
    """
    try:
        frozen = opened(verdicts, key, bank)
        wanted = recommended(frozen)
        parts = out.with_name(out.name + ".parts")
        parts.mkdir(parents=True, exist_ok=True)
        runs = _recorded(frozen, wanted, parts, follow)
        work = functools.partial(judge_again, runs=runs)
        asked = through(frozen, list(wanted), parts, work, jobs)
        after = dict(frozen.file.verdicts)
        for case, said in asked.items():
            after[case] = _with(after[case], said)
        write_verdicts(out, msgspec.structs.replace(frozen.file, verdicts=after))
    except SmadError as error:
        raise WithheldError(str(error)) from error
    print(f"{len(asked)} of {len(wanted)} cases asked again: {out}")


def _with(before: CaseVerdict, said: CaseVerdict) -> CaseVerdict:
    assert before.next_experiment is not None
    assert said.next_experiment is not None
    whole = msgspec.structs.replace(
        before.next_experiment, names_after=said.next_experiment.names_after
    )
    return msgspec.structs.replace(before, next_experiment=whole)


def _recorded(
    frozen: Frozen, wanted: Mapping[str, str], parts: Path, follow: Follow
) -> dict[str, Path]:
    plant, seed = frozen.how.plant(), frozen.how.settings.seed
    runs = {}
    for case, experiment in wanted.items():
        program = parts / f"{experiment.replace(' ', '-')}-{seed}.csv"
        if not program.exists():
            write_program(plant, experiment, seed, program)
        runs[case] = parts / f"{case}-{program.stem}.parquet"
        if not runs[case].exists():
            follow(case, program, runs[case])
    return runs
