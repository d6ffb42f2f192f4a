"""Every scripted fault: the heat that still goes in, the first fault named, and no re-arming."""

import math

import pytest

from firmware_protocol.enums import BoardState, Fault, ValidBit
from firmware_protocol.events import HostState, Incompatible
from sim_device.bench import SimulatedBench
from sim_device.errors import FaultSpecError
from sim_device.faults import FAULT_KINDS, Injection, injection, parse_injection

from .harsh import heat_then_flush
from .loop import Loop, hold
from .loose import loose

AT_S = 3.0
FULL = hold(4000)


def heated(fault: Injection, *, answer: object = FULL, seconds: float = 60.0) -> Loop:
    """Arm, heat as `answer` says, and go on until the board stops or the time is over."""
    loop = Loop(SimulatedBench(seed=1, faults=[fault]))
    loop.armed()
    loop.answer = answer  # type: ignore[assignment]
    hot = (BoardState.ARMED, BoardState.HOLD)
    while loop.bench.now_us < seconds * 1e6 and loop.bench.board.state in hot:
        loop.step()
    return loop


def check(loop: Loop, fault: Injection) -> Fault | None:
    """Check energy and that nothing re-arms; return the first fault."""
    bench = loop.bench
    _, before_J, _ = bench.faults.begun[0]
    heat_J = bench.heater_J - before_J
    first = bench.board.supervisor.first_fault
    assert heat_J <= fault.kind.budget_J, f"{heat_J:.1f} J, {first}"
    loop.step(300)
    if first is not None:
        assert bench.heater_J - before_J == pytest.approx(heat_J, abs=0.2)
        assert bench.board.state in (BoardState.FAULT, BoardState.SAFE)
    return None if first is None else first.fault


CASES: dict[str, tuple[dict[str, float], object]] = {
    # name of the injection: what differs from the row's defaults, what the host does meanwhile
    "sensor_open": ({}, FULL),
    "sensor_short": ({"channel": 3}, FULL),
    "sensor_invalid": ({"channel": 1}, FULL),
    "sensor_stuck": ({}, FULL),
    "sensor_detached": ({}, FULL),
    "sensors_swapped": ({}, FULL),
    "sensor_spikes": ({}, FULL),
    "sensor_offset": ({"channel": 1}, FULL),
    "encoder_lost": ({}, FULL),
    "force_saturated": ({}, FULL),
    "driver_short": ({}, FULL),
    "driver_open": ({}, FULL),
    "wire_cut": ({}, FULL),
    "driver_gain": ({}, FULL),
    "supply_sag": ({}, FULL),
    "pump_dry": ({}, hold(4000, 0, (255, 255))),
    "pump_stalled": ({}, hold(4000, 0, (255, 255))),
    "pump_stuck_on": ({}, FULL),
    "pump_no_flow": ({}, lambda state: heat_then_flush(state.t_us * 1e-6, state)),
    "leak": ({}, FULL),
    "hang": ({}, FULL),
    "slow_loop": ({}, FULL),
    "wrong_baud": ({}, FULL),
    "stall": ({}, FULL),
    "lost_way": ({}, FULL),
    "unplug": ({}, FULL),
}
HARMLESS = [
    "encoder_slip", "clock_drift", "lying_sp_seq", "flip_bits", "bursts", "drop_bytes",
    "insert_bytes", "duplicate_frames", "swap_frames", "modem_probe", "echo",
]  # fmt: skip
RESTARTS = [
    "reboot", "power_cycle", "clock_wrap", "corrupt_parameters", "schema_older", "schema_newer",
    "major_other",
]  # fmt: skip


def test_every_row_of_the_table_is_tried_below() -> None:
    special = {"delay", "junk", "split_frames"}
    assert set(CASES) | set(HARMLESS) | set(RESTARTS) | special == set(FAULT_KINDS)


@pytest.mark.parametrize("name", CASES)
def test_a_fault_is_named_and_the_heat_stays_within_its_budget(name: str) -> None:
    parameters, answer = CASES[name]
    fault = injection(name, AT_S, **parameters)
    loop = heated(fault, answer=answer)
    first = check(loop, fault)
    assert first in fault.kind.expects, loop.bench.board.supervisor.first_fault
    assert loop.bench.board.state is BoardState.FAULT


@pytest.mark.parametrize(("parameters", "lag_s"), [("A", 12.0), ("A", 40.0), ("B", 1e9)])
@pytest.mark.parametrize("swing_K", [1.0, 2.4, 5.0, 10.0])
@pytest.mark.parametrize("period_s", [0.5, 2.0, 6.0])
def test_a_loose_sensor_whose_reading_swings_is_found_before_the_wire_is_hot(
    parameters: str, lag_s: float, swing_K: float, period_s: float
) -> None:
    found = loose(parameters, lag_s, swing_K, period_s)
    assert found.fault is Fault.NOT_HEATING
    assert found.hottest_degC < 90.0


@pytest.mark.parametrize("period_s", [0.5, 2.0, 6.0])
def test_a_swing_does_not_hide_what_a_tightened_limit_finds(period_s: float) -> None:
    limits = {"unheated_energy_mJ": 8000}
    steady = loose("B", 20.0, limits=limits)
    swinging = loose("B", 20.0, 5.0, period_s, limits=limits)
    assert steady.fault is swinging.fault is Fault.NOT_HEATING
    assert swinging.hottest_degC < 90.0


@pytest.mark.parametrize("channel", [0, 1])
def test_a_shorted_driver_is_cut_by_the_gate_of_either_spring(channel: int) -> None:
    fault = injection("driver_short", AT_S, channel=channel)
    loop = heated(fault, answer=hold(0))
    assert check(loop, fault) in fault.kind.expects
    assert loop.states[-1].i_meas_mA[channel] < 50


@pytest.mark.parametrize("name", HARMLESS)
def test_the_board_goes_on_through_what_is_harmless(name: str) -> None:
    fault = injection(name, AT_S, lasts=2.0)
    loop = heated(fault, answer=hold(1000), seconds=8.0)
    assert loop.bench.board.supervisor.first_fault is None
    assert loop.bench.board.state is BoardState.ARMED
    assert loop.host.state is HostState.RUNNING


def test_a_line_that_is_bad_in_every_way_shows_in_the_counters() -> None:
    for name, counter in (("flip_bits", "crc_errors"), ("drop_bytes", "crc_errors")):
        fault = injection(name, 1.0, rate=5e-3, lasts=5.0)
        loop = heated(fault, answer=hold(500), seconds=8.0)
        assert getattr(loop.host.stats.decoder, counter) > 0
        assert getattr(loop.bench.board.session.stats.decoder, counter) > 0


@pytest.mark.parametrize("name", RESTARTS)
def test_a_restarted_board_is_off_and_stays_off(name: str) -> None:
    fault = injection(name, AT_S)
    loop = heated(fault, seconds=AT_S + 0.2)
    check(loop, fault)
    loop.step(500)
    assert loop.bench.board.state in (BoardState.SAFE, BoardState.FAULT)
    assert list(loop.bench.board.outputs.applied_mA) == [0, 0]
    assert loop.host.state is not HostState.RUNNING
    if name == "corrupt_parameters":
        assert loop.bench.board.supervisor.first_fault is not None
        assert loop.bench.board.supervisor.first_fault.fault is Fault.PARAM_CRC


@pytest.mark.parametrize("name", ["schema_older", "schema_newer"])
def test_a_board_with_another_table_may_only_be_watched(name: str) -> None:
    loop = heated(injection(name, 1.0), seconds=1.1)
    loop.step(300)
    (incompatible,) = loop.of(Incompatible)
    assert incompatible.fields  # type: ignore[attr-defined]


def test_a_megabyte_of_junk_leaves_the_board_answering() -> None:
    loop = Loop(SimulatedBench(faults=[injection("junk", 1.0, bytes=1e6)])).connected()
    loop.step(120)
    loop.armed()
    assert loop.mode is BoardState.ARMED


def test_a_late_line_makes_setpoints_old_and_a_very_late_one_makes_them_stale() -> None:
    for delay_us, mode in ((15_000, BoardState.ARMED), (60_000, BoardState.FAULT)):
        fault = injection("delay", 2.0, us=delay_us, way=0)
        loop = heated(fault, answer=hold(1000), seconds=6.0)
        assert loop.bench.board.state is mode
        if mode is BoardState.ARMED:
            assert loop.states[-1].sp_age_us >= 10_000
        else:
            assert loop.bench.board.session.stats.stale_setpoints > 5


def test_frames_in_pieces_are_put_together() -> None:
    fault = injection("split_frames", 2.0, bytes=60, way=0)
    loop = heated(fault, answer=hold(1000), seconds=6.0)
    assert loop.bench.board.session.stats.decoder.crc_errors == 0
    assert loop.bench.board.state is BoardState.ARMED


def test_a_stall_shorter_than_hold_is_gone_through() -> None:
    fault = injection("stall", 2.0, lasts=0.3)
    loop = heated(fault, answer=hold(1000), seconds=4.0)
    assert any(state.mode is BoardState.HOLD for state in loop.states)
    assert loop.bench.board.state is BoardState.ARMED


def test_what_a_stall_held_back_is_not_replayed() -> None:
    fault = injection("stall", 2.0, lasts=0.45, way=0)
    loop = heated(fault, answer=hold(4000), seconds=2.44)
    begun_J = loop.bench.faults.begun[0][1]
    assert loop.bench.heater_J - begun_J < 12.5 * 0.13


def test_a_mended_fault_ends() -> None:
    bench = SimulatedBench(faults=[injection("sensor_open", 1.0, lasts=1.0)])
    readings = [bench.step_typed(None).rtd_cC[0] for _ in range(300)]
    assert readings[50] < 3000
    assert readings[150] == 32767
    assert readings[250] < 3000


@pytest.mark.parametrize(
    ("name", "bit"),
    [("encoder_lost", ValidBit.ENCODER), ("force_saturated", ValidBit.FORCE)],
)
def test_a_reading_that_is_lost_is_told_as_invalid(name: str, bit: ValidBit) -> None:
    bench = SimulatedBench(faults=[injection(name, 1.0)])
    valid = [bench.step_typed(None).valid & bit for _ in range(150)]
    assert (valid[50], valid[149]) == (bit, 0)


def test_the_port_goes_away_and_comes_back() -> None:
    bench = SimulatedBench(faults=[injection("unplug", 1.0, seconds=0.5)])
    calls: list[str] = []
    bench.on_unplug = lambda renamed: calls.append(f"out {renamed}")
    bench.on_plug = lambda: calls.append("in")
    out = [len(bench.step()) for _ in range(200)]
    assert calls == ["out False", "in"]
    assert sum(out[105:149]) == 0
    assert all(out[160:])


# Descriptions


@pytest.mark.parametrize(
    ("text", "at_us", "parameters", "lasts_s"),
    [
        ("leak@2", 2_000_000, {}, math.inf),
        ("sensor_open@0.5:channel=2", 500_000, {"channel": 2.0}, math.inf),
        ("stall@1e0:way=1,lasts=0.25", 1_000_000, {"way": 1.0}, 0.25),
    ],
)
def test_a_fault_is_described_in_one_word(
    text: str, at_us: int, parameters: dict[str, float], lasts_s: float
) -> None:
    parsed = parse_injection(text)
    assert parsed.at_us == at_us
    assert parameters.items() <= parsed.parameters.items()
    assert parsed.lasts_s == lasts_s


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("leak", "gives no time"),
        ("leek@1", "no fault is named 'leek'"),
        ("leak@soon", "not a number"),
        ("leak@1:channel=0", "no parameter channel"),
        ("sensor_open@1:channel=4", "channel 4 does not exist"),
        ("driver_open@1:channel=2", "channel 2 does not exist"),
        ("stall@1:way=3", "way 3"),
        ("leak@-1", "must be 0 or later"),
        ("leak@1:lasts=0", "longer than 0"),
        ("leak@inf", "finite"),
        ("hang@1:seconds", "not a number"),
        ("hang@1:seconds=1,seconds=2", "seconds is given twice; give it once"),
    ],
)
def test_a_fault_described_wrongly_is_refused_with_the_reason(text: str, says: str) -> None:
    with pytest.raises(FaultSpecError, match=says):
        parse_injection(text)
