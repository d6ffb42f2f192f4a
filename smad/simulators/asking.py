"""The diagnosis of a simulator that is not ours: bind it to its runs, choose windows, ask."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import msgspec

from smad.diagnosis import Answer
from smad.diagnosis import diagnose as ask
from smad.progress import Say, silent
from smad.simulators.bind import Bound, bind
from smad.simulators.declare import Simulator
from smad.simulators.windows import choose_window

_SLOW_S = 30.0
"""An answer that takes longer is announced."""


def diagnose(
    runs: Any,
    simulator: Simulator,
    *,
    good: Any = (),
    hold_out: Any = (),
    trusted: Sequence[str] = (),
    window_s: float | None = None,
    candidates: Sequence[str] | None = None,
    progress: Say = silent,
) -> Answer:
    """Where a simulator and runs disagree, which law is missing there, what it is called.

    Runs are files, patterns, tables of columns, data frames or `GapRun`s; as of
    `smad.diagnosis.diagnose` otherwise. `trusted` are paths, or names, of runs that the model's
    opinion does not refuse. `window_s`: see `choose_window`. What was taken by default
    stands in the verdict's notes. Raises SimulatorError, RunLogError and GapError.
    """
    bound = bind(simulator, runs, good, hold_out, trusted=trusted)
    plain = bound.plant.plain
    fit, known, held_out = bound.groups
    expected_s = seconds_expected(bound)
    if expected_s > _SLOW_S:
        progress(f"a replay takes {bound.seconds:.2g} s: about {expected_s / 60:.0f} min in all")
    plain.window_s, why = choose_window(plain, fit, window_s)
    answer = ask(
        fit,
        plant=bound.plant,
        good=known,
        hold_out=held_out,
        candidates=candidates,
        progress=progress,
    )
    failures = plain.failures
    notes = [*answer.verdict.notes, *bound.said, *([why] if why else [])]
    if failures.failed:
        notes.append(
            f"{failures.failed} of {failures.replays} replays gave no numbers, and what they were "
            f"of was dropped: {failures.why}"
        )
    return replace(answer, verdict=msgspec.structs.replace(answer.verdict, notes=notes))


def seconds_expected(bound: Bound) -> float:
    """What a diagnosis takes, from what one replay took: replays for terms, effects and fits."""
    plain = bound.plant.plain
    states = len(plain.inputs) + 2 * len(plain.channels) + len(plain.declared.observed) + 1
    forced = sum(1 for p in bound.plant.places if not p.reading)
    terms = forced * (1 + _TERMS_OF_STATE * states)
    signatures = sum(_LEVELS * len(e.parameters) for e in plain.effects)
    fits = _FITS * (len(plain.parameters) + 3)
    runs = sum(len(g) for g in bound.groups)
    return (terms + signatures + fits) * runs * bound.seconds


_TERMS_OF_STATE, _LEVELS, _FITS = 5, 6, 8
"""Terms that a state gives a place; signatures of a strength; replays that fits take for each."""
