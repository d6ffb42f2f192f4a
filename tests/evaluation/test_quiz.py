"""The quiz: a host records a run from the hidden bench over the wire, then the answer opens."""

import json
import os
from pathlib import Path

import pytest

from evaluation.command import main
from evaluation.errors import QuizError
from evaluation.plant.effects import names
from evaluation.plant.parameters import Bench
from evaluation.quiz import mystery as quiz
from evaluation.quiz.wire_board import WireBoard
from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol.enums import BoardState
from firmware_protocol.host import HostSession


class Host:
    """A host at the other end, in lockstep with the board's clock."""

    def __init__(self, board: WireBoard, nonce: int = 77) -> None:
        self.board = board
        self.session = HostSession(nonce=nonce)
        self.states: list[m.State] = []
        self.events: list[e.HostEvent] = []
        self.setpoint: tuple[int, int, int, int] | None = None
        self.session.connect(board.now_us)

    def run(self, samples: int) -> None:
        for _ in range(samples):
            self._take(self.board.receive(self.session.data_to_send()))
            self._take(self.board.step())
            self._take(self.board.receive(self.session.data_to_send()))
            self.events += self.session.tick(self.board.now_us)

    def _take(self, data: bytes) -> None:
        for event in self.session.receive(data, self.board.now_us):
            self.events.append(event)
            if isinstance(event, e.StateReceived):
                self.states.append(event.state)
                self._answer(event.state)

    def _answer(self, state: m.State) -> None:
        if self.setpoint is None:
            return
        i_x, i_y, pump_x, pump_y = self.setpoint
        self.session.send_setpoint(
            m.Setpoint(
                axis=0,
                t_ref_us=state.t_us,
                i_mA=(i_x, i_y),
                pump_duty=(pump_x, pump_y),
                flags=0,
                ttl_ms=100,
            )
        )

    def arm(self) -> None:
        for _ in range(12):
            self.run(110)
            if self.session.clock is not None:
                break
        ident = self.session.board
        assert ident is not None
        self.session.request(m.ArmRequest(axis=0, param_crc=ident.param_crc), self.board.now_us)
        self.run(5)
        token = [ev.reply for ev in self.events if isinstance(ev, e.RequestDone)][-1]
        assert isinstance(token, m.ArmToken)
        self.setpoint = (0, 0, 0, 0)
        self.session.request(m.ArmConfirm(axis=0, token=token.token), self.board.now_us)
        self.run(5)
        assert self.board.state == BoardState.ARMED


@pytest.fixture
def host() -> Host:
    riddle = quiz.riddle(5)
    return Host(WireBoard(riddle.bench, riddle.active, 5))


def test_a_host_records_a_stroke_from_the_hidden_bench(host: Host) -> None:
    host.arm()
    host.setpoint = (3500, 0, 0, 255)
    host.run(550)
    hot = host.states[-1]
    assert hot.rtd_cC[0] > 4000
    assert hot.encoder_counts > 3000
    assert hot.force_counts > 1300
    host.setpoint = (0, 0, 255, 0)
    host.run(900)
    cold = host.states[-1]
    assert cold.rtd_cC[0] < 3500
    assert cold.encoder_counts < hot.encoder_counts - 1000
    assert cold.faults == 0


def test_nothing_flows_before_the_board_is_armed(host: Host) -> None:
    host.setpoint = (3000, 0, 0, 0)
    host.run(300)
    assert {s.mode for s in host.states} == {BoardState.SAFE}
    assert all(s.i_applied_mA == (0, 0) for s in host.states)
    assert max(abs(s.i_meas_mA[0]) for s in host.states) < 20


def test_a_host_that_falls_silent_loses_the_heater(host: Host) -> None:
    host.arm()
    host.setpoint = (2000, 0, 0, 0)
    host.run(50)
    host.setpoint = None
    host.run(100)
    assert host.board.state == BoardState.FAULT
    assert host.states[-1].i_applied_mA == (0, 0)
    assert [ev for ev in host.events if isinstance(ev, e.FaultReported)]


def test_a_new_session_disarms_and_an_emergency_stop_ends_everything(host: Host) -> None:
    host.arm()
    again = Host(host.board, nonce=78)
    again.run(20)
    modes = {s.mode for s in again.states}
    assert modes <= {BoardState.SAFE, BoardState.COOL}
    again.session.send_estop()
    again.run(3)
    assert again.states[-1].mode == BoardState.ESTOP


def test_the_same_number_hides_the_same_effect_and_the_lists_are_both_used() -> None:
    assert quiz.riddle(8).sealed == quiz.riddle(8).sealed
    hidden = {quiz.riddle(n).active[0].name for n in range(200)}
    assert hidden & set(names("known"))
    assert hidden & set(names("spent"))
    assert not hidden & set(names("dev"))


def test_the_answer_is_opened_only_if_it_is_the_sealed_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    note = tmp_path / "mystery.json"
    drawn = quiz.begin(12, note)
    assert drawn.active[0].name not in note.read_text()
    main(["reveal", "--note", str(note)])
    reported = json.loads(capsys.readouterr().out)
    assert reported["effects"][0]["name"] == drawn.active[0].name
    note.write_text(json.dumps(json.loads(note.read_text()) | {"seed": 13}))
    with pytest.raises(QuizError, match="has changed"):
        quiz.reveal(note)
    with pytest.raises(QuizError, match="mystery SEED"):
        quiz.reveal(tmp_path / "none.json")


def test_the_terminal_is_paced_by_the_clock_and_carries_the_session() -> None:
    board = WireBoard(Bench(), (), 1)
    ours, path, theirs = quiz.open_terminal()
    port = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    host = HostSession(nonce=5)
    now = 10.0
    got: list[e.HostEvent] = []

    def wait(descriptor: int, seconds: float) -> bool:
        nonlocal now
        us = round(now * 1e6)
        try:
            got.extend(host.receive(os.read(port, 4096), us))
        except BlockingIOError:
            got.extend(host.tick(us))
        data = host.data_to_send()
        if data:
            os.write(port, data)
            return True
        now += max(seconds, 0.0)
        return False

    host.connect(round(now * 1e6))
    try:
        quiz.serve(board, ours, quiz.Clock(lambda: now, wait), lambda: now < 11.0)
    finally:
        for descriptor in (port, ours, theirs):
            os.close(descriptor)
    states = [ev for ev in got if isinstance(ev, e.StateReceived)]
    assert any(isinstance(ev, e.Connected) for ev in got)
    assert 90 <= len(states) <= 101
