"""A declared simulator with its runs, as a plant of the diagnosis, and its places."""

import contextlib
import multiprocessing
import os
import warnings
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from smad.diagnosis.places.bare import BarePlaces
from smad.diagnosis.places.place import Place
from smad.diagnosis.plant import Array, Channel, Mask, ModelPoint, Signal, Traits, Uncertainty
from smad.diagnosis.runs import GapRun
from smad.processes.parent import begin_worker, interrupts_held
from smad.simulators.calling import called
from smad.simulators.declare import Simulator, value_name
from smad.simulators.errors import LostProcessError, SimulatorError
from smad.simulators.saving import save_values
from smad.simulators.starts import Window, Windows, by_window
from smad.simulators.transducers import effects_of, transduced


class Processes:
    """`count` processes that call the same function; safe to ask from several threads.

    Raises SimulatorError where this system cannot fork processes.
    """

    def __init__(self, function: Callable[..., Any], count: int) -> None:
        if "fork" not in multiprocessing.get_all_start_methods():
            raise SimulatorError("this system cannot fork processes", action="leave processes out")
        self.count = count
        self._pool = ProcessPoolExecutor(
            count,
            multiprocessing.get_context("fork"),
            initializer=_begin,
            initargs=(function, os.getpid()),
        )

    def called(self, *arguments: Any) -> Any:
        """What the function returns. Raises RuntimeError for what it raised, LostProcessError."""
        try:
            with warnings.catch_warnings(), interrupts_held():
                # Forking beside threads is what Python 3.12 warns of; ours hold no lock that a
                # function could want.
                warnings.simplefilter("ignore", DeprecationWarning)
                future = self._pool.submit(_call, *arguments)
            returned, why = future.result()
        except BrokenProcessPool as error:
            raise LostProcessError(
                "a process of the simulator was killed, or ended by itself",
                action="if memory was short, take fewer (processes = 1: none but this one)",
            ) from error
        if why:
            raise RuntimeError(why)
        return returned

    def close(self) -> None:
        """End the processes."""
        self._pool.shutdown(cancel_futures=True)


_functions: list[Callable[..., Any]] = []
"""In a process of the pool: what it calls."""


def _begin(function: Callable[..., Any], parent: int) -> None:
    begin_worker(parent)
    _functions[:] = [function]


def _call(*arguments: Any) -> tuple[Any, str]:
    """What is returned, or why nothing is: exceptions of others need not survive the way back."""
    try:
        return _functions[0](*arguments), ""
    except Exception as error:  # whatever somebody else's function does at some point
        return None, f"{type(error).__name__}: {error}"


_MOST_REPLAYS = 128
"""The latest are kept: a reading's errors, tried one by one, replay the same course."""
_MOVED = 0.01
"""Of its range, from which on an input has moved."""
_STILL = 0.02
"""Of its range, up to which a reading counts as still."""
_RUNAWAY = 1e3
"""Times a channel's range beyond which a simulator has exploded."""


class SimulatedPlant:
    """A declared function, replayed on the runs as they were recorded; `PlantModel`, `InWindows`.

    Each run is replayed in windows of `window_s` that begin from its readings; 0: from its start
    to its end. A point at which the function fails predicts NaN, one at which it runs away NaN from
    there on. Safe to call from several threads; as many as there are `processes` are of use. The
    latest replays are kept, so that errors of a reading do not make the same one again.
    """

    def __init__(
        self,
        declared: Simulator,
        inputs: Sequence[Signal],
        channels: Sequence[Channel],
        *,
        lag_s: float,
        shortest_s: float,
    ) -> None:
        self.declared = declared
        self._signals = tuple(c.name for c in channels)
        effects = [replace(e, signals=e.signals or self._signals) for e in declared.effects]
        if declared.transducers:
            drives = [s for s in inputs if s.name not in declared.forces]
            kinds = declared.transducers
            effects += effects_of(channels, drives, lag_s, acts_at=declared.acts_at, kinds=kinds)
        self.name, self.version = declared.name, declared.version
        self.inputs, self.channels = inputs, channels
        self.parameters, self.effects = declared.parameters, effects
        self.shortest_s, self.window_s = shortest_s, 0.0
        self.failures = Failures()
        self.processes: Processes | None = None
        self._windows = Windows(self._signals)
        self._courses: OrderedDict[object, dict[str, Array]] = OrderedDict()
        self._lock = Lock()
        self._largest = {s.name: max(abs(s.low), abs(s.high)) for s in inputs}

    @property
    def traits(self) -> Traits:
        """How long a run must be, and how many replays are worth asking for at once."""
        together = self.processes.count if self.processes else 1
        return Traits(shortest_s=self.shortest_s, together=together)

    def simulate(self, point: ModelPoint, run: GapRun, *, fast: bool = False) -> dict[str, Array]:
        """See `PlantModel`; `fast` changes nothing."""
        return self._sensed(point, run)

    def begun_otherwise(self, point: ModelPoint, run: GapRun) -> Iterator[dict[str, Array]]:
        """See `InWindows`."""
        base = self.simulate(point, run)
        for name in self.windows(run)[0].off:
            yield from by_window(base, self._sensed(point, run, name), self.seams(run))

    @contextlib.contextmanager
    def in_processes(self, count: int) -> Iterator[None]:
        """Replays are made in so many processes; 1: in this one.

        Raises SimulatorError for what is no count.
        """
        if count < 1:
            raise SimulatorError("processes is not a count", value=count, action="give 1 or more")
        with contextlib.ExitStack() as stack:
            if count > 1:
                if self.declared.pause is not None:
                    self.declared.pause()
                pool = Processes(self.play, count)
                self.processes = stack.enter_context(contextlib.closing(pool))
            try:
                yield
            finally:
                self.processes = None

    def _driven(self, point: ModelPoint, run: GapRun, whole: GapRun) -> dict[str, Array]:
        """What the function is given: inputs as recorded, with what was added, as drives make it.

        A thinned run may have been pushed: what its inputs have beyond the means holds over the
        samples that each stands for.
        """
        driven: dict[str, Array] = {}
        signals = {s.name for s in self.inputs}
        size = run.pieces.astype(np.intp)
        for name, column in whole.inputs.items():
            values = np.asarray(column, dtype=np.float64)
            if name in signals:
                if run.whole is not None:
                    pushed = np.asarray(run.inputs[name], dtype=np.float64)
                    more = pushed - _means(run, values)
                    if np.any(np.abs(more) > 1e-12 * self._largest[name]):
                        values = values + np.repeat(more, size)
                values = transduced(values, point.effects, name, whole.t_s, self._largest[name])
            driven[name] = values
        return driven

    def _sensed(self, point: ModelPoint, run: GapRun, moved: str = "") -> dict[str, Array]:
        """What is shown with one reading or rate moved, from which all windows begin."""
        whole = run.as_recorded
        driven = self._driven(point, run, whole)
        values = self.declared.values(point.theta, point.effects)
        key = (
            (self._windows.readings_of(whole), self.window_s, moved),
            tuple(values.values()),
            *(hash(driven[n].tobytes()) for n in sorted(driven)),
        )
        with self._lock:
            course = self._courses.get(key)
        if course is None:
            course = self._replayed(values, whole, driven, moved)
        with self._lock:
            self._courses[key] = course
            self._courses.move_to_end(key)
            while len(self._courses) > _MOST_REPLAYS:
                self._courses.popitem(last=False)
        shown = {n: transduced(y, point.effects, n, whole.t_s) for n, y in course.items()}
        return shown if run.whole is None else {n: _means(run, y) for n, y in shown.items()}

    def _replayed(
        self, values: Mapping[str, float], whole: GapRun, driven: Mapping[str, Array], moved: str
    ) -> dict[str, Array]:
        self.failures.replays += 1
        try:
            windows = [w.moved(moved) for w in self.windows(whole)]
            parts = [
                (whole.t_s[a:b], {n: v[a:b] for n, v in driven.items()}, dict(start))
                for a, b, start, _ in windows
            ]
            play = self.processes.called if self.processes else self.play
            played = play(dict(values), parts)
            out = {n: np.concatenate([part[n] for part in played]) for n in self._signals}
            bounded = {c.name: _bounded(c, out[c.name]) for c in self.channels}
            out = {n: np.where(good, out[n], np.nan) for n, good in bounded.items()}
            away = [n for n, good in bounded.items() if not good.all()]
            why = ""
            if away:
                k = int(np.argmin(bounded[away[0]]))
                why = f"{away[0]} runs away, or is not a number, from {whole.t_s[k]:.6g} s on"
        except LostProcessError:
            raise
        except Exception as error:  # whatever somebody else's function does at some point
            out = {n: np.full(len(whole.t_s), np.nan) for n in self._signals}
            why = f"{type(error).__name__}: {error}"
        self.failures.count(self._present(values), failed=bool(why))
        if why:
            words = ", ".join(f"{n} = {v:.4g}" for n, v in values.items() if v)
            self.failures.add(f"{why} at {words} in run {whole.name}")
        return out

    def _present(self, values: Mapping[str, float]) -> list[str]:
        """The declared effects that a replay with these values has."""
        return [
            e.name
            for e in self.declared.effects
            if any(values[value_name(e, q)] for q in e.parameters if q.strength)
        ]

    def play(
        self,
        values: Mapping[str, float],
        parts: Sequence[tuple[Array, Mapping[str, Array], Mapping[str, float]]],
    ) -> list[dict[str, Array]]:
        """What the function shows of the channels of each part of a run: times, inputs, start."""
        played = [called(self.declared, t_s, inputs, values, start) for t_s, inputs, start in parts]
        return [{n: y[n] for n in self._signals} for y in played]

    def windows(self, run: GapRun) -> list[Window]:
        """Those of the whole run."""
        return self._windows.of(run.as_recorded, self.window_s)

    def seams(self, run: GapRun) -> list[int]:
        """The samples of a run, thinned or not, at which a window begins."""
        whole = run.as_recorded
        starts = [whole.t_s[a] for a, *_ in self.windows(whole)]
        return sorted({int(np.searchsorted(run.t_s, t)) for t in starts} | {0})

    def regimes(self, run: GapRun, side: str) -> dict[str, Mask]:
        """At rest until an input first moves; then by each input above and below its middle."""
        rest = self._at_rest(run)
        out = {"rest": rest}
        for s in self.inputs:
            high = np.asarray(run.inputs[s.name]) > (s.low + s.high) / 2
            out[f"{s.name} high"], out[f"{s.name} low"] = high & ~rest, ~high & ~rest
        return out

    def _at_rest(self, run: GapRun) -> Mask:
        """At no time where something that is measured moves before an input does."""
        moved = np.zeros(len(run.t_s), dtype=bool)
        for s in self.inputs:
            column = np.asarray(run.inputs[s.name])
            moved |= np.abs(column - column[0]) > _MOVED * (s.high - s.low)
        rest = np.asarray(np.cumsum(moved) == 0)
        for column in run.outputs.values():
            still = np.ptp(column[rest]) if rest.any() else 0.0
            if still > _STILL * float(np.ptp(column)):
                rest = np.zeros(len(run.t_s), dtype=bool)
        return rest


class SimulatorPlaces(BarePlaces):
    """A simulated plant that can be forced; see `Forceable`.

    An input that is felt through a force has no place beside that of the force: nothing could tell
    the two apart.
    """

    plain: SimulatedPlant

    @cached_property
    def places(self) -> Sequence[Place]:
        """Readings, inputs and forces, with the observed columns among their states."""
        of = self.plain.declared
        felt = {f"input_{name}" for name in of.felt_at}
        offered = []
        for place in super().places:
            if place.name not in felt:
                label = of.labels.get(place.name.removeprefix("input_"), place.label)
                states = tuple(s for s in place.states if s not in of.forces)
                offered.append(replace(place, label=label, states=(*states, *of.observed)))
        return tuple(offered)

    def state_words(self, place: str, state: str) -> tuple[str, str]:
        """See `Forceable`."""
        if state in self.plain.declared.observed:
            return state, self.plain.declared.unit(state)
        return super().state_words(place, state)

    def _states(self, run: GapRun, replay: Mapping[str, Array]) -> dict[str, Array]:
        """Those of a bare plant, and the observed columns."""
        observed = self.plain.declared.observed
        return super()._states(run, replay) | {
            n: np.asarray(run.inputs[n], float) for n in observed
        }

    def save_model(
        self, point: ModelPoint, path: Path, note: str, uncertainty: Uncertainty | None = None
    ) -> None:
        """See `SavesModel`."""
        of = self.plain.declared
        if of.save is None:
            save_values(of, point, path, note, uncertainty, effects=self.effects)
        else:
            of.save(point, path, note, uncertainty)


def _means(run: GapRun, y: Array) -> Array:
    """Of what is shown at the times of a run as recorded, the values of the thinned one."""
    size = run.pieces
    starts = np.r_[0, np.cumsum(size)[:-1]].astype(np.intp)
    return np.asarray(np.add.reduceat(y, starts) / size)


def _bounded(c: Channel, y: Array) -> Mask:
    """Where a channel has not yet run away, (n,)."""
    most = _RUNAWAY * max(c.high - c.low, abs(c.low), abs(c.high))
    return np.asarray(np.logical_and.accumulate(np.abs(y) < most))


@dataclass
class Failures:
    """Replays that gave no numbers: how many, and why the first did; and of each effect how many
    gave numbers and how many did not."""

    replays: int = 0
    failed: int = 0
    why: str = ""
    of_effects: dict[str, list[int]] = field(default_factory=dict)

    def add(self, why: str) -> None:
        """A replay that failed; why the first one did is kept."""
        self.failed += 1
        self.why = self.why or why

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
