"""The diagnosis of a simulator that is not ours: bind it to its runs, choose windows, ask."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import msgspec

from smad.diagnosis import Answer
from smad.diagnosis import diagnose as ask
from smad.progress import Say, silent
from smad.simulators.bind import Bound, bind
from smad.simulators.columns import csv_format
from smad.simulators.declare import Simulator
from smad.simulators.errors import SimulatorError
from smad.simulators.plant import SimulatedPlant
from smad.simulators.processes import Processes
from smad.simulators.windows import choose_window

_SLOW_S, _IN_MINUTES_S = 30.0, 180.0
"""An answer that takes longer is announced, whether or not anybody listens to its progress."""


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
    processes: int = 1,
    progress: Say | None = None,
) -> Answer:
    """Where a simulator and runs disagree, which law is missing there, what it is called.

    Runs are files, patterns, tables of columns, data frames or `GapRun`s; as of
    `smad.diagnosis.diagnose` otherwise. `trusted` are paths, or names, of runs that the model's
    opinion does not refuse. `window_s`: see `choose_window`. `time` is the column of the time where
    it has none of the usual names; `csv` says how tables are written, as [csv] of a mapping file:
    {"decimal": ","}. A function that takes long runs in `processes`. `progress` is told what is
    going on (`print`); without it only a long computation is announced, on standard error. What was
    taken by default stands in the verdict's notes. Raises SimulatorError, RunLogError and GapError.
    """
    form = csv_format(csv or {})
    bound = bind(simulator, runs, good, hold_out, trusted=trusted, time=time, form=form)
    plain = bound.plant.plain
    fit, known, held_out = bound.groups
    say, announce = progress or silent, progress or _on_standard_error
    expected_s = seconds_expected(bound)
    if expected_s > _SLOW_S:
        announce(_announced(bound.seconds, expected_s, processes))
    with _in_processes(plain, processes):
        say("choosing a window")
        plain.window_s, why = choose_window(plain, fit, window_s)
        answer = ask(
            fit,
            plant=bound.plant,
            good=known,
            hold_out=held_out,
            candidates=candidates,
            progress=say,
        )
    notes = [*answer.verdict.notes, *bound.said, *([why] if why else []), *plain.failures.notes]
    return replace(answer, verdict=msgspec.structs.replace(answer.verdict, notes=notes))


@contextlib.contextmanager
def _in_processes(plant: SimulatedPlant, count: int) -> Iterator[None]:
    """A plant whose function is called in so many processes; 1: in this one."""
    if count < 1:
        raise SimulatorError("processes is no count", value=count, action="give 1 or more")
    if count == 1:
        yield
        return
    with contextlib.closing(Processes(plant.declared, count)) as pool:
        plant.processes = pool
        try:
            yield
        finally:
            plant.processes = None


def _announced(replay_s: float, expected_s: float, processes: int) -> str:
    """What a long computation takes, and what makes it shorter."""
    cores = os.cpu_count() or 1
    used = min(processes, cores)
    whole_s = expected_s / used
    whole = f"{whole_s:.0f} s" if whole_s < _IN_MINUTES_S else f"{whole_s / 60:.0f} min"
    text = f"a replay takes {replay_s:.2g} s: about {whole} in all"
    if used > 1:
        return f"{text}, in {processes} processes"
    return f"{text}; diagnose(…, processes={cores}) uses all cores" if cores > 1 else text


def _on_standard_error(text: str) -> None:
    sys.stderr.write(f"smad: {text}\n")


def seconds_expected(bound: Bound) -> float:
    """What a diagnosis takes, from what one replay took: replays for terms, effects and fits."""
    plain = bound.plant.plain
    states = len(plain.inputs) + 2 * len(plain.channels) + len(plain.declared.observed) + 1
    forced = sum(1 for p in bound.plant.places if not p.reading)
    terms = forced * (1 + _TERMS_OF_STATE * states)
    signatures = sum(_LEVELS * len(e.parameters) for e in plain.effects)
    fits = _FITS * (len(plain.parameters) + 3)
    # What was timed is the first run; others may be far longer.
    runs = [run for group in bound.groups for run in group]
    samples = sum(len(run.t_s) for run in runs) / len(runs[0].t_s)
    return (terms + signatures + fits) * samples * bound.seconds


_TERMS_OF_STATE, _LEVELS, _FITS = 5, 6, 8
"""Terms that a state gives a place; signatures of a strength; replays that fits take for each."""
