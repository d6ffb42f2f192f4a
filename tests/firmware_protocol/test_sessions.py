"""The two ends of a session on a good line: every event through both, the state after each."""

import itertools

import msgspec
import pytest

from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC
from firmware_protocol.enums import BoardState, Channel, ErrorCode, Fault, ResetCause
from firmware_protocol.errors import (
    NotARequestError,
    NotConnectedError,
    PayloadError,
    QueueFullError,
)
from firmware_protocol.events import HostState
from firmware_protocol.host import SILENCE_US, HostSession
from firmware_protocol.parameters import BY_NAME
from tests.firmware_protocol.pair import IDENT, SAMPLE, STEP_US, TOKEN, Pair, TestBoard, setpoint

CURRENT_LIMIT = BY_NAME["current_limit_mA"].number
STATE_RATE = BY_NAME["state_rate_hz"].number
REPORT = m.FaultReport(
    axis=0,
    index=0,
    fault=Fault.OVER_TEMPERATURE,
    channel=Channel.SPRING_X,
    t_us=0,
    measured=9600,
    limit=9500,
    snapshot=SAMPLE,
)


def test_hello_leads_to_monitor_with_the_boards_identity() -> None:
    pair = Pair()
    assert pair.host.state is HostState.DISCONNECTED
    pair.host.connect(pair.now_us)
    assert pair.host.state is HostState.SYNC
    pair.run(2)
    assert pair.host.state is HostState.MONITOR
    [connected] = pair.told(e.Connected)
    assert connected.ident.boot_count == 7
    assert connected.ident.session == pair.board.session.session != 0
    assert connected.ident.firmware == "test 1.0"


def test_the_first_byte_after_opening_and_after_a_pause_is_a_delimiter() -> None:
    pair = Pair()
    pair.host.connect(0)
    assert pair.host.data_to_send()[0] == 0
    pair.run(30)
    pair.now_us += 300_000
    pair.host.tick(pair.now_us)
    pair.host.request(m.ParamGet(0, 1), pair.now_us)
    assert pair.host.data_to_send()[0] == 0


def test_hello_is_repeated_ever_more_slowly_until_somebody_answers() -> None:
    pair = Pair()
    pair.host.connect(0)
    sent = []
    for now_us in range(0, 5_000_000, 10_000):
        pair.host.tick(now_us)
        if pair.host.data_to_send():
            sent.append(now_us)
    assert sent == [0, 100_000, 300_000, 700_000, 1_700_000, 2_700_000, 3_700_000, 4_700_000]


def test_samples_arrive_with_their_time_unwrapped() -> None:
    pair = Pair(board=TestBoard(t_us=(1 << 32) - 300_000)).connect().run(100)
    samples = pair.told(e.StateReceived)
    assert samples[-1].state.t_us < samples[0].state.t_us
    steps = {b.board_us - a.board_us for a, b in itertools.pairwise(samples)}
    assert steps == {STEP_US}
    assert pair.host.stats.missed_states == 0


def test_arming_takes_a_token_and_a_confirmation_and_ends_with_disarm() -> None:
    pair = Pair().connect()
    done = pair.ask(m.ArmRequest(0, pair.board.session.parameters.crc))
    assert isinstance(done, e.RequestDone)
    assert done.reply == m.ArmToken(0, TOKEN, 2000)
    assert pair.host.state is HostState.READY
    pair.ask(m.ArmConfirm(0, TOKEN))
    assert pair.host.state is HostState.RUNNING
    pair.run(20)
    assert pair.host.state is HostState.RUNNING
    pair.ask(m.Disarm(0))
    pair.run(2)
    assert pair.host.state is HostState.MONITOR
    assert pair.board.mode is BoardState.COOL


def test_a_token_that_is_not_used_expires_on_the_host_too() -> None:
    pair = Pair().connect()
    pair.ask(m.ArmRequest(0, pair.board.session.parameters.crc))
    assert pair.host.state is HostState.READY
    pair.run(205)
    assert pair.host.state is HostState.MONITOR


def test_a_refused_confirmation_leaves_the_host_in_monitor() -> None:
    pair = Pair().connect()
    pair.ask(m.ArmRequest(0, pair.board.session.parameters.crc))
    failed = pair.ask(m.ArmConfirm(0, TOKEN + 1))
    assert isinstance(failed, e.RequestFailed)
    assert failed.error is not None
    assert failed.error.code is ErrorCode.TOKEN_WRONG
    assert pair.host.state is HostState.MONITOR


def test_arming_is_refused_when_the_parameters_differ() -> None:
    pair = Pair().connect()
    failed = pair.ask(m.ArmRequest(0, pair.board.session.parameters.crc ^ 1))
    assert isinstance(failed, e.RequestFailed)
    assert failed.reason is e.FailureReason.REFUSED
    assert failed.error is not None
    assert failed.error.code is ErrorCode.PARAMETERS_DIFFER
    assert pair.board.actions == {}


def test_a_board_found_armed_is_only_watched() -> None:
    pair = Pair()
    pair.board.mode = BoardState.ARMED
    pair.connect()
    assert pair.board.mode is BoardState.COOL
    pair.board.mode = BoardState.ARMED
    pair.run(5)
    assert pair.host.state is HostState.MONITOR


def test_setpoints_are_acknowledged_and_their_age_is_counted_from_their_sample() -> None:
    pair = Pair().connect()
    pair.control = True
    pair.run(300)
    samples = pair.told(e.StateReceived)[-100:]
    assert {sample.setpoints_pending for sample in samples} == {0}
    assert {sample.state.sp_age_us for sample in samples} == {0}
    assert pair.host.stats.ack_errors == 0
    assert pair.board.session.stats.stale_setpoints == 0


def test_of_several_setpoints_only_the_latest_is_sent() -> None:
    pair = Pair().connect()
    now = pair.board.now()
    for current in (100, 200, 300):
        pair.host.send_setpoint(setpoint(now, (current, 0)))
    pair.run(1)
    received = [x for x in pair.board.events if isinstance(x, e.SetpointReceived)]
    assert [x.setpoint.i_mA for x in received] == [(300, 0)]
    assert pair.host.stats.setpoints_dropped == 2


def test_a_setpoint_older_than_fifty_milliseconds_by_board_time_is_discarded() -> None:
    pair = Pair().connect()
    for age_us, accepted in ((50_000, True), (50_001, False), (-1, False), (1 << 31, False)):
        session = pair.board.session
        before = session.stats.stale_setpoints
        t_us = pair.board.t_us + STEP_US
        pair.host.send_setpoint(setpoint((t_us - age_us) % (1 << 32)))
        pair.run(1)
        assert (session.stats.stale_setpoints == before) is accepted, age_us


def test_a_setpoint_overtaken_by_a_later_one_is_discarded() -> None:
    pair = Pair().connect()
    first, second = (
        CODEC.frame(setpoint(pair.board.now() + 100 * i), i, pair.host.session) for i in (1, 2)
    )
    pair.board.t_us += 1000
    pair.board.take(second + first + second)
    received = [x for x in pair.board.events if isinstance(x, e.SetpointReceived)]
    assert [x.seq for x in received] == [2]
    assert pair.board.session.stats.stale_setpoints == 2


def test_a_setpoint_that_does_not_fit_the_wire_is_refused_at_once() -> None:
    pair = Pair().connect()
    with pytest.raises(PayloadError, match="i_mA"):
        pair.host.send_setpoint(setpoint(0, (-1, 0)))


def test_a_lying_acknowledgement_is_counted_and_not_believed() -> None:
    pair = Pair().connect()
    pair.control = True
    pair.run(50)
    pair.board.lie = 100
    pair.run(10)
    assert pair.host.stats.ack_errors == 10
    assert pair.told(e.StateReceived)[-1].setpoints_pending is None
    pair.board.lie = 0
    pair.run(10)
    assert pair.host.stats.ack_errors == 10
    assert pair.told(e.StateReceived)[-1].setpoints_pending == 0


def test_an_acknowledgement_that_stays_behind_shows_as_pending_setpoints() -> None:
    pair = Pair().connect()
    pair.control = True
    pair.run(20)
    pair.up.dead = True
    pair.run(20)
    assert pair.told(e.StateReceived)[-1].setpoints_pending == 19


def test_a_setpoint_of_an_earlier_session_is_not_acknowledged_in_a_new_one() -> None:
    pair = Pair().connect()
    pair.control = True
    pair.run(20)
    pair.control = False
    pair.host.connect(pair.now_us)
    pair.run(20)
    assert pair.told(e.StateReceived)[-1].setpoints_pending is None
    assert pair.host.stats.ack_errors == 0


def test_estop_is_sent_three_times_and_works_without_a_session() -> None:
    pair = Pair()
    pair.host.connect(pair.now_us)
    pair.host.data_to_send()
    pair.host.send_estop()
    pair.board.take(pair.host.data_to_send())
    assert pair.board.events == [e.EstopReceived()] * 3
    assert pair.board.mode is BoardState.ESTOP
    pair.run(20)
    assert pair.host.state is HostState.FAULTED


def test_estop_goes_before_everything_that_waits() -> None:
    pair = Pair().connect()
    pair.host.request(m.ParamGet(0, 1), pair.now_us)
    pair.host.send_setpoint(setpoint(pair.board.now()))
    pair.host.send_estop()
    pair.board.events.clear()
    pair.board.take(pair.host.data_to_send())
    assert pair.board.events[:3] == [e.EstopReceived()] * 3


def test_estop_is_repeated_until_the_board_says_so() -> None:
    pair = Pair().connect()
    pair.up.dead = True
    pair.host.send_estop()
    pair.run(5)
    assert pair.board.mode is BoardState.SAFE
    pair.up.dead = False
    pair.run(2)
    assert pair.board.mode is BoardState.ESTOP
    pair.run(2)
    heard = len(pair.board.events)
    pair.run(10)
    assert len(pair.board.events) == heard


def test_estop_ends_with_the_power_cycle_that_it_asks_for() -> None:
    pair = Pair().connect()
    pair.up.dead = True
    pair.host.send_estop()
    pair.run(5)
    pair.reboot()
    pair.up.dead = False
    pair.run(100)
    assert pair.board.mode is BoardState.SAFE
    assert pair.host.state is HostState.MONITOR


@pytest.mark.parametrize("cause", [ResetCause.PIN, ResetCause.WATCHDOG, ResetCause.UNKNOWN])
def test_an_estop_that_a_reset_of_the_board_swallowed_is_sent_again(cause: ResetCause) -> None:
    pair = Pair().connect()
    pair.up.dead = True
    pair.host.send_estop()
    pair.run(5)
    pair.reboot(cause=cause)
    pair.up.dead = False
    pair.run(100)
    assert pair.board.mode is BoardState.ESTOP


def test_another_board_on_the_port_has_a_clock_and_an_estop_of_its_own() -> None:
    pair = Pair().connect().run(200)
    assert pair.host.clock is not None
    known = pair.host.clock.exchanges
    pair.host.send_estop()
    pair.host.lost(pair.now_us)
    pair.board = TestBoard(ident=msgspec.structs.replace(IDENT, uid=b"ba9876543210"))
    pair.connect()
    assert pair.host.clock is not None
    assert pair.host.clock.exchanges < known
    assert pair.board.mode is BoardState.SAFE


def test_a_fault_is_sent_three_times_told_once_and_can_be_read_again() -> None:
    pair = Pair().connect().arm()
    pair.board.mode = BoardState.FAULT
    sent = pair.board.session.send_fault(msgspec.structs.replace(REPORT, t_us=pair.board.now()))
    assert sent.index == 0
    pair.run(5)
    assert pair.frames_heard[m.FaultReport.info.number] == 3
    assert pair.told(e.FaultReported) == [e.FaultReported(sent)]
    assert pair.host.state is HostState.FAULTED
    done = pair.ask(m.FaultGet(0, 0))
    assert isinstance(done, e.RequestDone)
    assert done.reply == sent
    assert len(pair.told(e.FaultReported)) == 1


def test_a_fault_that_comes_while_a_report_is_asked_for_is_told_and_no_answer() -> None:
    pair = Pair().connect()
    first = pair.board.session.send_fault(REPORT)
    pair.run(5)
    pair.host.request(m.FaultGet(0, first.index), pair.now_us)
    other = pair.board.session.send_fault(msgspec.structs.replace(REPORT, fault=Fault.LEAK))
    pair.run(5)
    assert pair.told(e.FaultReported) == [e.FaultReported(first), e.FaultReported(other)]
    assert [done.reply for done in pair.told(e.RequestDone)] == [first]


def test_the_first_fault_is_in_the_identity_and_survives_many_later_ones() -> None:
    pair = Pair().connect()
    for _ in range(300):
        pair.board.session.send_fault(msgspec.structs.replace(REPORT, fault=Fault.LEAK))
        pair.board.session.data_to_send()
    reports = pair.board.session.reports
    assert reports.count(0) == 300
    assert reports.get(0, 0) is not None
    assert reports.get(0, 5) is None
    assert reports.get(0, 255) is not None
    pair.host.connect(pair.now_us)
    pair.run(10)
    assert pair.told(e.Connected)[-1].ident.first_fault == Fault.LEAK


def test_reading_a_report_that_does_not_exist_is_refused() -> None:
    failed = Pair().connect().ask(m.FaultGet(0, 3))
    assert isinstance(failed, e.RequestFailed)
    assert failed.error is not None
    assert failed.error.code is ErrorCode.NO_SUCH_REPORT


def test_parameters_are_read_set_and_saved_in_safe_only() -> None:
    pair = Pair().connect()
    row = BY_NAME["current_limit_mA"]
    read = pair.ask(m.ParamGet(0, row.number))
    assert isinstance(read, e.RequestDone)
    assert isinstance(read.reply, m.ParamValue)
    assert (read.reply.value, read.reply.minimum, read.reply.maximum) == (
        row.default,
        row.minimum,
        row.maximum,
    )
    written = pair.ask(m.ParamSet(0, row.number, 2500))
    assert isinstance(written, e.RequestDone)
    assert isinstance(written.reply, m.ParamValue)
    assert written.reply.value == 2500
    assert written.reply.param_crc == pair.board.session.parameters.crc != read.reply.param_crc
    assert e.ParameterChanged(0, "current_limit_mA", 2500) in pair.board.events
    assert isinstance(pair.ask(m.ParamSave()), e.RequestDone)
    pair.arm()
    for message in (m.ParamSet(0, row.number, 3000), m.ParamSave()):
        failed = pair.ask(message)
        assert isinstance(failed, e.RequestFailed)
        assert failed.error is not None
        assert failed.error.code is ErrorCode.WRONG_STATE
        assert (failed.error.value, failed.error.limit) == (BoardState.ARMED, BoardState.SAFE)
    assert pair.board.session.parameters.get("current_limit_mA") == 2500


@pytest.mark.parametrize(
    ("message", "code", "value", "limit"),
    [
        (m.ParamSet(0, CURRENT_LIMIT, 4001), ErrorCode.OUT_OF_RANGE, 4001, 4000),
        (m.ParamSet(0, STATE_RATE, 200), ErrorCode.RATE_TOO_HIGH, 200, 100),
        (m.ParamSet(0, STATE_RATE, 99), ErrorCode.OUT_OF_RANGE, 99, 100),
        (m.ParamGet(0, 9999), ErrorCode.UNKNOWN_PARAMETER, 9999, 0),
        (m.ParamGet(3, 1), ErrorCode.NO_SUCH_AXIS, 3, 0),
        (m.Disarm(1), ErrorCode.NO_SUCH_AXIS, 1, 0),
    ],
)
def test_a_refusal_carries_the_code_the_value_and_the_limit(
    message: m.Message, code: ErrorCode, value: int, limit: int
) -> None:
    failed = Pair().connect().ask(message)
    assert isinstance(failed, e.RequestFailed)
    assert failed.error is not None
    assert (failed.error.code, failed.error.value, failed.error.limit) == (code, value, limit)


def test_requests_go_one_at_a_time_in_the_order_asked() -> None:
    pair = Pair().connect()
    ids = [pair.host.request(m.ParamGet(0, n), pair.now_us) for n in (1, 10, 11, 12)]
    first = pair.host.data_to_send()
    assert first.count(b"\0") == 1 + first.startswith(b"\0")
    pair.board.take(first)
    pair.run(10)
    assert [done.id for done in pair.told(e.RequestDone)] == ids


def test_what_is_no_request_or_has_no_session_is_refused_with_the_reason() -> None:
    pair = Pair()
    with pytest.raises(NotConnectedError, match="DISCONNECTED"):
        pair.host.request(m.Disarm(0), 0)
    with pytest.raises(NotConnectedError, match="cut the power"):
        pair.host.send_estop()
    pair.connect()
    with pytest.raises(NotARequestError, match="Setpoint"):
        pair.host.request(setpoint(0), pair.now_us)
    with pytest.raises(PayloadError, match="axis"):
        pair.host.request(m.Disarm(300), pair.now_us)


def test_a_flood_of_requests_is_refused_before_it_fills_the_memory() -> None:
    pair = Pair().connect()
    for _ in range(513):
        pair.host.request(m.ParamGet(0, 1), pair.now_us)
    with pytest.raises(QueueFullError, match="512"):
        pair.host.request(m.ParamGet(0, 1), pair.now_us)


def test_link_statistics_are_told() -> None:
    pair = Pair().connect()
    pair.board.take(b"garbage\0")
    pair.board.session.send_link_stats(pair.board.t_us, overruns=3, longest_loop_us=420)
    pair.run(1)
    [told] = pair.told(e.StatsReceived)
    assert (told.stats.length_errors, told.stats.overruns, told.stats.longest_loop_us) == (
        1,
        3,
        420,
    )


def test_a_sample_that_was_not_sent_yet_makes_way_for_the_next() -> None:
    board = TestBoard()
    for _ in range(5):
        board.t_us += STEP_US
        board.sample()
    assert board.session.data_to_send().count(0) == 2
    assert board.session.stats.dropped_states == 4


def test_a_reader_that_stays_away_does_not_fill_the_boards_memory() -> None:
    board = TestBoard()
    for _ in range(1000):
        board.session.send_link_stats(0)
    assert len(board.session.data_to_send()) <= 8193
    assert board.session.stats.dropped_frames > 0


def test_the_board_does_not_answer_with_what_the_table_does_not_list() -> None:
    pair = Pair().connect()
    request = e.Request(m.Disarm(0), 1, pair.host.session)
    with pytest.raises(NotARequestError, match="Done"):
        pair.board.session.reply(request, m.ArmToken(0, 1, 1), 0)


def test_two_axes_are_watched_together_and_the_worse_one_counts() -> None:
    board = TestBoard(ident=msgspec.structs.replace(IDENT, axes=2))
    pair = Pair(board=board).connect()
    pair.arm()
    assert pair.host.state is HostState.RUNNING
    other = msgspec.structs.replace(SAMPLE, axis=1, mode=BoardState.FAULT, t_us=1)
    board.session.send_state(other)
    pair.move()
    pair.move()
    assert pair.host.state is HostState.FAULTED


def test_a_fault_of_another_axis_is_none_of_the_axis_that_is_used() -> None:
    board = TestBoard(ident=msgspec.structs.replace(IDENT, axes=2))
    pair = Pair(board=board)
    pair.host = HostSession(nonce=1, axis=0)
    pair.connect()
    board.session.send_fault(msgspec.structs.replace(REPORT, axis=1))
    pair.run(5)
    assert pair.host.state is HostState.MONITOR
    assert pair.told(e.FaultReported) == []


@pytest.mark.parametrize("patience", [1, 60])
def test_a_silent_board_is_given_up_after_the_patience_of_its_host(patience: int) -> None:
    pair = Pair()
    pair.host = HostSession(nonce=1, patience=patience)
    pair.host.connect(pair.now_us)
    pair.run(2)
    assert pair.host.state is HostState.MONITOR
    heard_us = pair.now_us
    pair.host.tick(heard_us + patience * SILENCE_US - STEP_US)
    assert pair.host.state is HostState.MONITOR
    lost = pair.host.tick(heard_us + patience * SILENCE_US + STEP_US)
    assert any(isinstance(event, e.LinkLost) for event in lost)
