"""What can happen on a bench of two axes while it is armed and stopped, one step at a time.

For `tests.smad.daemon.model`, which says what is left out and why. A step looks at the machine and
at the board of the first axis at most; what it does to other boards is kept as functions of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from smad.daemon.arming import Arming, Attempt, Input, Phase, Send

NAMES = ("A", "B")
WANTED = (("A", "B"), ("A",), ("B",))
"""What a client arms."""
MOST_TO_BOARD = 2
"""Messages on their way to a board; one more is lost."""
BOOTS_APART = 1 << 24
"""More stops than a daemon makes."""
GENERATION = 1 << 40
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

    def put(self, message: str) -> Board:
        """Send it a message."""
        return self._replace(to_board=(*self.to_board, message)[:MOST_TO_BOARD])

    def arrive(self) -> tuple[Board, str]:
        """Let the board act on the next message; return it and its answer."""
        message, *rest = self.to_board
        board = self._replace(to_board=tuple(rest))
        if message in ("disarm", OLD_DISARM):
            mode = "off" if board.mode == "armed" else board.mode
            return board._replace(mode=mode, confirmed=False), message
        if board.confirmed or not board.token or board.mode != "off":
            return board, "confirm" if board.confirmed else "confirm refused"
        if message == OLD_CONFIRM:
            raise Violation("a board is armed by an arming of before it was told to be off")
        return board._replace(mode="armed", token=False, confirmed=True), "confirm"


# What the daemon does to a board, whatever state that is in.


def ask_to_disarm(board: Board) -> Board:
    """Send DISARM."""
    return board._replace(wanted="disarm").put("disarm")


def ask_to_confirm(board: Board) -> Board:
    """Send ARM_CONFIRM. Numbers tell the answer to the next DISARM from one to an earlier."""
    earlier = tuple(OLD_DISARM if m == "disarm" else m for m in board.to_board)
    return board._replace(wanted="confirm", to_board=earlier).put("confirm")


def forget(board: Board) -> Board:
    """Wait for no answer any more."""
    return board._replace(wanted="")


def tell_off(board: Board) -> Board:
    """Say to a client that it is off. Raises Violation when it is not."""
    if board.mode == "armed":
        raise Violation("a board is told to be off, and it is armed")
    queue = tuple(OLD_CONFIRM if m == "confirm" else m for m in board.to_board)
    return board._replace(to_board=queue)


Effects = tuple[Callable[[Board], Board], ...]


class AxisState(NamedTuple):
    """What the daemon knows of an axis, and whether it is one of those that are being armed."""

    phase: Phase
    reachable: bool
    in_attempt: bool
    was_off: bool = False
    """Known to be off at some moment since somebody waits for a reply that says so."""


class MachineState(NamedTuple):
    """What the daemon knows."""

    axes: tuple[AxisState, AxisState]
    attempt: tuple[bool, bool] | None
    """Whether it failed, whether it confirms."""
    replies_open: int

    def exchanged(self) -> MachineState:
        """Return the same with the other axis as the first."""
        first, second = self.axes
        return self._replace(axes=(second, first))


_NO_SESSION = AxisState(Phase.NO_SESSION, reachable=False, in_attempt=False)
AT_START = MachineState((_NO_SESSION, _NO_SESSION), None, 0)


class Case:
    """The machine and what happens to it in one step, with what that does to the boards.

    `board`, where it is known, is that of the first axis.
    """

    def __init__(self, alone: frozenset[str], state: MachineState, board: Board | None) -> None:
        self.state = state
        self.board = board
        self.was_off = {n for n, axis in zip(NAMES, state.axes, strict=True) if axis.was_off}
        self.effects: dict[str, Effects] = dict.fromkeys(NAMES, ())
        self.machine = machine = Arming(NAMES, alone)
        machine.generation = GENERATION
        machine.replies_open = state.replies_open
        for name, axis in zip(NAMES, state.axes, strict=True):
            known = machine.axes[name]
            known.phase, known.reachable, known.since = axis.phase, axis.reachable, GENERATION
        if state.attempt is not None:
            wanted = tuple(n for n, axis in zip(NAMES, state.axes, strict=True) if axis.in_attempt)
            machine.attempt = Attempt(wanted, GENERATION, *state.attempt)

    def after(self) -> MachineState:
        """Return what the machine knows now."""
        machine, attempt = self.machine, self.machine.attempt
        waiting = machine.replies_open > 0 or (attempt is not None and attempt.failed)
        first, second = (
            AxisState(
                axis.phase,
                axis.reachable,
                in_attempt=attempt is not None and name in attempt.names,
                was_off=waiting and (axis.phase is Phase.OFF or name in self.was_off),
            )
            for name, axis in machine.axes.items()
        )
        asked = None if attempt is None else (attempt.failed, attempt.confirming)
        return MachineState((first, second), asked, machine.replies_open)

    def do(self, name: str, effect: Callable[[Board], Board]) -> None:
        """Do something to a board, now or, where it is not known, later."""
        if self.board is not None and name == NAMES[0]:
            self.board = effect(self.board)
        else:
            self.effects[name] += (effect,)

    # What the daemon does, as `smad.daemon.stops` and `smad.daemon.command.arming` do

    def send(self) -> None:
        for name, send in self.machine.take_sends():
            self.do(name, ask_to_disarm if send is Send.DISARM else ask_to_confirm)

    def stop(self, names: tuple[str, ...]) -> None:
        before = self.machine.generation
        self.machine.stop(names)
        self.require_overtaken(before, names)
        self.send()

    def require_overtaken(self, generation: int, stopped: tuple[str, ...]) -> None:
        for names in WANTED:
            if set(names) & set(stopped) and self.machine.is_current(generation, names):
                raise Violation("what was asked for before a stop, or of another daemon, holds")

    def fail(self, name: str) -> None:
        self.stop(self.machine.stopped_by(name))

    def give_up(self) -> None:
        attempt = self.machine.attempt
        assert attempt is not None
        if attempt.confirming:
            self.stop(tuple({n for name in attempt.names for n in self.machine.stopped_by(name)}))
        else:
            self.machine.fail()
            self.send()

    def tell_off(self, names: tuple[str, ...]) -> None:
        for name in names:
            self.do(name, tell_off)

    def hear(self, name: str, answer: str) -> None:
        if self.machine.axes[name].reachable:
            self.do(name, forget)
            if answer == "disarm":
                self.machine.disarmed(name)
            elif answer == "confirm":
                self.machine.took(name)
            else:
                self.machine.fail()
                self.send()

    def see(self, name: str, mode: str) -> None:
        if mode == "fault" and self.machine.axes[name].phase is not Phase.OFF:
            self.fail(name)
        if self.machine.shows(name, SHOWN[mode]) and mode != "fault":
            self.fail(name)


What = tuple[str, Case]


def steps_of_axis(case: Callable[[Board], Case], board: Board) -> Iterator[What]:
    """Yield what can happen on the first axis, in words, and the case after it."""
    yield from _of_line(case, board)
    yield from _of_board(case, board)
    yield from _of_link(case, board)


def steps_of_bench(case: Callable[[], Case]) -> Iterator[What]:
    """Yield what can happen whatever the boards do, in words, and the case after it."""
    yield from _of_arming(case)
    yield from _of_clients(case)
    for higher in (True, False):
        boot = "higher" if higher else "lower"
        yield f"the daemon is killed; the next has a {boot} boot id", _restarted(case(), higher)


def _of_line(case: Callable[[Board], Case], board: Board) -> Iterator[What]:
    name = NAMES[0]
    if board.to_board:
        message = board.to_board[0]
        yield f"{name}: {message} is lost", case(board._replace(to_board=board.to_board[1:]))
        arrived, answer = board.arrive()
        yield f"{name}: {message} arrives, its answer is lost", case(arrived)
        if answer.startswith(board.wanted or " "):
            heard = case(arrived)
            heard.hear(name, answer)
            yield f"{name}: {message} arrives; {answer}", heard
    if board.wanted and board.wanted not in board.to_board:
        yield f"{name}: {board.wanted} is repeated", case(board.put(board.wanted))


def _of_board(case: Callable[[Board], Case], board: Board) -> Iterator[What]:
    name = NAMES[0]
    seen = case(board)
    if seen.machine.axes[name].reachable:
        seen.see(name, board.mode)
        yield f"{name}: a sample shows {board.mode}", seen
    if board.mode == "armed":
        yield f"{name}: finds a fault", case(board._replace(mode="fault"))
    elif board.mode == "fault" and not board.to_board:
        yield f"{name}: somebody clears the fault", case(board._replace(mode="off"))


def _of_link(case: Callable[[Board], Case], board: Board) -> Iterator[What]:
    name = NAMES[0]
    axis = case(board).machine.axes[name]
    if axis.reachable:
        lost = case(forget(board))
        lost.machine.lost(name)
        lost.fail(name)
        yield f"{name}: the session is lost", lost
    elif not board.to_board:
        mode = "off" if board.mode == "armed" else board.mode
        met = case(board._replace(mode=mode, confirmed=False))
        met.machine.connected(name)
        yield f"{name}: a new session", met
    if axis.phase in (Phase.STOPPING, Phase.NO_SESSION):
        # So much time without a setpoint: hold and fault, and no token is valid any more.
        mode = "fault" if board.mode == "armed" else board.mode
        quiet = case(board._replace(mode=mode, token=False))
        quiet.machine.watchdog_expired(name)
        yield f"{name}: its watchdog's time passes", quiet
    if axis.phase is Phase.ASKED and board.mode == "off" and not board.to_board:
        granted = case(board._replace(token=True, confirmed=False))
        granted.machine.granted(name)
        yield f"{name}: gives a token", granted


def _of_arming(case: Callable[[], Case]) -> Iterator[What]:
    attempt = case().machine.attempt
    if attempt is None:
        return
    if not attempt.failed:
        given_up = case()
        given_up.give_up()
        yield "the arming is given up: refused, late, or not in control any more", given_up
    confirming = case()
    confirming.machine.confirm()
    confirming.send()
    yield "all tokens are confirmed", confirming
    ended = case()
    if ended.machine.whole:
        ended.machine.end()
        yield "the reply to an arming is sent", ended
    if attempt.failed:
        refused = case()
        if refused.was_off.issuperset(attempt.names):
            refused.tell_off(attempt.names)
            refused.machine.end()
            yield "the refusal of an arming is sent", refused
        unconfirmed = case()
        unconfirmed.machine.end()
        yield "the refusal of an arming is sent, and says that it is not confirmed", unconfirmed


def _of_clients(case: Callable[[], Case]) -> Iterator[What]:
    for names in WANTED:
        armed = case()
        if armed.machine.why_not(names, armed.machine.generation) is None:
            armed.machine.begin(names, armed.machine.generation)
            armed.machine.ask()
            armed.machine.take_sends()
            yield f"a client arms {names}", armed
    stopped = case()
    stopped.stop(NAMES)
    stopped.machine.replies_open = 1
    yield "a client stops", stopped
    replied = case()
    if replied.machine.replies_open:
        if replied.was_off.issuperset(NAMES):
            replied.tell_off(NAMES)
            replied.machine.replies_open -= 1
            yield "the reply to a stop is sent", replied
        unconfirmed = case()
        unconfirmed.machine.replies_open -= 1
        yield "the reply to a stop says that it is not confirmed", unconfirmed


def _restarted(after: Case, higher: bool) -> Case:
    before = after.machine
    used = [before.generation, *(axis.since for axis in before.axes.values())]
    after.machine = machine = Arming(NAMES, before.alone)
    machine.generation = max(used) + BOOTS_APART if higher else min(used) - BOOTS_APART
    for name in NAMES:
        machine.axes[name].since = machine.generation
        after.do(name, forget)
    after.require_overtaken(before.generation, NAMES)
    return after
