"""The machine of arming, `smad.daemon.arming`, driven through everything that can happen in small.

python -m tests.smad.daemon.model

Two axes, two clients. The machine is the daemon's. Around it is the least that is true of the rest:
boards that arm by a token once and stop by DISARM, by a new session, by their own watchdog or by a
fault; lines that keep the order, but delay and lose whatever they carry; clients that arm any axes
and stop all; a daemon that is killed and started again. Each step is one thing that happens;
breadth-first search visits every state that any order of steps leads to.

Four things make it small and leave nothing out. Stops of two clients that are open at once are told
at the same moment, so they are one. An answer is heard at once or lost: a late one is
one that was lost, and given again to the repeated request. A command that is late is one that is
asked for later, unless a stop came: then its generation must not be in force, which is looked at
when the stop begins, as none that is not ever will be. A board gives its token at once or never: a
token alone arms nothing.

The property, in every state:

1. When the reply to a stop, or the refusal of an arming, is sent, no board that it is for is armed.
2. From then on no board becomes armed but by an arming that was begun afterwards.
3. No arming begins that was asked for before a stop of its axes, or of an earlier daemon.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from smad.daemon.arming import Arming, Attempt, AxisArming, Input, Phase, Send

NAMES = ("a", "b")
WANTED = (("a", "b"), ("a",), ("b",))
"""What a client arms."""
MOST_TO_BOARD = 2
"""Messages on their way to a board; one more is lost."""
BOOTS_APART = 1 << 24
"""More stops than a daemon makes."""
SHOWN = {"off": Input.SHOWS_OFF, "armed": Input.SHOWS_ARMED, "fault": Input.SHOWS_FAULT}
OLD_DISARM = "an earlier disarm"
"""A DISARM that was sent before an ARM_CONFIRM that went out later."""
OLD_CONFIRM = "confirm of before"
"""An ARM_CONFIRM on its way when a reply said that its board is off."""


class Violation(AssertionError):
    """A state that breaks the property."""


class Board(NamedTuple):
    """A board and its line."""

    mode: str = "off"
    token: bool = False
    """Whether a token was given and not used."""
    confirmed: bool = False
    """Whether the last request was ARM_CONFIRM: a repeat is answered, and not carried out."""
    to_board: tuple[str, ...] = ()
    wanted: str = ""
    """The daemon's request that is not answered yet, and repeated until it is."""


class World:
    """One state of everything: the machine, boards and lines, who waits for a reply to a stop.

    A step is one thing that happens: `steps` yields where they lead.
    """

    def __init__(self, alone: frozenset[str]) -> None:
        self.machine = Arming(NAMES, alone)
        self.boards = dict.fromkeys(NAMES, Board())

    def copy(self) -> World:
        """Return another one that can be changed."""
        other = object.__new__(World)
        other.machine = _copy_of(self.machine)
        other.boards = self.boards.copy()
        return other

    def key(self) -> Any:
        """Return what distinguishes this state; the axes are alike, so not which is which."""
        machine, attempt = self.machine, self.machine.attempt
        a, b = (
            (axis.phase.name, axis.reachable, self.boards[name], attempt and name in attempt.names)
            for name, axis in machine.axes.items()
        )
        asked = attempt and (attempt.failed, attempt.confirming)
        return (a, b, asked, machine.replies_open) if a < b else (b, a, asked, machine.replies_open)

    def steps(self) -> Iterator[tuple[str, World]]:
        """Yield what can happen now, in words, and the state after it. Raises Violation."""
        for name in NAMES:
            yield from self._of_line(name)
            yield from self._of_board(name)
            yield from self._of_link(name)
        yield from self._of_arming()
        yield from self._of_clients()
        for higher in (True, False):
            boot = "higher" if higher else "lower"
            yield f"the daemon is killed; the next has a {boot} boot id", self._restarted(higher)

    # What happens

    def _of_line(self, name: str) -> Iterator[tuple[str, World]]:
        board = self.boards[name]
        if board.to_board:
            lost = self.copy()
            message = lost._take_to_board(name)
            yield f"{name}: {message} is lost", lost
            arrived = self.copy()
            answer = arrived._arrive(name, arrived._take_to_board(name))
            yield f"{name}: {message} arrives, its answer is lost", arrived
            if answer.startswith(board.wanted or " "):
                heard = arrived.copy()
                heard._hear(name, answer)
                yield f"{name}: {message} arrives; {answer}", heard
        if board.wanted and board.wanted not in board.to_board:
            repeated = self.copy()
            repeated._put(name, board.wanted)
            yield f"{name}: {board.wanted} is repeated", repeated

    def _of_board(self, name: str) -> Iterator[tuple[str, World]]:
        board = self.boards[name]
        if self.machine.axes[name].reachable:
            after = self.copy()
            after._see(name, board.mode)
            yield f"{name}: a sample shows {board.mode}", after
        if board.mode == "armed":
            yield f"{name}: finds a fault", self._changed(name, mode="fault")
        elif board.mode == "fault" and not board.to_board:
            yield f"{name}: somebody clears the fault", self._changed(name, mode="off")

    def _of_link(self, name: str) -> Iterator[tuple[str, World]]:
        axis, board = self.machine.axes[name], self.boards[name]
        if axis.reachable:
            after = self._changed(name, wanted="")
            after.machine.lost(name)
            after._fail(name)
            yield f"{name}: the session is lost", after
        elif not board.to_board:
            mode = "off" if board.mode == "armed" else board.mode
            after = self._changed(name, mode=mode, confirmed=False)
            after.machine.connected(name)
            yield f"{name}: a new session", after
        if axis.phase in (Phase.STOPPING, Phase.ADRIFT):
            # So much time without a setpoint: hold and fault, and no token is valid any more.
            mode = "fault" if board.mode == "armed" else board.mode
            after = self._changed(name, mode=mode, token=False)
            after.machine.quiet(name)
            yield f"{name}: its watchdog's time passes", after

    def _of_arming(self) -> Iterator[tuple[str, World]]:
        machine, attempt = self.machine, self.machine.attempt
        if attempt is None:
            return
        for name in attempt.names:
            board = self.boards[name]
            asked = machine.axes[name].phase is Phase.ASKED
            if asked and board.mode == "off" and not board.to_board:
                after = self._changed(name, token=True, confirmed=False)
                after.machine.granted(name)
                yield f"{name}: gives a token", after
        if not attempt.failed:
            after = self.copy()
            after.machine.fail()
            after._send()
            yield "the arming is given up: refused, late, or not in control any more", after
        after = self.copy()
        after.machine.confirm()
        after._send()
        yield "all tokens are confirmed", after
        if machine.whole:
            after = self.copy()
            after.machine.end()
            yield "the reply to an arming is sent", after
        if attempt.failed and machine.all_off(attempt.names):
            after = self._told(attempt.names)
            after.machine.end()
            yield "the refusal of an arming is sent", after

    def _of_clients(self) -> Iterator[tuple[str, World]]:
        machine = self.machine
        for names in WANTED:
            if machine.why_not(names, machine.generation) is None:
                after = self.copy()
                after.machine.begin(names, machine.generation)
                after.machine.ask()
                after.machine.take_sends()
                yield f"a client arms {names}", after
        after = self.copy()
        after._stop(NAMES)
        after.machine.replies_open = 1
        yield "a client stops", after
        if machine.replies_open:
            if machine.all_off(NAMES):
                after = self._told(NAMES)
                after.machine.replies_open -= 1
                yield "the reply to a stop is sent", after
            after = self.copy()
            after.machine.replies_open -= 1
            yield "a stop is told to be unconfirmed", after

    def _restarted(self, higher: bool) -> World:
        after = self.copy()
        used = [self.machine.generation, *(axis.since for axis in self.machine.axes.values())]
        after.machine = Arming(NAMES, self.machine.alone)
        after.machine.generation = max(used) + BOOTS_APART if higher else min(used) - BOOTS_APART
        for name in NAMES:
            after.machine.axes[name].since = after.machine.generation
            after._change(name, wanted="")
        after._require_overtaken(self.machine.generation, NAMES)
        return after

    def _told(self, names: tuple[str, ...]) -> World:
        after = self.copy()
        for name in names:
            board = after.boards[name]
            if board.mode == "armed":
                raise Violation(f"it is told that {name} is off, and it is armed")
            queue = tuple(OLD_CONFIRM if m == "confirm" else m for m in board.to_board)
            after._change(name, to_board=queue)
        return after

    # What the daemon does, as `smad.daemon.stops` and `smad.daemon.command.arming` do

    def _send(self) -> None:
        for name, send in self.machine.take_sends():
            kind = "disarm" if send is Send.DISARM else "confirm"
            if kind == "confirm":
                # Numbers tell the answer to the next DISARM from one to an earlier.
                queue = self.boards[name].to_board
                earlier = tuple(OLD_DISARM if m == "disarm" else m for m in queue)
                self._change(name, to_board=earlier)
            self._change(name, wanted=kind)
            self._put(name, kind)

    def _stop(self, names: tuple[str, ...]) -> None:
        before = self.machine.generation
        self.machine.stop(names)
        self._require_overtaken(before, names)
        self._send()

    def _require_overtaken(self, generation: int, stopped: tuple[str, ...]) -> None:
        for names in WANTED:
            if set(names) & set(stopped) and self.machine.is_current(generation, names):
                raise Violation("what was asked for before a stop, or of another daemon, holds")

    def _fail(self, name: str) -> None:
        self._stop(self.machine.stopped_by(name))

    def _hear(self, name: str, answer: str) -> None:
        if self.machine.axes[name].reachable:
            self._change(name, wanted="")
            if answer == "disarm":
                self.machine.disarmed(name)
            elif answer == "confirm":
                self.machine.took(name)
            else:
                self.machine.fail()
                self._send()

    def _see(self, name: str, mode: str) -> None:
        if mode == "fault" and self.machine.axes[name].phase is not Phase.OFF:
            self._fail(name)
        if self.machine.shows(name, SHOWN[mode]) and mode != "fault":
            self._fail(name)

    # What a board does

    def _arrive(self, name: str, message: str) -> str:
        """Let the board act on a message; return its answer."""
        board = self.boards[name]
        if message in ("disarm", OLD_DISARM):
            mode = "off" if board.mode == "armed" else board.mode
            self._change(name, mode=mode, confirmed=False)
            return message
        if board.confirmed or not board.token or board.mode != "off":
            return "confirm" if board.confirmed else "confirm refused"
        if message == OLD_CONFIRM:
            raise Violation(f"{name} is armed by an arming of before it was told to be off")
        self._change(name, mode="armed", token=False, confirmed=True)
        return "confirm"

    def _put(self, name: str, message: str) -> None:
        self._change(name, to_board=(*self.boards[name].to_board, message)[:MOST_TO_BOARD])

    def _take_to_board(self, name: str) -> str:
        message, *rest = self.boards[name].to_board
        self._change(name, to_board=tuple(rest))
        return message

    def _change(self, name: str, **changes: Any) -> None:
        self.boards[name] = self.boards[name]._replace(**changes)

    def _changed(self, name: str, **changes: Any) -> World:
        after = self.copy()
        after._change(name, **changes)
        return after


def _copy_of(machine: Arming) -> Arming:
    other = object.__new__(Arming)
    other.__dict__.update(machine.__dict__, _sends=[])
    other.axes = {
        name: AxisArming(axis.phase, axis.reachable, axis.withheld, axis.since)
        for name, axis in machine.axes.items()
    }
    if (attempt := machine.attempt) is not None:
        other.attempt = Attempt(
            attempt.names, attempt.generation, attempt.failed, attempt.confirming
        )
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


def explore(alone: frozenset[str], most: int | None = None) -> Explored:
    """Visit every state. Raises Violation with the shortest way to one that breaks the property.

    `most` ends the search after so many states, for a look at how it goes.
    """
    start = World(alone)
    seen: dict[Any, tuple[Any, str]] = {start.key(): (None, "")}
    waiting = deque([(start, start.key(), 0)])
    steps = depth = 0
    while waiting and (most is None or len(seen) < most):
        world, key, depth = waiting.popleft()
        try:
            for what, after in world.steps():
                steps += 1
                after_key = after.key()
                if after_key not in seen:
                    seen[after_key] = (key, what)
                    waiting.append((after, after_key, depth + 1))
        except Violation as violation:
            way = []
            while key is not None:
                key, what = seen[key]
                way.append(what)
            raise Violation("\n".join([*reversed(way), str(violation)])) from None
    return Explored(len(seen), steps, depth)


def main() -> None:
    """Search with both policies; print what was explored, and the property."""
    for alone in (frozenset[str](), frozenset(NAMES)):
        began_s = time.monotonic()
        explored = explore(alone)
        policy = "own" if alone else "all"
        print(
            f'fault_holds = "{policy}": {explored.in_words()}, {time.monotonic() - began_s:.0f} s'
        )
    print("The property" + (__doc__ or "").partition("The property")[2].rstrip())


if __name__ == "__main__":
    main()
