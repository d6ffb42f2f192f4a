"""A declared simulator with its runs, as a plant of the diagnosis."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Any

import numpy as np

from smad.diagnosis.plant import (
    Array,
    Channel,
    Effect,
    Mask,
    ModelPoint,
    Parameter,
    Signal,
    Traits,
)
from smad.diagnosis.runs import GapRun
from smad.simulators.calling import called
from smad.simulators.declare import Simulator, value_name
from smad.simulators.processes import Processes
from smad.simulators.starts import Window, Windows, by_window
from smad.simulators.transducers import Transduced, effects_of, transduced

_KEPT = 128
_MOVED = 0.01
_STILL = 0.02
_RUNAWAY = 1e3
"""Times a channel's range beyond which a simulator has exploded."""


@dataclass
class Failures:
    """Replays that gave no numbers: how many, and why the first did; and of each effect how many
    gave numbers and how many did not."""

    replays: int = 0
    failed: int = 0
    why: str = ""
    of_effects: dict[str, list[int]] = field(default_factory=dict)

    def count(self, effects: Iterable[str], *, failed: bool) -> None:
        """A replay with these effects."""
        for name in effects:
            self.of_effects.setdefault(name, [0, 0])[failed] += 1

    @property
    def notes(self) -> list[str]:
        """What is said of them in a verdict; nothing where there were none."""
        if not self.failed:
            return []
        never = [n for n, (good, bad) in self.of_effects.items() if bad and not good]
        lost = [f"no replay with {', '.join(never)} gave numbers: no rival"] if never else []
        return [
            f"{self.failed} of {self.replays} replays gave no numbers, and what they were of was "
            f"dropped: {self.why}",
            *lost,
        ]


@dataclass(kw_only=True)
class SimulatedPlant:
    """Satisfies `PlantModel`: replays the function on the runs as they were recorded.

    Each run is replayed in windows of `window_s` that begin from its readings; 0: from its start
    to its end. A point at which the function fails, or runs away, predicts NaN. Safe to call from
    several threads, as many of which as there are `processes` are of use.
    """

    declared: Simulator
    inputs: Sequence[Signal]
    channels: Sequence[Channel]
    lag_s: float
    shortest_s: float
    window_s: float = 0.0
    failures: Failures = field(default_factory=Failures)
    processes: Processes | None = None

    def __post_init__(self) -> None:
        self.name, self.version = self.declared.name, self.declared.version
        self.parameters: Sequence[Parameter] = self.declared.parameters
        self._lock = Lock()
        self._signals = tuple(c.name for c in self.channels)
        declared_effects = [
            replace(e, signals=e.signals or self._signals) for e in self.declared.effects
        ]
        self.effects: Sequence[Effect] = [*declared_effects, *self._transducers()]
        self._largest = {s.name: max(abs(s.low), abs(s.high)) for s in self.inputs}
        self._known: OrderedDict[object, Mapping[str, Array]] = OrderedDict()
        self._windows = Windows(self._signals)

    @property
    def traits(self) -> Traits:
        """How long a run must be, and how many replays are worth asking for at once."""
        together = self.processes.count if self.processes else 1
        return Traits(shortest_s=self.shortest_s, together=together)

    def _transducers(self) -> list[Effect]:
        if not self.declared.transducers:
            return []
        effects: list[Effect] = []
        of = self.declared
        for c in self.channels:
            shared: dict[str, Any] = {"name": c.name, "unit": c.unit, "lag_s": self.lag_s}
            low, high = of.ranges.get(c.name, (c.low, c.high))
            effects += effects_of(
                Transduced(
                    **shared,
                    low=low,
                    high=high,
                    drive=False,
                    signals=(c.name,),
                    places=(f"reading_{c.name}",),
                )
            )
        for s in (s for s in self.inputs if s.name not in of.forces):
            effects += effects_of(
                Transduced(
                    name=s.name,
                    unit=s.unit,
                    lag_s=self.lag_s,
                    low=s.low,
                    high=s.high,
                    drive=True,
                    signals=self._signals,
                    places=(of.acts_at(s.name),),
                ),
                saturation=True,
            )
        return effects

    def simulate(self, point: ModelPoint, run: GapRun, *, fast: bool = False) -> dict[str, Array]:
        """See `PlantModel`. The run as it was recorded is replayed; `fast` changes nothing."""
        return self._shown(point, run)

    def begun_otherwise(self, point: ModelPoint, run: GapRun) -> Iterator[dict[str, Array]]:
        """See `InWindows`."""
        base = self.simulate(point, run)
        for name in self.windows(run if run.whole is None else run.whole)[0].off:
            yield from by_window(base, self._shown(point, run, name), self.seams(run))

    def _shown(self, point: ModelPoint, run: GapRun, moved: str = "") -> dict[str, Array]:
        """What is shown with one reading or rate moved, from which all windows begin."""
        whole = run if run.whole is None else run.whole
        course = self._course(point, whole, self._given(point, run, whole), moved)
        out = {}
        for name in self._signals:
            shown = transduced(course[name], point.effects, name, whole.t_s)
            out[name] = shown if run.whole is None else _means(run, shown)
        return out

    def _given(self, point: ModelPoint, run: GapRun, whole: GapRun) -> dict[str, Array]:
        """What the function is given: inputs as recorded, with what was added, as drives make it.

        A thinned run may have been pushed: what its inputs have beyond the means holds over the
        samples that each stands for.
        """
        given: dict[str, Array] = {}
        signals = {s.name for s in self.inputs}
        size = run.pieces.astype(np.intp)
        for name, column in whole.inputs.items():
            values = np.asarray(column, dtype=np.float64)
            if name in signals and run.whole is not None:
                more = np.asarray(run.inputs[name], dtype=np.float64) - _means(run, values)
                if np.any(np.abs(more) > 1e-12 * self._largest[name]):
                    values = values + np.repeat(more, size)
            if name in signals:
                values = transduced(values, point.effects, name, whole.t_s, self._largest[name])
            given[name] = values
        return given

    def _course(
        self, point: ModelPoint, whole: GapRun, given: Mapping[str, Array], moved: str
    ) -> Mapping[str, Array]:
        values = self.declared.values(point.theta, point.effects)
        key = (
            (id(whole.t_s), id(whole.outputs), self.window_s, moved),
            tuple(values.values()),
            *(hash(given[n].tobytes()) for n in sorted(given)),
        )
        with self._lock:
            known = self._known.get(key)
        if known is None:
            known = self._replayed(values, whole, given, moved)
        with self._lock:
            self._known[key] = known
            self._known.move_to_end(key)
            while len(self._known) > _KEPT:
                self._known.popitem(last=False)
        return known

    def _replayed(
        self, values: Mapping[str, float], whole: GapRun, given: Mapping[str, Array], moved: str
    ) -> Mapping[str, Array]:
        out = {n: np.full(len(whole.t_s), np.nan) for n in self._signals}
        self.failures.replays += 1
        try:
            windows = [w.moved(moved) for w in self.windows(whole)]
            parts = [
                (whole.t_s[a:b], {n: v[a:b] for n, v in given.items()}, dict(start))
                for a, b, start, _ in windows
            ]
            play = self.play if self.processes is None else self.processes.called
            for (a, b, *_), shown in zip(windows, play(dict(values), parts), strict=True):
                for name in self._signals:
                    out[name][a:b] = shown[name]
        except Exception as error:  # whatever somebody else's function does at some point
            self._failed(f"{type(error).__name__}: {error}", values)
            return {n: np.full(len(whole.t_s), np.nan) for n in self._signals}
        for c in self.channels:
            bound = _RUNAWAY * max(c.high - c.low, abs(c.low), abs(c.high))
            if not np.all(np.abs(out[c.name]) < bound):
                self._failed(f"{c.name} runs away", values)
                return {n: np.full(len(whole.t_s), np.nan) for n in self._signals}
        self.failures.count(self._present(values), failed=False)
        return out

    def _present(self, values: Mapping[str, float]) -> list[str]:
        """The declared effects that a replay with these values has."""
        strengths = [
            (e.name, value_name(e, q))
            for e in self.declared.effects
            for q in e.parameters
            if q.strength
        ]
        return list({name for name, value in strengths if values[value]})

    def play(
        self,
        values: Mapping[str, float],
        parts: Sequence[tuple[Array, Mapping[str, Array], Mapping[str, float]]],
    ) -> list[dict[str, Array]]:
        """What the function shows of the channels of each part of a run: times, inputs, start."""
        shown = [called(self.declared, t_s, inputs, values, start) for t_s, inputs, start in parts]
        return [{n: y[n] for n in self._signals} for y in shown]

    def _failed(self, why: str, values: Mapping[str, float]) -> None:
        self.failures.failed += 1
        self.failures.count(self._present(values), failed=True)
        if not self.failures.why:
            self.failures.why = f"{why} at " + ", ".join(
                f"{n} = {v:.4g}" for n, v in values.items() if v
            )

    def windows(self, whole: GapRun) -> list[Window]:
        """The windows of a run."""
        return self._windows.of(whole, self.window_s)

    def seams(self, run: GapRun) -> list[int]:
        """The samples of a run, thinned or not, at which a window begins."""
        whole = run if run.whole is None else run.whole
        begun = [whole.t_s[a] for a, *_ in self.windows(whole)]
        return sorted({int(np.searchsorted(run.t_s, t)) for t in begun} | {0})

    def regimes(self, run: GapRun, side: str) -> dict[str, Mask]:
        """At rest until an input first moves, where nothing that is measured moves either."""
        n = len(run.t_s)
        moved = np.zeros(n, dtype=bool)
        for s in self.inputs:
            column = np.asarray(run.inputs[s.name])
            moved |= np.abs(column - column[0]) > _MOVED * (s.high - s.low)
        rest = np.cumsum(moved) == 0
        for column in run.outputs.values():
            still = np.ptp(column[rest]) if rest.any() else 0.0
            if still > _STILL * float(np.ptp(column)):
                rest = np.zeros(n, dtype=bool)
        out = {"rest": rest}
        for s in self.inputs:
            high = np.asarray(run.inputs[s.name]) > (s.low + s.high) / 2
            out[f"{s.name} high"], out[f"{s.name} low"] = high & ~rest, ~high & ~rest
        return out


def _means(run: GapRun, values: Array) -> Array:
    """Means over the samples of the whole run that each sample of a thinned one stands for."""
    size = run.pieces
    starts = np.r_[0, np.cumsum(size)[:-1]].astype(np.intp)
    return np.asarray(np.add.reduceat(values, starts) / size)
