"""How long a diagnosis takes, said before it begins, and in how many processes it replays."""

import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.runs import GapRun
from smad.progress import Say

_SLOW_S, _IN_MINUTES_S = 30.0, 180.0
"""An answer that may take longer is announced; from then on in minutes."""
_SAID_EVERY_S = 10.0
_TERMS_OF_STATE, _LEVELS = 5, 6
"""Terms that a state gives a place; signatures of a strength."""
_EFFECT_FITS, _LAW_FITS, _LAWS_FIT = 8, 30, 90
"""Replays for each coordinate of a fit: an effect fits at once; laws at readings; laws at inputs,
each of whose replays is repeated until it agrees with what it moves."""
_NO_FORK = ("jax", "jpype", "matlab", "tensorflow", "torch")
"""Modules whose threads do not survive in a forked process."""


@dataclass(frozen=True)
class Expected:
    """What a diagnosis takes in one process, s: `replay_s` for a replay, and in all between `low_s`
    and `high_s`, of so many `runs`."""

    replay_s: float
    low_s: float
    high_s: float
    runs: int

    @property
    def slow(self) -> bool:
        """Whether it is announced."""
        return self.high_s > _SLOW_S

    def processes(self, requested: int | None) -> int:
        """As many as were asked for; None: one for each idle core for what is slow and can be
        forked. On a busy one the way there and back takes longer than a replay."""
        if requested is not None:
            return requested
        forks = sys.platform == "linux" and not any(name in sys.modules for name in _NO_FORK)
        return max(_cores() - _busy(), 1) if self.slow and forks else 1

    def words(self, processes: int, *, chosen: bool) -> str:
        """What is announced; `chosen`: nobody asked for so many processes."""
        cores = _cores()
        used = min(processes, cores, self.runs)
        text = (
            f"a replay takes {self.replay_s:.2g} s: {_span(self.low_s / used, self.high_s / used)}"
        )
        if processes > 1:
            return f"{text} in {processes} processes" + " (processes = 1: in this one)" * chosen
        more = f"; with idle cores processes = {cores} (--processes) shares out the runs"
        return text + more if cores > 1 else text


def expected(plant: PlacesPlant, runs: Sequence[GapRun], replay_s: float) -> Expected:
    """What a diagnosis takes, from what a replay of the first run took: replays for terms, effects
    and fits."""
    forced = [p for p in plant.places if not p.reading]
    terms = sum(1 + _TERMS_OF_STATE * len(p.states) for p in forced)
    signatures = sum(_LEVELS * len(e.parameters) for e in plant.effects)
    coordinates = len(plant.parameters) + 3
    least = _EFFECT_FITS if plant.effects else _LAW_FITS
    most = _LAWS_FIT if forced else _LAW_FITS
    samples = sum(len(run.t_s) for run in runs) / len(runs[0].t_s)
    low_s, high_s = (
        (terms + signatures + fits * coordinates) * samples * replay_s for fits in (least, most)
    )
    return Expected(replay_s, low_s, high_s, len(runs))


def spaced(say: Say, clock_s: Callable[[], float] = time.monotonic) -> Say:
    """Passes a text on every ten seconds, with the time since the beginning before it."""
    began_s = last_s = clock_s()

    def at_times(text: str) -> None:
        nonlocal last_s
        if (now_s := clock_s()) - last_s >= _SAID_EVERY_S:
            last_s = now_s
            say(f"{now_s - began_s:.0f} s: {text}")

    return at_times


def on_standard_error(text: str) -> None:
    """Say it there."""
    sys.stderr.write(f"smad: {text}\n")
    sys.stderr.flush()


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def _busy() -> int:
    return round(os.getloadavg()[0])


def _span(low_s: float, high_s: float) -> str:
    low, high = (
        f"{x:.0f} s" if x < _IN_MINUTES_S else f"{x / 60:.0f} min" for x in (low_s, high_s)
    )
    return f"{low} to {high} in all" if low != high else f"about {low} in all"
