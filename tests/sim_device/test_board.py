"""The simulated board as a host meets it: over bytes, on virtual time."""

import itertools
import shutil
from collections.abc import Mapping
from typing import Any, ClassVar

import msgspec
import pytest

from firmware_protocol import messages as wire
from firmware_protocol.enums import (
    BoardState,
    Capability,
    Channel,
    ErrorCode,
    Fault,
    ResetCause,
    SetpointFlag,
    ValidBit,
)
from firmware_protocol.events import Connected, HostState
from firmware_protocol.parameters import BY_NAME
from firmware_protocol.supervisor import Measurements, Memory, Supervisor
from firmware_protocol.supervisor.compiled import CompiledSupervisor
from sim_device.bench import SimulatedBench
from sim_device.board import CAPABILITIES, Board
from sim_device.faults import injection
from sim_device.hardware import Hardware
from sim_device.plant import Readings
from sim_device.plant.errors import InputError

from .loop import Loop, hold


def number(name: str) -> int:
    return BY_NAME[name].number


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_a_board_runs_the_compiled_supervisor_of_the_present_text() -> None:
    assert isinstance(Board().supervisor, CompiledSupervisor), "run make setup"


@pytest.mark.parametrize(
    ("fault", "values"),
    [
        ("wire_cut", {"channel": 0.0}),
        ("driver_gain", {"gain": 20.0}),
        ("supply_sag", {"volts": 3e6}),
        ("sensor_detached", {"value": -0.05}),
    ],
)
def test_a_board_in_python_plays_the_same_bytes_through_a_fault(
    monkeypatch: pytest.MonkeyPatch, fault: str, values: dict[str, float]
) -> None:
    played = []
    for own in (None, Supervisor):
        if own is not None:
            monkeypatch.setattr("sim_device.board.fastest_supervisor", own)
        bench = SimulatedBench(seed=5, faults=[injection(fault, 3.0, **values)])
        loop = Loop(bench).armed()
        loop.answer = hold(1500)
        # A lag below 0 s takes 40 s to carry the reading beyond any number.
        loop.step(5000 if fault == "sensor_detached" else 600)
        played.append(loop.states)
    assert played[0] == played[1]
    assert BoardState.ARMED in {state.mode for state in played[0]}


@pytest.mark.parametrize(
    "beyond",
    [{"i_mA": (65_541, 0)}, {"i_mA": (0, -5)}, {"pump_duty": (300, 0)}, {"ttl_ms": 4_294_968}],
)
def test_a_typed_setpoint_that_the_wire_cannot_carry_is_refused(beyond: dict[str, Any]) -> None:
    bench = SimulatedBench()
    bench.arm()
    good = wire.Setpoint(0, bench.board.now_us, (500, 0), (0, 0), 0, 100)
    bench.step_typed(good)
    with pytest.raises(InputError, match="no setpoint"):
        bench.step_typed(msgspec.structs.replace(good, **beyond))


def test_the_board_tells_who_it_is_and_what_it_has() -> None:
    loop = Loop(SimulatedBench(seed=5)).connected()
    (connected,) = loop.of(Connected)
    ident = connected.ident  # type: ignore[attr-defined]
    assert ident.firmware == "smad-sim 1.0"
    assert ident.reset_cause is ResetCause.POWER_ON
    assert ident.boot_count == 1
    assert ident.state_rate_hz == 100
    assert ident.capabilities & Capability.ENCODER
    assert not ident.capabilities & Capability.STAGE


def test_only_fixtures_with_a_stage_have_one() -> None:
    for fixture, has in (("antagonistic", False), ("stretch", True), ("blocked", True)):
        loop = Loop(SimulatedBench(fixture=fixture)).connected()
        assert loop.host.board is not None
        assert bool(loop.host.board.capabilities & Capability.STAGE) == has


def test_two_benches_have_different_uids_and_one_bench_keeps_its_own() -> None:
    uids = [SimulatedBench(seed=seed).board.session._ident.uid for seed in (1, 1, 2)]
    assert uids[0] == uids[1] != uids[2]


@pytest.mark.parametrize("rate_hz", [100, 250, 500])
def test_samples_come_at_the_rate_by_the_boards_clock(rate_hz: int) -> None:
    loop = Loop(SimulatedBench(rate_hz=rate_hz)).connected()
    loop.step(50)
    times = [state.t_us for state in loop.states[-50:]]
    ticks = [state.tick for state in loop.states[-50:]]
    assert {b - a for a, b in itertools.pairwise(times)} == {1_000_000 // rate_hz}
    assert {b - a for a, b in itertools.pairwise(ticks)} == {1}


def test_the_board_measures_in_safe_and_everything_is_off() -> None:
    loop = Loop(SimulatedBench()).connected()
    state = loop.states[-1]
    assert state.i_applied_mA == (0, 0)
    assert state.pump_duty == (0, 0)
    assert all(abs(t - 2685) < 20 for t in state.rtd_cC)
    assert state.vbus_mV == 12_000
    assert abs(state.force_counts - 1240) < 15
    assert state.valid & ValidBit.RTD_X
    assert not state.valid & ValidBit.SETPOINT


def test_an_armed_board_applies_and_acknowledges_setpoints() -> None:
    loop = Loop(SimulatedBench()).armed()
    loop.answer = hold(1500, 0, (0, 128))
    loop.step(5)
    state = loop.states[-1]
    assert loop.host.state is HostState.RUNNING
    assert state.mode is BoardState.ARMED
    assert state.i_applied_mA == (1500, 0)
    assert abs(state.i_meas_mA[0] - 1500) < 20
    assert abs(state.v_mV[0] - 1135) < 30
    assert state.pump_duty == (0, 128)
    assert state.sp_age_us == 0
    assert state.valid & ValidBit.SETPOINT
    before = state.sp_seq
    loop.step(3)
    assert loop.states[-1].sp_seq == (before + 3) & 0xFF


def test_a_board_without_setpoints_holds_then_faults_and_reports_three_times() -> None:
    loop = Loop(SimulatedBench()).armed()
    loop.answer = hold(2000)
    loop.step(20)
    loop.answer = lambda state: None
    loop.until(lambda: loop.mode is BoardState.HOLD, 20)
    loop.until(lambda: loop.mode is BoardState.FAULT, 60)
    loop.step(5)
    (report,) = loop.reports
    assert report.fault is Fault.SETPOINT_LOST
    assert report.channel is Channel.BOARD
    assert report.measured > report.limit
    assert report.snapshot.mode is BoardState.FAULT
    assert loop.host.state is HostState.FAULTED
    again = loop.request(wire.FaultGet(0, 0))
    assert again == report


def test_a_fault_is_cleared_by_name_and_arming_takes_a_person_again() -> None:
    loop = Loop(SimulatedBench()).armed()
    loop.answer = lambda state: None
    loop.until(lambda: loop.mode is BoardState.FAULT, 100)
    refusal = loop.request(wire.ClearFault(0, Fault.LEAK))
    assert isinstance(refusal, wire.Error)
    assert refusal.code is ErrorCode.WRONG_FAULT
    assert isinstance(loop.request(wire.ClearFault(0, Fault.SETPOINT_LOST)), wire.Done)
    loop.answer = hold(4000)
    loop.step(50)
    assert loop.mode is BoardState.SAFE
    assert loop.states[-1].i_applied_mA == (0, 0)


def test_a_refused_arming_names_the_channel_the_value_and_the_limit() -> None:
    bench = SimulatedBench(faults=[injection("sensor_open", 0.2, channel=1)])
    loop = Loop(bench).connected()
    loop.step(30)
    error = loop.request(wire.ArmRequest(0, bench.board.parameters.crc))
    assert isinstance(error, wire.Error)
    assert error.code is ErrorCode.SENSOR_INVALID
    assert error.field == Channel.SPRING_Y
    assert (error.value, error.limit) == (32767, 20000)
    assert not loop.states[-1].valid & ValidBit.RTD_Y


def test_disarming_cools_and_ends_in_safe() -> None:
    loop = Loop(SimulatedBench()).armed()
    loop.answer = hold(4000)
    loop.until(lambda: loop.states[-1].rtd_cC[0] > 5000)
    loop.answer = lambda state: None
    assert isinstance(loop.request(wire.Disarm(0)), wire.Done)
    loop.step(2)
    assert loop.mode is BoardState.COOL
    assert loop.states[-1].pump_duty == (255, 255)
    assert loop.states[-1].i_applied_mA == (0, 0)
    loop.until(lambda: loop.mode is BoardState.SAFE)
    assert loop.states[-1].rtd_cC[0] < 4500


def test_estop_needs_a_power_cycle() -> None:
    loop = Loop(SimulatedBench()).armed()
    loop.answer = hold(3000)
    loop.step(5)
    loop.host.send_estop()
    loop.step(3)
    assert loop.mode is BoardState.ESTOP
    assert loop.states[-1].i_applied_mA == (0, 0)
    assert loop.reports[0].fault is Fault.ESTOP_PRESSED
    loop.bench.reboot(ResetCause.POWER_ON)
    loop.until(lambda: loop.mode is BoardState.SAFE)
    assert loop.restarts == 1


def test_a_new_session_disarms_what_the_old_one_armed() -> None:
    loop = Loop(SimulatedBench()).armed()
    loop.answer = hold(3000)
    loop.until(lambda: loop.states[-1].rtd_cC[0] > 4700)
    other = Loop(loop.bench, nonce=12)
    other.until(lambda: other.of(Connected))
    other.step(3)
    assert other.mode in (BoardState.COOL, BoardState.SAFE)
    assert other.host.state is HostState.MONITOR


def test_limits_are_tightened_by_parameters_in_safe_and_take_effect() -> None:
    loop = Loop(SimulatedBench()).connected()
    value = loop.request(wire.ParamSet(0, number("current_limit_mA"), 1000))
    assert isinstance(value, wire.ParamValue)
    too_much = loop.request(wire.ParamSet(0, number("current_limit_mA"), 4001))
    assert isinstance(too_much, wire.Error)
    assert too_much.code is ErrorCode.OUT_OF_RANGE
    assert too_much.limit == 4000
    loop.armed()
    loop.answer = hold(4000)
    loop.step(5)
    assert loop.states[-1].i_applied_mA == (1000, 0)


def test_parameters_are_refused_while_armed() -> None:
    loop = Loop(SimulatedBench()).armed()
    error = loop.request(wire.ParamSet(0, number("current_limit_mA"), 1000))
    assert isinstance(error, wire.Error)
    assert error.code is ErrorCode.WRONG_STATE


def test_parameters_that_change_between_the_two_steps_of_arming_stop_it() -> None:
    loop = Loop(SimulatedBench()).connected()
    token = loop.request(wire.ArmRequest(0, loop.bench.board.parameters.crc))
    assert isinstance(token, wire.ArmToken)
    loop.request(wire.ParamSet(0, number("current_limit_mA"), 1000))
    error = loop.request(wire.ArmConfirm(0, token.token))
    assert isinstance(error, wire.Error)
    assert error.code is ErrorCode.PARAMETERS_DIFFER


def test_saved_parameters_survive_a_reboot_and_others_do_not() -> None:
    for save, expected in ((True, 1000), (False, 4000)):
        loop = Loop(SimulatedBench()).connected()
        loop.request(wire.ParamSet(0, number("current_limit_mA"), 1000))
        if save:
            assert isinstance(loop.request(wire.ParamSave()), wire.Done)
        loop.bench.reboot(ResetCause.POWER_ON)
        assert loop.bench.board.supervisor.limits.current_limit_mA == expected


def test_damaged_parameters_fall_back_to_the_compiled_ones_and_are_a_fault() -> None:
    loop = Loop(SimulatedBench()).connected()
    loop.request(wire.ParamSet(0, number("current_limit_mA"), 1000))
    loop.request(wire.ParamSave())
    image = bytearray(loop.bench.board.image or b"")
    image[9] ^= 1
    bench = SimulatedBench(image=bytes(image))
    loop = Loop(bench)
    loop.until(lambda: loop.mode is BoardState.FAULT)
    loop.until(lambda: loop.reports or loop.host.state is HostState.FAULTED)
    assert bench.board.supervisor.limits.current_limit_mA == 4000
    assert bench.board.supervisor.first_fault is not None
    assert bench.board.supervisor.first_fault.fault is Fault.PARAM_CRC
    refused = loop.request(wire.ClearFault(0, Fault.PARAM_CRC))
    assert isinstance(refused, wire.Error)
    assert refused.code is ErrorCode.CAUSE_REMAINS
    loop.request(wire.ParamSet(0, number("current_limit_mA"), 2000))
    assert isinstance(loop.request(wire.ParamSave()), wire.Done)
    loop.step()
    assert isinstance(loop.request(wire.ClearFault(0, Fault.PARAM_CRC)), wire.Done)
    bench.reboot(ResetCause.POWER_ON)
    loop.until(lambda: loop.restarts and loop.mode is BoardState.SAFE)
    assert bench.board.supervisor.limits.current_limit_mA == 2000


def test_the_rate_is_a_parameter() -> None:
    loop = Loop(SimulatedBench()).connected()
    loop.request(wire.ParamSet(0, number("state_rate_hz"), 500))
    loop.step(3)
    assert loop.states[-1].t_us - loop.states[-2].t_us == 2000


def test_scales_and_offsets_change_the_counts() -> None:
    loop = Loop(SimulatedBench()).connected()
    before = loop.states[-1].force_counts
    loop.request(wire.ParamSet(0, number("force_uN_per_count"), 500))
    loop.request(wire.ParamSet(0, number("force_offset_counts"), 100))
    loop.step(2)
    assert loop.states[-1].force_counts == pytest.approx(2 * before + 100, abs=40)


def test_link_stats_come_every_second_of_board_time() -> None:
    loop = Loop(SimulatedBench()).connected()
    loop.step(500)
    assert len(loop.stats) == 5
    assert loop.stats[-1].frames > loop.stats[0].frames
    assert loop.stats[-1].longest_loop_us == 10_000
    assert loop.stats[-1].overruns == 0


def test_overruns_are_counted_and_the_longest_loop_is_told() -> None:
    bench = SimulatedBench(faults=[injection("hang", 0.5, seconds=0.045)])
    loop = Loop(bench).connected()
    loop.step(250)
    assert loop.stats[-1].overruns == 1
    assert max(stats.longest_loop_us for stats in loop.stats) >= 40_000


def test_the_clock_wraps_without_a_trace() -> None:
    loop = Loop(SimulatedBench(clock_start_us=(1 << 32) - 1_500_000)).armed()
    loop.answer = hold(1000)
    loop.step(200)
    assert loop.states[-1].t_us < 2_000_000
    assert loop.mode is BoardState.ARMED
    assert loop.host.stats.missed_states == 0


def test_drain_and_stage_follow_the_setpoint_flags() -> None:
    bench = SimulatedBench(fixture="stretch")
    loop = Loop(bench).armed()
    flags = int(SetpointFlag.DRAIN_X | SetpointFlag.STAGE)

    def pull(state: wire.State) -> wire.Setpoint:
        return wire.Setpoint(0, state.t_us, (0, 0), (0, 0), flags, 100, stage_um=12_000)

    loop.answer = pull
    loop.step(3)
    assert bench.board.drain == (True, False)
    assert bench.board.stage_m == pytest.approx(0.012)
    loop.answer = lambda state: None
    loop.request(wire.Disarm(0))
    assert bench.board.drain == (False, False)
    assert bench.board.stage_m == pytest.approx(0.012)


def test_readings_are_whole_counts_of_what_the_plant_shows() -> None:
    bench = SimulatedBench(seed=3)
    bench.arm()
    state = bench.step_typed(None)
    truth = bench.plant.truth
    assert abs(state.rtd_cC[0] - (truth.T_K[0] - 273.15) * 100) < 15
    assert abs(state.encoder_counts - truth.displacement_m * 1e6) < 15
    assert abs(state.force_counts - truth.force_N * 1e3) < 15


class ForcelessBoard(Board):
    """A board without a load cell."""

    capabilities: ClassVar[Mapping[str, int]] = {
        fixture: has & ~Capability.FORCE_SENSOR for fixture, has in CAPABILITIES.items()
    }


def test_a_board_has_no_reading_of_a_part_that_it_lacks() -> None:
    loop = Loop(SimulatedBench(board_type=ForcelessBoard)).connected()
    loop.step(20)
    assert loop.states[-1].valid & (ValidBit.ENCODER | ValidBit.FORCE) == ValidBit.ENCODER


class CoarseHardware(Hardware):
    """Converters of 10 mA a count."""

    def measure(self, r: Readings, s: Memory, m: Measurements, dt_s: float) -> None:
        super().measure(r, s, m, dt_s)
        m.i_mA[:] = [round(i, -1) for i in m.i_mA]


class SmallBoard(Board):
    """A driver of 3 A, and coarse converters."""

    hardware_type = CoarseHardware
    initial_parameters: ClassVar[Mapping[str, int]] = {"current_limit_mA": 3000}


@pytest.mark.parametrize("axis_name", ["", "left"])
def test_another_board_has_its_own_driver_and_converters(axis_name: str) -> None:
    loop = Loop(SimulatedBench(board_type=SmallBoard, axis_name=axis_name)).armed()
    loop.answer = hold(4000)
    loop.step(50)
    assert max(state.i_applied_mA[0] for state in loop.states) == 3000
    assert {i % 10 for state in loop.states for i in state.i_meas_mA} == {0}
