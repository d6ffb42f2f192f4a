"""The quiz's board behind its terminal: paced by the clock, or by its host. Time is handed in."""

import os
from collections.abc import Callable, Iterator

import msgspec
import pytest

from evaluation.plant.parameters import Bench
from evaluation.quiz import mystery as quiz
from evaluation.quiz.wire_board import WireBoard
from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol.enums import BoardState
from tests.evaluation.test_quiz import Host

BY_HOST = quiz.Pace(by_host=True, speed=20.0, patience_s=2.0)


class Terminal:
    """An armed board on a terminal, and a host that answers each sample after `thinks` looks.

    A look takes up to `look_s` of a clock that only looking moves.
    """

    def __init__(self, *, thinks: Callable[[int], int], look_s: float = 0.3) -> None:
        self.board = WireBoard(Bench(), (), 1)
        host = Host(self.board)
        host.arm()
        self.session = host.session
        self.states: list[m.State] = []
        self.now_s = 10.0
        self.answers = True
        self.i_mA = 1500
        self._thinks = thinks
        self._look_s = look_s
        self._left = 0
        self._held: m.Setpoint | None = None
        self._ours, path, self._theirs = quiz.open_terminal()
        self._port = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def close(self) -> None:
        for descriptor in (self._port, self._ours, self._theirs):
            os.close(descriptor)

    def serve(self, pace: quiz.Pace, going: Callable[[], bool]) -> None:
        quiz.serve(self.board, self._ours, quiz.Clock(lambda: self.now_s, self._wait), going, pace)

    def _wait(self, descriptor: int, seconds: float) -> bool:
        """What the board calls to wait: the host gets its turn."""
        try:
            data = os.read(self._port, 4096)
        except BlockingIOError:
            data = b""
        for event in self.session.receive(data, self.board.now_us):
            if isinstance(event, e.StateReceived):
                self._think(event.state)
        self._left -= 1
        if self._held is not None and self._left < 0 and self.answers:
            self.session.send_setpoint(self._held)
            self._held = None
        reply = self.session.data_to_send()
        if reply:
            os.write(self._port, reply)
            return True
        self.now_s += min(max(seconds, 0.0), self._look_s)
        return False

    def _think(self, state: m.State) -> None:
        self.states.append(state)
        self._left = self._thinks(len(self.states))
        i_mA = self.i_mA + state.force_counts % 97
        self._held = m.Setpoint(0, state.t_us, (i_mA, 0), (0, 0), 0, 100)


@pytest.fixture
def terminals() -> Iterator[list[Terminal]]:
    made: list[Terminal] = []
    yield made
    for terminal in made:
        terminal.close()


def without_numbers(states: list[m.State]) -> list[m.State]:
    return [msgspec.structs.replace(s, sp_seq=0) for s in states]


def test_a_board_that_waits_for_a_slow_host_answers_as_one_paced_by_the_clock(
    terminals: list[Terminal],
) -> None:
    terminals += [Terminal(thinks=lambda n: 0), Terminal(thinks=lambda n: n % 6)]
    quick, slow = terminals
    quick.serve(quiz.REAL_TIME, lambda: len(quick.states) < 200)
    slow.serve(BY_HOST, lambda: len(slow.states) < 200)
    assert slow.now_s - 10.0 > 20.0, "ten times as long as two seconds of board time"
    assert without_numbers(slow.states) == without_numbers(quick.states)
    assert {s.mode for s in slow.states} == {BoardState.ARMED}
    assert {s.sp_age_us for s in slow.states[1:]} == {0}


def test_a_prompt_host_is_not_kept_waiting_for_the_clock(terminals: list[Terminal]) -> None:
    terminal = Terminal(thinks=lambda n: 0, look_s=0.0)
    terminals.append(terminal)
    terminal.serve(BY_HOST, lambda: len(terminal.states) < 200)
    assert terminal.now_s == 10.0


def test_a_silent_host_is_left_behind_and_the_board_stops_by_itself(
    terminals: list[Terminal],
) -> None:
    terminal = Terminal(thinks=lambda n: 0)
    terminals.append(terminal)
    terminal.serve(BY_HOST, lambda: len(terminal.states) < 50)
    terminal.answers = False
    silent_since_s = terminal.now_s
    terminal.serve(BY_HOST, lambda: terminal.board.state in (BoardState.ARMED, BoardState.HOLD))
    assert terminal.board.state is BoardState.FAULT
    assert 2.0 <= terminal.now_s - silent_since_s < 3.0


def test_a_board_that_cools_hurries_and_one_at_rest_keeps_to_the_clock(
    terminals: list[Terminal],
) -> None:
    terminal = Terminal(thinks=lambda n: 0, look_s=1.0)
    terminals.append(terminal)
    terminal.i_mA = 3500
    terminal.serve(BY_HOST, lambda: len(terminal.states) < 700)
    terminal.session.request(m.Disarm(axis=0), terminal.board.now_us)
    began_s: dict[int, float] = {}
    modes: list[int] = []

    def going() -> bool:
        modes.append(terminal.states[-1].mode)
        began_s.setdefault(modes[-1], terminal.now_s)
        return len(terminal.states) < 1500 and modes.count(BoardState.SAFE) < 40

    terminal.serve(BY_HOST, going)
    cooling = sum(s.mode == BoardState.COOL for s in terminal.states)
    cooled_s = began_s[BoardState.SAFE] - began_s[BoardState.COOL]
    assert cooled_s / cooling == pytest.approx(0.01 / 20.0, rel=0.1)
    assert terminal.now_s - began_s[BoardState.SAFE] > 0.15
