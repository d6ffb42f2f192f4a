"""A board at the other end of a session: greeted, asked, refused, flooded, restarted."""

import itertools
import random
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from firmware_protocol import messages as wire
from firmware_protocol.codec import CODEC
from firmware_protocol.enums import BoardState, ErrorCode, Fault, ResetCause, ValidBit
from firmware_protocol.events import Connected, HostEvent, HostState, RequestDone
from firmware_protocol.framing import FrameDecoder
from firmware_protocol.generate.vectors import random_message
from firmware_protocol.parameters import PARAMETERS
from firmware_protocol.schema import decompress, describe, own_crc
from firmware_protocol.wire import Direction
from sim_device.bench import SimulatedBench
from sim_device.board import CAPABILITIES
from sim_device.faults import injection
from sim_device.firmware import store
from sim_device.firmware.bench import ChipBench, firmware_bench
from sim_device.firmware.build import SOURCES
from tests.firmware.conftest import Make, MakeFirmware, needs
from tests.sim_device.loop import Loop, hold

LIMIT = 20
"""Number of the parameter current_limit_mA."""


def identity(loop: Loop) -> wire.Ident:
    event = loop.of(Connected)[-1]
    assert isinstance(event, Connected)
    return event.ident


def restarted(loop: Loop) -> Loop:
    """Cycle the power and step until the host has a session with the board again."""
    sessions = len(loop.of(Connected))
    loop.bench.reboot(ResetCause.POWER_ON)
    loop.until(lambda: len(loop.of(Connected)) > sessions and loop.mode is not BoardState.BOOT)
    loop.step(10)
    return loop


def error_of(answer: wire.Message | None) -> ErrorCode:
    assert isinstance(answer, wire.Error), answer
    return answer.code


def numbers_sent(loop: Loop, monkeypatch: pytest.MonkeyPatch) -> set[int]:
    """Return the numbers of the messages that the board sends from now on, as they come."""
    decoder, receive = FrameDecoder(), loop.host.receive
    numbers: set[int] = set()

    def listen(data: bytes, now_us: int) -> list[HostEvent]:
        numbers.update(frame.type for frame in decoder.feed(data))
        return receive(data, now_us)

    monkeypatch.setattr(loop.host, "receive", listen)
    return numbers


def test_it_says_who_it_is_and_streams_at_its_rate(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop = Loop(make()).connected()
    sent = numbers_sent(loop, monkeypatch)
    ident = identity(loop)
    assert (ident.major, ident.schema_crc) == (wire.PROTOCOL_MAJOR, own_crc())
    assert (ident.boot_count, ident.reset_cause) == (1, ResetCause.POWER_ON)
    assert ident.firmware.startswith("smad-")
    assert ident.capabilities == CAPABILITIES["antagonistic"]
    begin = len(loop.states)
    loop.step(200)
    times = [state.t_us for state in loop.states[begin:]]
    assert {b - a for a, b in itertools.pairwise(times)} == {10_000}
    for message in wire.MESSAGES:
        if message.info.per_s and message.info.direction is Direction.TO_HOST:
            assert message.info.number in sent, f"this board never sends {message.__name__}"
    assert loop.host.stats.missed_states == 0


def test_no_session_has_the_number_of_the_one_before_however_many_there_are() -> None:
    needs("host")
    bench = firmware_bench("host")
    board = Loop(bench).connected().bench.board

    def greet(nonces: range) -> list[int]:
        frames = (
            CODEC.frame(wire.Hello(wire.PROTOCOL_MAJOR, 0, own_crc(), nonce), 0, 0)
            for nonce in nonces
        )
        board.receive(b"".join(frames), bench.now_us)
        answers = FrameDecoder().feed(bytes(board.data_to_send()))
        return [frame.session for frame in answers if frame.type == wire.Ident.info.number]

    greet(range(65_530))
    numbers = greet(range(65_530, 65_540))
    assert len(numbers) == 10
    assert all(a != b for a, b in itertools.pairwise(numbers))
    bench.close()


def test_it_describes_itself_as_the_tables_do(make: Make) -> None:
    loop = Loop(make()).connected()
    blob = b""
    total = 1
    while len(blob) < total:
        piece = loop.request(wire.Describe(len(blob)))
        assert isinstance(piece, wire.Description)
        blob += piece.data[: piece.size]
        total = piece.total
    assert decompress(blob) == describe()


@pytest.mark.parametrize("rate_hz", [250, 500])
def test_it_keeps_a_faster_rate_or_says_that_it_has_not_the_time(make: Make, rate_hz: int) -> None:
    loop = Loop(make(rate_hz=rate_hz)).connected()
    if isinstance(loop.bench, ChipBench):
        assert identity(loop).state_rate_hz == 100
        refused = loop.request(wire.ParamSet(0, 1, rate_hz))
        assert isinstance(refused, wire.Error)
        assert (refused.code, refused.limit) == (ErrorCode.RATE_TOO_HIGH, 100)
        return
    begin = len(loop.states)
    loop.step(300)
    times = [state.t_us for state in loop.states[begin:]]
    assert {b - a for a, b in itertools.pairwise(times)} == {1_000_000 // rate_hz}


def test_arming_takes_the_right_token_once_and_the_parameters_as_they_are(make: Make) -> None:
    loop = Loop(make()).connected()
    crc = identity(loop).param_crc
    assert error_of(loop.request(wire.ArmRequest(0, crc ^ 1))) is ErrorCode.PARAMETERS_DIFFER
    assert error_of(loop.request(wire.ArmRequest(1, crc))) is ErrorCode.NO_SUCH_AXIS
    token = loop.request(wire.ArmRequest(0, crc))
    assert isinstance(token, wire.ArmToken)
    wrong = wire.ArmConfirm(0, token.token ^ 1)
    assert error_of(loop.request(wrong)) is ErrorCode.TOKEN_WRONG
    assert error_of(loop.request(wire.ArmConfirm(0, token.token))) is ErrorCode.TOKEN_WRONG
    token = loop.request(wire.ArmRequest(0, crc))
    assert isinstance(token, wire.ArmToken)
    loop.step(token.valid_ms // 10 + 5)
    assert error_of(loop.request(wire.ArmConfirm(0, token.token))) is ErrorCode.TOKEN_EXPIRED
    loop.armed()
    assert error_of(loop.request(wire.ArmRequest(0, crc))) is ErrorCode.WRONG_STATE
    loop.request(wire.Disarm(0))
    loop.until(lambda: loop.mode is BoardState.SAFE)


def test_arming_is_refused_when_parameters_or_clock_changed_since_it_was_asked_for(
    make: Make,
) -> None:
    loop = Loop(make()).connected()
    crc = identity(loop).param_crc
    token = loop.request(wire.ArmRequest(0, crc))
    assert isinstance(token, wire.ArmToken)
    loop.request(wire.ParamSet(0, LIMIT, 900))
    confirm = wire.ArmConfirm(0, token.token)
    assert error_of(loop.request(confirm)) is ErrorCode.PARAMETERS_DIFFER
    loop.request(wire.ParamSet(0, LIMIT, 4000))
    again = loop.request(wire.ArmRequest(0, crc))
    assert isinstance(again, wire.ArmToken)
    assert again.token != token.token
    before = len(loop.states)
    loop.bench.hang(0.03)
    loop.until(lambda: len(loop.states) > before and loop.states[-1].warnings >> 5 & 1, 20)
    late = loop.request(wire.ArmConfirm(0, again.token))
    assert error_of(late) is ErrorCode.CLOCK_UNLOCKED


@pytest.mark.parametrize("port", ["python", "host"])
def test_setpoint_and_disarm_count_at_once_and_the_drains_close_with_the_gate(port: str) -> None:
    needs("host")
    bench = SimulatedBench() if port == "python" else firmware_bench("host")
    loop = Loop(bench).armed()
    board = bench.board
    loop.step(2)
    loop.host.send_setpoint(wire.Setpoint(0, loop.states[-1].t_us, (900, 0), (0, 0), 3, 100))
    bench.receive(loop.host.data_to_send())
    assert (board.outputs.applied_mA[0], board.drain) == (900, (True, True))
    loop.host.request(wire.Disarm(0), bench.now_us)
    bench.receive(loop.host.data_to_send())
    assert board.outputs.gate == 0
    loop.step()
    assert board.drain == (False, False)
    bench.close()


@pytest.mark.parametrize("port", ["python", "host"])
def test_the_32_bits_of_the_clock_may_wrap_while_it_heats(port: str) -> None:
    needs("host")
    options = {"clock_start_us": (1 << 32) - 2_000_000}
    bench = SimulatedBench(**options) if port == "python" else firmware_bench("host", **options)
    loop = Loop(bench).armed()
    loop.answer = hold(1000)
    loop.step(400)
    assert loop.states[0].t_us > loop.states[-1].t_us
    assert {state.mode for state in loop.states[-300:]} == {BoardState.ARMED}
    assert loop.states[-1].i_applied_mA == (1000, 0)
    loop.answer = lambda state: None
    loop.until(lambda: loop.mode is BoardState.FAULT, 80)
    bench.close()


def test_a_tightened_age_refuses_setpoints_that_the_gate_of_the_session_lets_pass(
    make: Make,
) -> None:
    loop = Loop(make()).connected()
    number = next(row.number for row in PARAMETERS if row.name == "setpoint_age_us")
    loop.request(wire.ParamSet(0, number, 20_000))
    loop.request(wire.ParamSave())
    loop.armed()
    loop.step(2)
    fresh = hold(500)
    loop.answer = lambda state: fresh(loop.states[-4])
    loop.step(8)
    assert loop.states[-1].i_applied_mA == (0, 0)


def test_nothing_but_a_sample_resets_the_watchdog() -> None:
    core = "".join(path.read_text() for path in sorted((SOURCES / "core").glob("*.c")))
    assert core.count("hal_watchdog_kick();") == 1
    sample = core[core.index("static void take_sample(") : core.index("/* Commands of the host */")]
    assert "hal_watchdog_kick();" in sample


def test_every_request_of_the_table_is_carried_out_and_its_axis_is_looked_at(make: Make) -> None:
    loop = Loop(make()).connected()
    rng = random.Random(1)
    for kind in (kind for kind in wire.MESSAGES if kind.info.pace == "request"):
        request = random_message(kind, rng)
        if hasattr(request, "axis"):
            other = loop.request(msgspec.structs.replace(request, axis=99))
            assert error_of(other) is ErrorCode.NO_SUCH_AXIS, kind
            request = msgspec.structs.replace(request, axis=0)
        answer = loop.request(request)
        assert answer is not None, kind
        if isinstance(answer, wire.Error):
            assert answer.code not in (ErrorCode.UNKNOWN_TYPE, ErrorCode.NO_SUCH_AXIS), kind
        else:
            assert type(answer).__name__ in kind.info.replies, kind


def test_current_follows_the_setpoint_and_ends_with_the_host(make: Make) -> None:
    loop = Loop(make()).armed()
    loop.answer = hold(1500, 700, (0, 90))
    loop.step(30)
    board = loop.bench.board
    assert (board.outputs.gate, list(board.outputs.applied_mA)) == (1, [1500, 700])
    assert list(board.outputs.duty) == [0, 90]
    assert loop.states[-1].i_meas_mA == pytest.approx((1500, 700), abs=20)
    loop.answer = lambda state: None
    loop.until(lambda: loop.mode is BoardState.HOLD, 30)
    assert list(board.outputs.applied_mA) == [0, 0]
    loop.until(lambda: loop.mode is BoardState.FAULT, 70)
    assert board.outputs.gate == 0
    assert [report.fault for report in loop.reports] == [Fault.SETPOINT_LOST]


def test_estop_ends_everything_until_the_power_is_cycled(make: Make) -> None:
    loop = Loop(make()).armed()
    loop.answer = hold(2000)
    loop.step(20)
    loop.host.send_estop()
    loop.until(lambda: loop.mode is BoardState.ESTOP, 10)
    assert loop.bench.board.outputs.gate == 0
    crc = identity(loop).param_crc
    assert error_of(loop.request(wire.ArmRequest(0, crc))) is ErrorCode.WRONG_STATE
    restarted(loop)
    assert loop.mode is BoardState.SAFE
    assert identity(loop).boot_count == 2


@pytest.mark.parametrize("cause", [ResetCause.WATCHDOG, ResetCause.PIN])
def test_estop_outlives_a_reset_of_the_chip_and_not_a_power_cycle(
    make: Make, cause: ResetCause
) -> None:
    loop = Loop(make()).armed()
    loop.host.send_estop()
    loop.until(lambda: loop.mode is BoardState.ESTOP, 10)
    if cause is ResetCause.WATCHDOG:
        loop.bench.hang(0.3)
    else:
        # As opening the port does.
        loop.bench.reboot(cause)
    begin = len(loop.states)
    loop.until(lambda: loop.restarts and len(loop.of(Connected)) == 2, 200)
    loop.step(10)
    assert {state.mode for state in loop.states[begin:]} == {BoardState.ESTOP}
    assert identity(loop).reset_cause is cause
    assert loop.reports[-1].fault is Fault.ESTOP_PRESSED
    restarted(loop)
    assert loop.mode is BoardState.SAFE
    assert identity(loop).reset_cause is ResetCause.POWER_ON


@pytest.mark.parametrize("cause", [ResetCause.WATCHDOG, ResetCause.PIN])
def test_a_fault_outlives_a_reset_of_the_chip_until_it_is_cleared(
    make: Make, cause: ResetCause
) -> None:
    loop = Loop(make()).armed()
    loop.answer = lambda state: None
    loop.until(lambda: loop.mode is BoardState.FAULT, 100)
    loop.step(5)
    (before,) = loop.reports
    if cause is ResetCause.WATCHDOG:
        loop.bench.hang(0.3)
    else:
        image = bytearray(loop.bench.board.image or loop.bench.board.parameters.image())
        image[9] ^= 1
        loop.bench.board.image = bytes(image)
        loop.bench.reboot(cause)
    begin = len(loop.states)
    loop.until(lambda: loop.restarts and len(loop.of(Connected)) == 2, 200)
    loop.step(10)
    assert {s.mode for s in loop.states[begin:]} <= {BoardState.BOOT, BoardState.FAULT}
    first = loop.request(wire.FaultGet(0, 0))
    assert isinstance(first, wire.FaultReport)
    assert first.fault is Fault.SETPOINT_LOST
    assert (first.channel, first.measured) == (before.channel, before.measured)
    assert first.limit == before.limit
    refused = loop.request(wire.ArmRequest(0, identity(loop).param_crc))
    assert error_of(refused) is ErrorCode.FAULT_PRESENT
    clear = wire.ClearFault(0, Fault.SETPOINT_LOST)
    if cause is ResetCause.PIN:
        # Damaged parameters, found while the older fault is the first, can be mended.
        assert error_of(loop.request(clear)) is ErrorCode.CAUSE_REMAINS
        assert isinstance(loop.request(wire.ParamSet(0, LIMIT, 900)), wire.ParamValue)
        assert isinstance(loop.request(wire.ParamSave()), wire.Done)
        loop.step(2)
    assert isinstance(loop.request(clear), wire.Done)
    loop.bench.reboot(ResetCause.PIN)
    loop.until(lambda: len(loop.of(Connected)) == 3 and loop.mode is not BoardState.BOOT)
    assert loop.mode is BoardState.SAFE


def test_a_fault_stays_the_first_one_when_an_estop_and_resets_follow(make: Make) -> None:
    loop = Loop(make()).armed()
    loop.answer = lambda state: None
    loop.until(lambda: loop.mode is BoardState.FAULT, 100)
    loop.bench.reboot(ResetCause.PIN)
    loop.until(lambda: len(loop.of(Connected)) == 2 and loop.mode is BoardState.FAULT)
    loop.host.send_estop()
    loop.until(lambda: loop.mode is BoardState.ESTOP, 10)
    loop.bench.reboot(ResetCause.PIN)
    begin = len(loop.states)
    loop.until(lambda: len(loop.of(Connected)) == 3)
    loop.step(10)
    assert {state.mode for state in loop.states[begin:]} == {BoardState.ESTOP}
    first = loop.request(wire.FaultGet(0, 0))
    assert isinstance(first, wire.FaultReport)
    assert first.fault is Fault.SETPOINT_LOST
    restarted(loop)
    assert loop.mode is BoardState.SAFE


def test_parameters_are_set_within_their_range_and_only_where_it_is_safe(make: Make) -> None:
    loop = Loop(make()).connected()
    for row in PARAMETERS:
        value = loop.request(wire.ParamGet(0, row.number))
        assert isinstance(value, wire.ParamValue)
        assert (value.value, value.minimum, value.maximum) == (
            row.default,
            row.minimum,
            row.maximum,
        )
    too_much = loop.request(wire.ParamSet(0, LIMIT, 4001))
    assert error_of(too_much) is ErrorCode.OUT_OF_RANGE
    assert isinstance(too_much, wire.Error)
    assert too_much.limit == 4000
    assert error_of(loop.request(wire.ParamGet(0, 9))) is ErrorCode.UNKNOWN_PARAMETER
    for row in (row for row in PARAMETERS if row.never_zero):
        assert error_of(loop.request(wire.ParamSet(0, row.number, 0))) is ErrorCode.OUT_OF_RANGE
    changed = loop.request(wire.ParamSet(0, LIMIT, 900))
    assert isinstance(changed, wire.ParamValue)
    loop.request(wire.ParamSave())
    loop.armed()
    assert error_of(loop.request(wire.ParamSet(0, LIMIT, 800))) is ErrorCode.WRONG_STATE
    loop.answer = hold(2000)
    loop.step(30)
    assert loop.bench.board.outputs.applied_mA[0] == 900


def test_saved_parameters_survive_a_power_cycle_and_others_do_not(make: Make) -> None:
    loop = Loop(make()).connected()
    loop.request(wire.ParamSet(0, LIMIT, 900))
    assert isinstance(loop.request(wire.ParamSave()), wire.Done)
    loop.request(wire.ParamSet(0, LIMIT, 800))
    restarted(loop)
    value = loop.request(wire.ParamGet(0, LIMIT))
    assert isinstance(value, wire.ParamValue)
    assert value.value == 900
    loop.answer = hold(2000)
    loop.armed().step(30)
    assert loop.bench.board.outputs.applied_mA[0] == 900


def test_a_save_of_every_parameter_is_waited_for(make_firmware: MakeFirmware) -> None:
    loop = Loop(make_firmware()).connected()
    for row in (row for row in PARAMETERS if not row.choices):
        other = row.minimum if row.minimum != row.default else row.maximum
        assert isinstance(loop.request(wire.ParamSet(0, row.number, other)), wire.ParamValue)
    assert isinstance(loop.request(wire.ParamSave()), wire.Done)


def test_a_save_that_meets_the_save_of_an_earlier_session_is_carried_out_after_it(
    make: Make,
) -> None:
    loop = Loop(make()).connected()
    loop.request(wire.ParamSet(0, LIMIT, 900))
    loop.host.request(wire.ParamSave(), loop.bench.now_us)
    loop.bench.receive(loop.host.data_to_send())
    loop.host.lost(loop.bench.now_us)
    loop.bench.data_to_send()
    loop.host.connect(loop.bench.now_us)
    sessions = len(loop.of(Connected))
    loop.until(lambda: len(loop.of(Connected)) > sessions, 10)
    loop.request(wire.ParamSet(0, LIMIT, 800))
    assert isinstance(loop.request(wire.ParamSave()), wire.Done)
    restarted(loop)
    value = loop.request(wire.ParamGet(0, LIMIT))
    assert isinstance(value, wire.ParamValue)
    assert value.value == 800


def test_a_disarm_does_not_wait_for_a_save_and_the_save_is_answered_after_it(
    make_firmware: MakeFirmware,
) -> None:
    loop = Loop(make_firmware()).connected()
    loop.request(wire.ParamSet(0, LIMIT, 900))
    save = loop.host.request(wire.ParamSave(), loop.bench.now_us)
    loop.bench.receive(loop.host.data_to_send())
    disarm = loop.host.request(wire.Disarm(0), loop.bench.now_us)
    done: list[int] = []

    def both() -> bool:
        done[:] = [event.id for event in loop.of(RequestDone)]
        return {save, disarm} <= set(done)

    loop.until(both)
    assert done.index(disarm) < done.index(save)
    restarted(loop)
    value = loop.request(wire.ParamGet(0, LIMIT))
    assert isinstance(value, wire.ParamValue)
    assert value.value == 900


@pytest.mark.parametrize("after_ms", range(0, 60, 7))
def test_a_power_cut_in_the_middle_of_a_write_leaves_the_old_or_the_new(
    make_firmware: MakeFirmware, after_ms: int
) -> None:
    loop = Loop(make_firmware()).connected()
    loop.request(wire.ParamSet(0, LIMIT, 900))
    loop.request(wire.ParamSave())
    loop.request(wire.ParamSet(0, LIMIT, 700))
    loop.host.request(wire.ParamSave(), loop.bench.now_us)
    loop.bench.receive(loop.host.data_to_send())
    board = loop.bench.board
    for _ in range(after_ms):
        board.step(1000)
    restarted(loop)
    assert loop.mode is BoardState.SAFE
    value = loop.request(wire.ParamGet(0, LIMIT))
    assert isinstance(value, wire.ParamValue)
    assert value.value in (900, 700)


def test_a_damaged_mark_does_not_loosen_what_was_saved(
    make_firmware: MakeFirmware, tmp_path: Path
) -> None:
    path = tmp_path / "store"
    loop = Loop(make_firmware(store_path=path)).connected()
    loop.request(wire.ParamSet(0, LIMIT, 900))
    loop.request(wire.ParamSave())
    content = bytearray(path.read_bytes())
    content[store.SLOTS[0]] ^= 0x10
    path.write_bytes(content)
    restarted(loop)
    value = loop.request(wire.ParamGet(0, LIMIT))
    assert isinstance(value, wire.ParamValue)
    assert value.value == 900


def test_a_damaged_store_stops_the_board_until_it_is_mended(make: Make) -> None:
    loop = Loop(make(faults=[injection("corrupt_parameters", 0.5)])).connected()
    loop.step(60)
    loop.until(lambda: loop.mode is BoardState.FAULT)
    assert loop.reports[-1].fault is Fault.PARAM_CRC
    assert isinstance(loop.request(wire.ParamSave()), wire.Done)
    loop.step(2)
    assert isinstance(loop.request(wire.ClearFault(0, Fault.PARAM_CRC)), wire.Done)
    loop.until(lambda: loop.mode is BoardState.SAFE, 20)
    assert restarted(loop).mode is BoardState.SAFE


def test_garbage_and_floods_cost_nothing_but_time(make: Make) -> None:
    rng = random.Random(4)
    loop = Loop(make()).connected()
    for _ in range(20):
        loop.bench.receive(rng.randbytes(500))
        loop.step(3)
    loop.step(100)
    assert loop.restarts == 0
    assert loop.stats[-1].frames > 0
    assert loop.stats[-1].length_errors + loop.stats[-1].cobs_errors > 10
    assert isinstance(loop.request(wire.Disarm(0)), wire.Done)
    assert loop.host.stats.missed_states <= 20


def test_a_line_full_of_noise_without_a_delimiter_costs_the_chip_no_sample() -> None:
    needs("avr")
    bench = firmware_bench("avr")
    loop = Loop(bench).connected()
    before = len(loop.states)
    bench.receive(b"\x55" * 20_000)
    loop.step(50)
    assert bench.board.resets == 0
    times = [state.t_us for state in loop.states[before:]]
    assert {b - a for a, b in itertools.pairwise(times)} == {10_000}
    bench.close()


def test_a_bridge_that_is_unplugged_gives_no_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    needs("avr")
    bench = firmware_bench("avr")
    loop = Loop(bench).connected()
    assert loop.states[-1].valid & ValidBit.FORCE
    seen = bench.board.seen
    unplugged = {"bridge": 2**31 - 1}
    monkeypatch.setattr(bench.board, "seen", lambda *shown: replace(seen(*shown), **unplugged))
    loop.step(60)
    assert not loop.states[-1].valid & ValidBit.FORCE
    bench.close()


def test_a_loop_that_hangs_is_ended_by_the_watchdog_with_the_gate_off(
    make_firmware: MakeFirmware,
) -> None:
    loop = Loop(make_firmware()).armed()
    loop.answer = hold(2000)
    loop.step(20)
    loop.bench.hang(0.3)
    loop.until(lambda: loop.restarts, 200)
    assert loop.bench.board.resets == 1
    assert loop.bench.board.outputs.gate == 0
    loop.until(lambda: loop.mode is BoardState.SAFE)
    assert identity(loop).reset_cause is ResetCause.WATCHDOG
    assert loop.host.state is not HostState.RUNNING


def test_ticks_stay_where_they_were_when_interrupts_were_held_off_for_longer_than_one() -> None:
    needs("avr")
    bench = firmware_bench("avr")
    loop = Loop(bench).connected()
    before_us = bench.board.clock_us - bench.board.now_us
    bench.board.deaf = True
    bench.hang(0.035)
    loop.step(10)
    assert bench.board.resets == 0
    assert bench.board.clock_us - bench.board.now_us == pytest.approx(before_us, abs=1500)
    times = [state.t_us for state in loop.states]
    assert max(b - a for a, b in itertools.pairwise(times)) in (30_000, 40_000)
    bench.close()


@pytest.mark.parametrize("seconds", [0.07, 0.105])
def test_a_short_hang_is_a_fault_and_no_restart(make: Make, seconds: float) -> None:
    loop = Loop(make()).armed()
    loop.answer = hold(2000)
    loop.step(20)
    loop.bench.hang(seconds)
    loop.until(lambda: loop.mode is BoardState.FAULT, 60)
    assert loop.reports[-1].fault is Fault.LOOP_OVERRUN
    assert loop.restarts == 0


def test_the_same_seed_gives_the_same_bytes(make: Make) -> None:
    streams = []
    for _ in range(2):
        loop = Loop(make(seed=8)).armed()
        loop.answer = hold(2500, 0, (0, 120))
        loop.step(100)
        streams.append([(s.t_us, s.rtd_cC, s.i_meas_mA, s.encoder_counts) for s in loop.states])
    assert streams[0] == streams[1]


def test_a_store_of_its_own_keeps_the_count_of_starts(
    make_firmware: MakeFirmware, tmp_path: Path
) -> None:
    counts = []
    for _ in range(3):
        bench = make_firmware(store_path=tmp_path / "store")
        counts.append(identity(Loop(bench).connected()).boot_count)
        bench.close()
    assert counts == [1, 2, 3]


def test_a_board_with_a_store_of_its_own_leaves_no_folder_when_it_is_killed(
    make_firmware: MakeFirmware, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    make_firmware(store_path=tmp_path / "store")
    assert not list(temporary.iterdir())
