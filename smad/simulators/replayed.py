"""What every plant that replays a model has: what it remembers, its windows, its failures."""

from __future__ import annotations

import contextlib
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, ClassVar, TypeVar

import numpy as np

from smad.diagnosis.plant import Array, Channel, Effect, Mask, ModelPoint, Parameter, Signal, Traits
from smad.diagnosis.runs import GapRun
from smad.simulators.errors import SimulatorError
from smad.simulators.processes import Processes
from smad.simulators.starts import Window, Windows, by_window
from smad.simulators.transducers import transduced

_MOVED = 0.01
"""Of its range, from which on an input has moved."""
_Course = TypeVar("_Course")


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


@dataclass(kw_only=True, eq=False)
class ReplayedPlant(ABC):
    """Satisfies `PlantModel` and `InWindows`, for a subclass that replays a model.

    Safe to call from several threads. The latest replays are kept, so that errors of a reading do
    not make the same one again.
    """

    most_replays: ClassVar[int]
    """How many replays are kept."""
    one_at_a_time: ClassVar[bool] = False
    """Whether this process can make one replay only at a time."""

    name: str
    version: str
    inputs: Sequence[Signal]
    channels: Sequence[Channel]
    parameters: Sequence[Parameter]
    effects: Sequence[Effect]
    shortest_s: float
    window_s: float = 0.0
    failures: Failures = field(default_factory=Failures)
    processes: Processes | None = None

    def __post_init__(self) -> None:
        self._windows = Windows(tuple(c.name for c in self.channels))
        self._courses: OrderedDict[object, Any] = OrderedDict()
        self._lock = Lock()

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

    @abstractmethod
    def windows(self, run: GapRun) -> list[Window]:
        """The windows in which a run, thinned or not, is replayed."""

    def seams(self, run: GapRun) -> list[int]:
        """The samples of a run, thinned or not, at which a window begins."""
        return [a for a, *_ in self.windows(run)]

    @abstractmethod
    def play(self, *arguments: Any) -> Any:
        """A replay, from what can be sent to another process."""

    @contextlib.contextmanager
    def in_processes(self, count: int) -> Iterator[None]:
        """Replays are made in so many processes; 1: in this one.

        Raises SimulatorError for what is no count.
        """
        if count < 1:
            raise SimulatorError("processes is no count", value=count, action="give 1 or more")
        with contextlib.ExitStack() as stack:
            if count > 1:
                pool = Processes(self.play, count)
                self.processes = stack.enter_context(contextlib.closing(pool))
            try:
                yield
            finally:
                self.processes = None

    @abstractmethod
    def _course(self, point: ModelPoint, run: GapRun, moved: str) -> tuple[Array, dict[str, Array]]:
        """Times (m,) and what each channel goes through before its sensor, (m,) each."""

    @abstractmethod
    def _means(self, run: GapRun, y: Array) -> Array:
        """Of what is shown at those times, the values of a thinned run."""

    def _sensed(self, point: ModelPoint, run: GapRun, moved: str = "") -> dict[str, Array]:
        """What is shown with one reading or rate moved, from which all windows begin."""
        t_s, course = self._course(point, run, moved)
        replay = {n: transduced(y, point.effects, n, t_s) for n, y in course.items()}
        return replay if run.whole is None else {n: self._means(run, y) for n, y in replay.items()}

    def _remembered(self, key: object, replay: Callable[[], _Course]) -> _Course:
        """What is known by this key, else a replay."""
        with self._lock:
            course: _Course | None = self._courses.get(key)
            if course is None and self.one_at_a_time and self.processes is None:
                course = replay()
        if course is None:
            course = replay()
        with self._lock:
            self._courses[key] = course
            self._courses.move_to_end(key)
            while len(self._courses) > self.most_replays:
                self._courses.popitem(last=False)
        return course

    def _play(self, *arguments: Any) -> Any:
        """A replay, in another process where there is one."""
        return (self.processes.called if self.processes else self.play)(*arguments)

    def regimes(self, run: GapRun, side: str) -> dict[str, Mask]:
        """At rest until an input first moves; then by each input above and below its middle."""
        rest = self._at_rest(run)
        out = {"rest": rest}
        for s in self.inputs:
            high = np.asarray(run.inputs[s.name]) > (s.low + s.high) / 2
            out[f"{s.name} high"], out[f"{s.name} low"] = high & ~rest, ~high & ~rest
        return out

    def _at_rest(self, run: GapRun) -> Mask:
        moved = np.zeros(len(run.t_s), dtype=bool)
        for s in self.inputs:
            column = np.asarray(run.inputs[s.name])
            moved |= np.abs(column - column[0]) > _MOVED * (s.high - s.low)
        return np.asarray(np.cumsum(moved) == 0)
