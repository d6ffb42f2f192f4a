"""The diagnosis of a simulator that is not ours: bind it to its runs, choose windows, ask."""

from collections.abc import Mapping, Sequence
from typing import Any

from smad.diagnosis import Answer
from smad.diagnosis import diagnose as ask
from smad.progress import Say, silent
from smad.simulators.bind import bind
from smad.simulators.columns import csv_format
from smad.simulators.declare import Simulator
from smad.simulators.expected import expected, on_standard_error, spaced
from smad.simulators.windows import choose_window, other_starts


def diagnose(
    runs: Any,
    simulator: Simulator,
    *,
    good: Any = (),
    hold_out: Any = (),
    trusted: Sequence[str] = (),
    window_s: float | None = None,
    candidates: Sequence[str] | None = None,
    time: str = "",
    csv: Mapping[str, str] | None = None,
    processes: int | None = None,
    progress: Say | None = None,
    announced: Say | None = None,
) -> Answer:
    """Where a simulator and runs disagree, which law is missing there, what it is called.

    Runs are files, patterns, tables of columns, data frames or `GapRun`s; as of
    `smad.diagnosis.diagnose` otherwise. `trusted` are paths, or names, of runs that the model's
    opinion does not refuse. `window_s`: see `choose_window`. `time` is the column of the time where
    it has none of the usual names; `csv` says how tables are written, as [csv] of a mapping file:
    {"decimal": ","}. A long computation is `announced` and replays in `processes`, by default one
    for each idle core; `progress` is told what is going on (`print`). Both are standard error by
    default. What was taken by default stands in the verdict's notes. Raises SimulatorError,
    RunLogError and GapError.
    """
    form = csv_format(csv or {})
    bound = bind(simulator, runs, good, hold_out, trusted=trusted, time=time, form=form)
    plain = bound.plant.plain
    fit, good_runs, held_out = bound.groups
    every = [run for group in bound.groups for run in group]
    takes = expected(bound.plant, every, bound.seconds)
    count = takes.processes(processes)
    announced = announced or on_standard_error
    if takes.slow:
        announced(takes.words(count, chosen=processes is None))
    progress = progress or (spaced(announced) if takes.slow else silent)
    with plain.in_processes(count):
        progress("choosing a window")
        plain.window_s, why = choose_window(plain, fit, window_s)
        starts = other_starts(plain, fit)
        answer = ask(
            fit,
            plant=bound.plant,
            good=good_runs,
            hold_out=held_out,
            candidates=candidates,
            progress=progress,
        )
    notes = [*answer.verdict.notes, *bound.said, *([why] if why else []), *plain.failures.notes]
    return answer.with_verdict(notes=notes, findings=[*answer.verdict.findings, *starts])
