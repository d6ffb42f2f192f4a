"""Sessions on bad lines, from seeds: they recover, and no request acts twice."""

import msgspec
import pytest

from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC
from firmware_protocol.enums import BoardState, ErrorCode
from firmware_protocol.events import HostState
from tests.firmware_protocol.pair import IDENT, STEP_US, Pair, TestBoard, setpoint

DAMAGE = {
    "flipped bits": {"flip": 0.002},
    "many flipped bits": {"flip": 0.01},
    "bursts": {"burst": 0.2},
    "dropped bytes": {"drop": 0.003},
    "inserted bytes": {"insert": 0.003},
    "frames twice": {"twice": 0.3},
    "frames swapped": {"swap": 0.3},
    "everything": {
        "flip": 0.001, "burst": 0.05, "drop": 0.001, "insert": 0.001, "twice": 0.1, "swap": 0.1,
    },
}  # fmt: skip


def spoil(pair: Pair, damage: dict[str, float]) -> None:
    for line in (pair.up, pair.down):
        for name, value in damage.items():
            setattr(line, name, value)


@pytest.mark.parametrize("name", DAMAGE)
@pytest.mark.parametrize("seed", range(4))
def test_a_request_acts_at_most_once_and_what_the_host_believes_is_true(
    name: str, seed: int
) -> None:
    pair = Pair(seed)
    spoil(pair, DAMAGE[name])
    pair.connect()
    done = 0
    for _ in range(60):
        if pair.host.state in (HostState.DISCONNECTED, HostState.SYNC):
            pair.run(20)
            continue
        result = pair.ask(m.ParamSave(), steps=150)
        done += isinstance(result, e.RequestDone)
        pair.control = True
    acted = pair.board.actions
    assert max(acted.values(), default=0) <= 1
    assert done <= len(acted)
    assert done > 0


@pytest.mark.parametrize("name", DAMAGE)
def test_counters_add_up_on_a_bad_line(name: str) -> None:
    pair = Pair(11)
    spoil(pair, DAMAGE[name])
    pair.connect()
    pair.control = True
    pair.run(500)
    stats = pair.host.stats
    assert stats.states == len(pair.told(e.StateReceived))
    assert stats.states + stats.missed_states <= pair.board.tick
    assert stats.states > 100
    if name in ("frames twice", "frames swapped"):
        assert stats.decoder.errors == 0
        assert stats.old_states > 0
    else:
        assert stats.decoder.errors > 0
        assert stats.missed_states > 0


def test_every_cut_of_every_write_gives_the_same_session() -> None:
    whole = Pair(3).connect()
    whole.control = True
    whole.run(100)
    for size in (1, 2, 7, 61):
        cut = Pair(3)
        cut.up.most_bytes = cut.down.most_bytes = size
        cut.connect()
        cut.control = True
        cut.run(100)
        assert cut.told(e.StateReceived) == whole.told(e.StateReceived)


def test_an_answer_lost_is_given_again_without_acting_again() -> None:
    pair = Pair().connect()
    pair.host.request(m.Disarm(0), pair.now_us)
    pair.up.write(pair.host.data_to_send())
    for piece in pair.up.read():
        pair.board.take(piece)
    pair.board.session.data_to_send()
    pair.run(20)
    [done] = pair.told(e.RequestDone)
    assert isinstance(done.reply, m.Done)
    assert list(pair.board.actions.values()) == [1]
    assert pair.board.session.stats.repeated_requests == 1
    assert pair.host.stats.repeats == 1


def test_a_request_that_nobody_answers_is_tried_three_times() -> None:
    pair = Pair().connect()
    pair.up.dead = True
    failed = pair.ask(m.Disarm(0), steps=100)
    assert isinstance(failed, e.RequestFailed)
    assert failed.reason is e.FailureReason.TIMEOUT
    assert pair.host.stats.repeats == 2
    assert pair.host.stats.timeouts == 1


def test_requests_that_go_nowhere_end_the_session_and_the_host_says_hello_again() -> None:
    pair = Pair().connect()
    pair.up.dead = True
    for _ in range(5):
        pair.host.request(m.Disarm(0), pair.now_us)
    pair.run(230)
    failed = pair.told(e.RequestFailed)
    assert [x.reason for x in failed] == [e.FailureReason.TIMEOUT] * 3 + [
        e.FailureReason.LINK_LOST
    ] * 2
    assert pair.host.state is HostState.SYNC
    pair.up.dead = False
    pair.run(150)
    assert pair.host.state is HostState.MONITOR
    assert isinstance(pair.ask(m.Disarm(0)), e.RequestDone)


def test_a_request_of_an_old_session_does_not_act_in_the_new_one() -> None:
    pair = Pair().connect()
    old = CODEC.frame(m.Disarm(0), 1, pair.host.session)
    pair.host.connect(pair.now_us)
    pair.run(10)
    pair.board.take(old)
    pair.run(2)
    assert pair.board.actions == {}
    assert pair.board.session.stats.session_errors == 1
    [refused] = pair.told(e.ErrorReceived)
    assert refused.error.code is ErrorCode.NO_SESSION


def test_late_copies_of_requests_do_not_act_again() -> None:
    pair = Pair().connect()
    frames = []
    for _ in range(5):
        pair.host.request(m.Disarm(0), pair.now_us)
        data = pair.host.data_to_send()
        frames.append(data)
        pair.board.take(data)
        pair.run(1)
    for data in frames:
        pair.board.take(data)
    assert sum(pair.board.actions.values()) == 5
    assert max(pair.board.actions.values()) == 1


def test_three_hundred_requests_wrap_their_numbers_and_all_act_once() -> None:
    pair = Pair().connect()
    for _ in range(300):
        pair.host.request(m.Disarm(0), pair.now_us)
    pair.run(150)
    assert len(pair.told(e.RequestDone)) == 300
    assert sum(pair.board.actions.values()) == 300


def test_a_board_that_is_busy_with_a_request_takes_no_other() -> None:
    pair = Pair().connect()
    session = pair.board.session
    number = pair.host.session
    first = session.receive(CODEC.frame(m.Disarm(0), 1, number), 0)
    second = session.receive(CODEC.frame(m.ParamSet(0, 20, 1000), 2, number), 0)
    assert [type(x) for x in first] == [e.DisarmRequested]
    assert second == []
    assert session.stats.busy_requests == 1
    assert isinstance(first[0], e.DisarmRequested)
    session.done(first[0].request, 0)
    third = session.receive(CODEC.frame(m.ParamSet(0, 20, 1000), 2, number), 0)
    assert third == [e.ParameterChanged(0, "current_limit_mA", 1000)]


@pytest.mark.parametrize("announce", [True, False])
def test_a_board_that_reboots_while_armed_is_found_out_and_not_armed_again(
    announce: bool,
) -> None:
    pair = Pair().connect().arm()
    pair.control = True
    pair.run(10)
    id_ = pair.host.request(m.Disarm(0), pair.now_us)
    pair.reboot(announce=announce)
    pair.run(60)
    [restarted] = pair.told(e.BoardRestarted)
    assert (restarted.ident is not None) is announce
    failed = [x for x in pair.told(e.RequestFailed) if x.id == id_]
    assert [x.reason for x in failed] == [e.FailureReason.BOARD_RESTARTED]
    assert pair.host.state is HostState.MONITOR
    assert pair.board.mode is BoardState.SAFE
    assert pair.told(e.Connected)[-1].ident.boot_count == 8
    assert pair.told(e.StateReceived)[-1].board_us < 1_000_000


def test_a_copy_of_the_boot_message_does_not_end_a_session() -> None:
    board = TestBoard()
    board.session.boot(0)
    boot = board.session.data_to_send()
    pair = Pair(board=board).connect().arm()
    pair.host_hears(boot)
    pair.run(5)
    assert pair.host.state is HostState.RUNNING
    assert pair.told(e.BoardRestarted) == []


def test_two_stray_frames_of_another_session_do_not_end_a_session_but_three_do() -> None:
    pair = Pair().connect()
    sample = pair.told(e.StateReceived)[-1].state
    stray = CODEC.frame(sample, 1, pair.host.session ^ 0x55)
    pair.host_hears(stray * 2)
    pair.run(2)
    assert pair.told(e.BoardRestarted) == []
    assert pair.host.stats.session_errors == 2
    pair.host_hears(stray * 3)
    assert len(pair.told(e.BoardRestarted)) == 1


@pytest.mark.parametrize("stall_s", [0.2, 1.0, 10.0])
def test_a_stalled_link_that_flushes_replays_no_setpoint(stall_s: float) -> None:
    pair = Pair().connect().arm()
    pair.control = True
    pair.run(20)
    pair.up.stalled = True
    pair.run(int(stall_s * 100))
    held = len(pair.up.held)
    accepted = len(pair.board.events)
    pair.up.stalled = False
    pair.step()
    fresh = [x for x in pair.board.events[accepted:] if isinstance(x, e.SetpointReceived)]
    assert held >= stall_s * 100
    assert all(x.age_us <= 50_000 for x in fresh)
    assert len(fresh) <= 6
    assert pair.board.session.stats.stale_setpoints >= held - 30 - len(fresh)
    pair.run(200)
    assert pair.host.state in (HostState.RUNNING, HostState.MONITOR)


def test_silence_of_half_a_second_ends_the_session_and_a_new_one_lands_in_monitor() -> None:
    pair = Pair().connect().arm()
    pair.down.dead = True
    pair.run(49)
    assert pair.told(e.LinkLost) == []
    pair.run(2)
    [lost] = pair.told(e.LinkLost)
    assert 500_000 <= lost.silent_us <= 510_000
    assert pair.host.state is HostState.SYNC
    pair.down.dead = False
    pair.run(150)
    assert pair.host.state is HostState.MONITOR
    assert pair.board.mode is not BoardState.ARMED


def test_a_board_whose_clock_stands_still_is_lost_although_it_talks() -> None:
    pair = Pair().connect()
    sample = pair.told(e.StateReceived)[-1].state
    for i in range(100):
        pair.now_us += STEP_US
        pair.host_hears(CODEC.frame(sample, i, pair.host.session))
        if pair.told(e.LinkLost):
            break
    assert len(pair.told(e.LinkLost)) == 1
    assert pair.host.stats.old_states >= 48


def test_a_port_that_goes_away_fails_what_waited_and_comes_back_in_monitor() -> None:
    pair = Pair().connect().arm()
    id_ = pair.host.request(m.Disarm(0), pair.now_us)
    [failed] = pair.host.lost(pair.now_us)
    assert isinstance(failed, e.RequestFailed)
    assert (failed.id, failed.reason) == (id_, e.FailureReason.LINK_LOST)
    assert pair.host.state is HostState.DISCONNECTED
    assert pair.host.data_to_send() == b""
    assert pair.host.receive(b"anything\0", pair.now_us) == []
    pair.connect()
    assert pair.host.state is HostState.MONITOR


def test_an_echo_is_counted_and_does_no_harm_at_either_end() -> None:
    pair = Pair()
    pair.up.echo_to = pair.down
    pair.down.echo_to = pair.up
    pair.connect()
    pair.down.echo_to = pair.up.echo_to = None
    pair.run(5)
    assert pair.host.stats.echoes > 0
    assert pair.board.session.stats.echoes > 0
    assert pair.host.state is HostState.MONITOR
    assert isinstance(pair.ask(m.ParamSave()), e.RequestDone)


def test_modem_probe_text_at_open_does_not_disturb_the_handshake() -> None:
    pair = Pair()
    pair.board.take(b"AT\rATE1 E0 V1\rAT+GCAP\r")
    pair.connect()
    assert pair.host.state is HostState.MONITOR
    assert pair.board.session.stats.decoder.errors == 1


def test_a_megabyte_of_noise_each_way_leaves_the_session_alive() -> None:
    pair = Pair().connect()
    noise = pair.rng.randbytes(1 << 16)
    for _ in range(16):
        pair.host_hears(noise)
        pair.board.take(noise)
    pair.run(5)
    assert pair.host.state is HostState.MONITOR
    assert pair.told(e.LinkLost) == []
    assert isinstance(pair.ask(m.ParamSave()), e.RequestDone)


def test_another_host_takes_over_the_session_and_the_first_one_notices() -> None:
    pair = Pair().connect()
    other = Pair(99, board=pair.board)
    other.host.connect(other.now_us)
    pair.board.take(other.host.data_to_send())
    pair.board.session.data_to_send()
    pair.run(4)
    assert [x.ident for x in pair.told(e.BoardRestarted)] == [None]
    assert pair.host.state is not HostState.RUNNING


def test_the_board_complains_at_most_ten_times_a_second() -> None:
    pair = Pair().connect()
    wrong = CODEC.frame(setpoint(0), 1, 0x7777)
    for _ in range(200):
        pair.board.take(wrong)
    pair.run(1)
    assert len(pair.told(e.ErrorReceived)) == 10
    assert pair.board.session.stats.dropped_errors == 190
    pair.run(100)
    pair.board.take(wrong)
    pair.run(1)
    assert len(pair.told(e.ErrorReceived)) == 11


def test_a_board_and_a_host_that_share_a_nonce_still_open_a_new_session_after_a_reboot() -> None:
    pair = Pair().connect()
    first = pair.host.session
    pair.board = TestBoard(ident=msgspec.structs.replace(IDENT, boot_count=8))
    pair.run(60)
    assert pair.host.state is HostState.MONITOR
    assert pair.host.session != first
