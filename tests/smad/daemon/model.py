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

Three things make it quick. The axes are alike, so a state and the same with the axes exchanged are
one, and what happens on an axis is worked out for the first only. A step looks at the machine and
at one board at most: what it does is worked out once for each such pair (`Model`), by the daemon's
machine itself, and the search (`explore`) only looks it up. It looks up all states of a depth
together.

The property, in every state:

1. When the reply to a stop, or the refusal of an arming, is sent, no board that it is for is armed.
2. From then on no board becomes armed but by an arming that was begun afterwards.
3. No arming begins that was asked for before a stop of its axes, or of an earlier daemon.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

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
States = NDArray[np.int64]
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
        self._tables: dict[tuple[int, bool], States] = {}
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

    def steps_of_all(self, states: States) -> tuple[NDArray[np.intp], States]:
        """Return the states that can be next of all of these, as `steps` with the axes in order.

        Beside each, the index of the state that it follows. Raises Violation.
        """
        machine, first, second = states >> 2 * BITS, states >> BITS & MASK, states & MASK
        other_way = _looked_up(self._exchange, machine)
        from_first, (same, exchanged, board, effects) = self._rows(machine << BITS | first, True)
        other = self._all_after(second[from_first], effects)
        of_first = _lesser(same, exchanged, board, other)
        from_second, (exchanged, same, board, effects) = self._rows(
            other_way << BITS | second, True
        )
        other = self._all_after(first[from_second], effects)
        of_second = _lesser(same, exchanged, other, board)
        from_bench, (same, exchanged, on_first, on_second) = self._rows(machine, False)
        board = self._all_after(first[from_bench], on_first)
        other = self._all_after(second[from_bench], on_second)
        of_bench = _lesser(same, exchanged, board, other)
        return (
            np.concatenate([from_first, from_second, from_bench]),
            np.concatenate([of_first, of_second, of_bench]),
        )

    def _rows(self, keys: States, of_axis: bool) -> tuple[NDArray[np.intp], States]:
        """Return the rows of all keys one after the other, in columns, and the index of each."""
        different, which = np.unique(keys, return_inverse=True)
        tables = [self._table(key, of_axis) for key in different.tolist()]
        lengths = np.array([table.shape[1] for table in tables])
        begins = np.cumsum(lengths) - lengths
        counts = lengths[which]
        index = np.repeat(np.arange(len(keys)), counts)
        within = np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)
        return index, np.concatenate(tables, axis=1)[:, begins[which][index] + within]

    def _table(self, key: int, of_axis: bool) -> States:
        table = self._tables.get((key, of_axis))
        if table is None:
            rows = self._axis_rows(key >> BITS, key & MASK) if of_axis else self._bench_rows(key)
            table = np.array([row[1:] for row in rows], dtype=np.int64).reshape(-1, 4).T
            self._tables[key, of_axis] = table
        return table

    def _all_after(self, boards: States, effects: States) -> States:
        return _looked_up(
            lambda key: self._after(key & MASK, key >> BITS), effects << BITS | boards
        )

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
    depths = [np.array([model.start])]
    visited, steps = depths[0], 0
    while len(depths[-1]):
        try:
            _, after = model.steps_of_all(depths[-1])
        except Violation:
            raise Violation(_way_to_a_violation(model, depths)) from None
        steps += len(after)
        reached = _not_among(visited, after)
        visited = np.sort(np.concatenate([visited, reached]))
        depths.append(reached)
    return Explored(len(visited), steps, len(depths) - 2)


def _not_among(known: States, states: States) -> States:
    """Return the states that are not among the known ones, each once; both in ascending order."""
    # By sorting: the hash table of `np.unique` has long chains where numbers are this regular.
    ascending = np.sort(states)
    different = ascending[np.diff(ascending, prepend=-1) != 0]
    place = np.minimum(np.searchsorted(known, different), len(known) - 1)
    return different[known[place] != different]


def _looked_up(one: Callable[[int], int], keys: States) -> States:
    """Return what a function gives for each key; it is asked once for each that is different."""
    different, which = np.unique(keys, return_inverse=True)
    return np.array([one(key) for key in different.tolist()], dtype=np.int64)[which]


def _lesser(same: States, exchanged: States, first: States, second: States) -> States:
    """Return the states, each in the order of its axes that has the lesser number."""
    return np.minimum(same | first << BITS | second, exchanged | second << BITS | first)


def _way_to_a_violation(model: Model, depths: Sequence[States]) -> str:
    """Return what happened from the start to the violation, with each axis under one name."""
    states = depths[-1]
    while len(states) > 1:
        half = states[: len(states) // 2]
        try:
            model.steps_of_all(half)
            states = states[len(half) :]
        except Violation:
            states = half
    way = [int(states[0])]
    for earlier in reversed(depths[:-1]):
        index, after = model.steps_of_all(earlier)
        way.append(int(earlier[index[np.argmax(after == way[-1])]]))
    way.reverse()
    said, other_names = [], False
    for state, reached in zip(way, [*way[1:], None], strict=True):
        try:
            for same, exchanged, what in model.steps(state):
                if reached == min(same, exchanged):
                    said.append(what.translate(EXCHANGE) if other_names else what)
                    other_names ^= exchanged < same
                    break
        except Violation as violation:
            said.append(str(violation))
    return "\n".join(said)


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
