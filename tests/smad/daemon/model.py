"""The machine of arming, `smad.daemon.arming`, driven through everything that can happen in small.

python -m tests.smad.daemon.model

Two axes, two clients. The machine is the daemon's. Around it is the least that is true of the rest:
boards that arm by a token once and stop by DISARM, by a new session, by their own watchdog or by a
fault; lines that keep the order, but delay and lose whatever they carry; clients that arm any axes
and stop all; a daemon that is killed and started again. Each step is one thing that happens;
breadth-first search visits every state that any order of steps leads to.

Five things make it small and leave nothing out. Stops of two clients that are open at once are one,
which may be replied to by what was seen since the first. A reply to a stop or a refusal is sent any
time after each of its axes was known to be off at some moment since, as the daemon waits for one
after the other; or any time, when it says that a board has not confirmed. An answer is heard at
once or lost: a late one is one that was lost, and given again to the repeated request. A command
that is late is one that is asked for later, unless a stop came: then its generation must not be in
force, which is looked at when the stop begins, as none that is not ever will be. A board gives its
token at once or never: a token alone arms nothing.

Two things make it quick. The axes are alike, so a state and the same with the axes exchanged are
one, and what happens on an axis is worked out for the first only. A step looks at the machine and
at one board at most: what it does is worked out once for each such pair (`Model`), by the daemon's
machine itself, and the search (`explore`) only looks it up.

The property, in every state:

1. When the reply to a stop, or the refusal of an arming, is sent, no board that it is for is armed.
2. From then on no board becomes armed but by an arming that was begun afterwards.
3. No arming begins that was asked for before a stop of its axes, or of an earlier daemon.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Generic, NamedTuple, TypeVar

from tests.smad.daemon.model_steps import (
    AT_START,
    NAMES,
    Board,
    Case,
    Effects,
    MachineState,
    Violation,
    steps_of_axis,
    steps_of_bench,
)

T = TypeVar("T")
EXCHANGE = str.maketrans("AB", "BA")
BITS = 12
MASK = (1 << BITS) - 1
"""For the number of a board within that of a state."""


class Numbers(Generic[T]):
    """Gives each thing a number, always the same."""

    def __init__(self) -> None:
        self.things: list[T] = []
        self._numbers: dict[T, int] = {}

    def of(self, thing: T) -> int:
        """Return its number."""
        number = self._numbers.setdefault(thing, len(self.things))
        if number == len(self.things):
            self.things.append(thing)
        return number


class Row(NamedTuple):
    """A step in numbers, of a state's upper bits: the machine after it; what becomes of boards."""

    what: tuple[str, str]
    """In words, and with axes exchanged."""
    machine: int
    exchanged: int
    first: int
    """The first axis's board where that was known, else what is done to it."""
    second: int
    """What is done to the second axis's board."""


class Model:
    """Its states are whole numbers: of the machine, of the first axis's board, of the second's.

    Each step is worked out once for each machine, with each board of the first axis or none.
    """

    def __init__(self, alone: frozenset[str]) -> None:
        self._alone = alone
        self._machines: Numbers[MachineState] = Numbers()
        self._boards: Numbers[Board] = Numbers()
        self._effects: Numbers[Effects] = Numbers()
        """0 is that nothing is done."""
        self._effects.of(())
        self._exchanged: dict[int, int] = {}
        self._of_axis: dict[int, list[Row]] = {}
        self._of_bench: dict[int, list[Row]] = {}
        self._boards_after: dict[int, int] = {}
        board = self._boards.of(Board())
        self.start = self._machines.of(AT_START) << 2 * BITS | board << BITS | board

    def steps(self, state: int) -> Iterator[tuple[int, int, str]]:
        """Yield each state that can be next, also with axes exchanged, and what leads there.

        Raises Violation.
        """
        machine, first, second = state >> 2 * BITS, state >> BITS & MASK, state & MASK
        after = self._after
        for what, same, exchanged, board, effects in self._axis_rows(machine, first):
            other = after(second, effects) if effects else second
            yield same | board << BITS | other, exchanged | other << BITS | board, what[0]
        for what, exchanged, same, board, effects in self._axis_rows(
            self._exchange(machine), second
        ):
            other = after(first, effects) if effects else first
            yield same | other << BITS | board, exchanged | board << BITS | other, what[1]
        for what, same, exchanged, on_first, on_second in self._bench_rows(machine):
            board, other = after(first, on_first), after(second, on_second)
            yield same | board << BITS | other, exchanged | other << BITS | board, what[0]

    def _after(self, board: int, effects: int) -> int:
        key = effects << BITS | board
        after = self._boards_after.get(key)
        if after is None:
            changed = self._boards.things[board]
            for effect in self._effects.things[effects]:
                changed = effect(changed)
            after = self._boards_after[key] = self._boards.of(changed)
        return after

    def _axis_rows(self, machine: int, board: int) -> list[Row]:
        key = machine << BITS | board
        rows = self._of_axis.get(key)
        if rows is None:
            case = partial(Case, self._alone, self._machines.things[machine])
            steps = steps_of_axis(case, self._boards.things[board])
            rows = self._of_axis[key] = [self._row(what, after) for what, after in steps]
        return rows

    def _bench_rows(self, machine: int) -> list[Row]:
        rows = self._of_bench.get(machine)
        if rows is None:
            case = partial(Case, self._alone, self._machines.things[machine], None)
            rows = [self._row(what, after) for what, after in steps_of_bench(case)]
            self._of_bench[machine] = rows
        return rows

    def _row(self, what: str, after: Case) -> Row:
        machine = self._machines.of(after.after())
        first, second = (self._effects.of(after.effects[name]) for name in NAMES)
        if after.board is not None:
            first = self._boards.of(after.board)
        exchanged = self._exchange(machine)
        words = (what, what.translate(EXCHANGE))
        return Row(words, machine << 2 * BITS, exchanged << 2 * BITS, first, second)

    def _exchange(self, machine: int) -> int:
        other = self._exchanged.get(machine)
        if other is None:
            other = self._machines.of(self._machines.things[machine].exchanged())
            self._exchanged[machine] = other
        return other


@dataclass(frozen=True)
class Explored:
    """What a search saw."""

    states: int
    steps: int
    depth: int

    def in_words(self) -> str:
        """In one line."""
        return f"{self.states} states, {self.steps} steps between them, {self.depth} deep"


def explore(alone: frozenset[str]) -> Explored:
    """Visit every state. Raises Violation with the shortest way to one that breaks the property."""
    model = Model(alone)
    came_from: dict[int, tuple[int, str, bool]] = {model.start: (-1, "", False)}
    steps = depth = 0
    reached = [model.start]
    while reached:
        now, reached = reached, []
        for state in now:
            try:
                for same, exchanged, what in model.steps(state):
                    steps += 1
                    after = min(same, exchanged)
                    if after not in came_from:
                        came_from[after] = (state, what, exchanged < same)
                        reached.append(after)
            except Violation as violation:
                way = "\n".join(_way(came_from, state))
                raise Violation(f"{way}\n{violation}") from None
        depth += bool(reached)
    return Explored(len(came_from), steps, depth)


def _way(came_from: Mapping[int, tuple[int, str, bool]], state: int) -> list[str]:
    """Return what happened from the start to a state, with each axis under one name."""
    backwards = []
    while state >= 0:
        state, what, exchanged = came_from[state]
        backwards.append((what, exchanged))
    way, other_names = [], False
    for what, exchanged in reversed(backwards[:-1]):
        way.append(what.translate(EXCHANGE) if other_names else what)
        other_names ^= exchanged
    return way


def main() -> None:
    """Search with both policies; print what was explored, and the property."""
    for alone in (frozenset[str](), frozenset(NAMES)):
        began_s = time.process_time()
        explored = explore(alone)
        policy = "own" if alone else "all"
        took_s = time.process_time() - began_s
        print(f'fault_holds = "{policy}": {explored.in_words()}, {took_s:.0f} s of processor time')
    print("The property" + (__doc__ or "").partition("The property")[2].rstrip())


if __name__ == "__main__":
    main()
