"""The diagnosis of a simulator that is not ours: bind it to its runs, choose windows, ask."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import msgspec

from smad.diagnosis import Answer
from smad.diagnosis import diagnose as ask
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.runs import GapRun
from smad.progress import Say, silent
from smad.simulators.bind import bind
from smad.simulators.columns import csv_format
from smad.simulators.declare import Simulator
from smad.simulators.processes import in_processes
from smad.simulators.windows import choose_window

_SLOW_S, _IN_MINUTES_S = 30.0, 180.0
"""An answer that takes longer is announced; from then on in minutes."""


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
    progress: Say = silent,
    announced: Say | None = None,
) -> Answer:
    """Where a simulator and runs disagree, which law is missing there, what it is called.

    Runs are files, patterns, tables of columns, data frames or `GapRun`s; as of
    `smad.diagnosis.diagnose` otherwise. `trusted` are paths, or names, of runs that the model's
    opinion does not refuse. `window_s`: see `choose_window`. `time` is the column of the time where
    it has none of the usual names; `csv` says how tables are written, as [csv] of a mapping file:
    {"decimal": ","}. A function that takes long runs in `processes`. `progress` is told what is
    going on (`print`), `announced` what a long computation takes (default: on standard error). What
    was taken by default stands in the verdict's notes. Raises SimulatorError, RunLogError and
    GapError.
    """
    form = csv_format(csv or {})
    bound = bind(simulator, runs, good, hold_out, trusted=trusted, time=time, form=form)
    plain = bound.plant.plain
    fit, known, held_out = bound.groups
    every = [run for group in bound.groups for run in group]
    announce(bound.plant, every, bound.seconds, processes, announced or on_standard_error)
    with in_processes(plain, processes):
        progress("choosing a window")
        plain.window_s, why = choose_window(plain, fit, window_s)
        answer = ask(
            fit,
            plant=bound.plant,
            good=known,
            hold_out=held_out,
            candidates=candidates,
            progress=progress,
        )
    notes = [*answer.verdict.notes, *bound.said, *([why] if why else []), *plain.failures.notes]
    return replace(answer, verdict=msgspec.structs.replace(answer.verdict, notes=notes))


def announce(
    plant: PlacesPlant, runs: Sequence[GapRun], replay_s: float, processes: int, announced: Say
) -> None:
    """Say what a long computation takes, and what makes it shorter, before it begins.

    `replay_s` is what the first of the runs took.
    """
    expected_s = seconds_expected(plant, runs, replay_s)
    if expected_s > _SLOW_S:
        announced(_announced(replay_s, expected_s, processes))


def _announced(replay_s: float, expected_s: float, processes: int) -> str:
    cores = os.cpu_count() or 1
    used = min(processes, cores)
    whole_s = expected_s / used
    whole = f"{whole_s:.0f} s" if whole_s < _IN_MINUTES_S else f"{whole_s / 60:.0f} min"
    text = f"a replay takes {replay_s:.2g} s: about {whole} in all"
    if used > 1:
        return f"{text}, in {processes} processes"
    return f"{text}; processes = {cores} uses all cores" if cores > 1 else text


def on_standard_error(text: str) -> None:
    """Say it there."""
    sys.stderr.write(f"smad: {text}\n")


def seconds_expected(plant: PlacesPlant, runs: Sequence[GapRun], replay_s: float) -> float:
    """What a diagnosis takes, from what a replay of the first run took: replays for terms, effects
    and fits."""
    forced = [p for p in plant.places if not p.reading]
    terms = sum(1 + _TERMS_OF_STATE * len(p.states) for p in forced)
    signatures = sum(_LEVELS * len(e.parameters) for e in plant.effects)
    fits = _FITS * (len(plant.parameters) + 3)
    samples = sum(len(run.t_s) for run in runs) / len(runs[0].t_s)
    return (terms + signatures + fits) * samples * replay_s


_TERMS_OF_STATE, _LEVELS, _FITS = 5, 6, 8
"""Terms that a state gives a place; signatures of a strength; replays that fits take for each."""
