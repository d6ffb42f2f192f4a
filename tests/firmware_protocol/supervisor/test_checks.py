"""Each row of the check table: what trips it, after how long, and what comes close and does not."""

import math
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from firmware_protocol.enums import BoardState, Channel, Fault, Limiter
from firmware_protocol.supervisor import (
    CHECKS,
    FAULT_TEXTS,
    Disarmed,
    Measurements,
    SelfTest,
    compiled_limits,
    tighten,
)
from firmware_protocol.supervisor.table import ALWAYS, LINES

from .bench import Rig


def put(field: str, value: int, k: int | None = None) -> Callable[[Measurements], None]:
    """Return a spoiler that sets a field, or one element of it, in every sample."""

    def spoil(m: Measurements) -> None:
        if k is None:
            setattr(m, field, value)
        else:
            getattr(m, field)[k] = value

    return spoil


def trips(rig: Rig, most_s: float) -> tuple[Fault, Channel, float]:
    """Return the first fault, its channel, and the seconds it took."""
    took = rig.until(BoardState.FAULT, most_s)
    first = rig.supervisor.first_fault
    assert first is not None
    return first.fault, first.channel, took


def stays(rig: Rig, seconds: float, state: BoardState = BoardState.ARMED) -> None:
    for _ in range(round(seconds * 100)):
        rig.step()
        assert rig.state is state, rig.supervisor.first_fault


CASES = [
    # name, spoiler, fault, channel, least s, most s
    ("X gives no value", put("rtd_cC", -32768, 0), Fault.SENSOR_INVALID, 0, 0.03, 0.03),
    ("Y open", put("rtd_cC", 32767, 1), Fault.SENSOR_OPEN, 1, 0.03, 0.03),
    ("inlet open", put("rtd_cC", 20000, 2), Fault.SENSOR_OPEN, 2, 0.03, 0.03),
    ("ambient shorted", put("rtd_cC", -24200, 3), Fault.SENSOR_SHORT, 3, 0.03, 0.03),
    ("encoder lost", put("encoder_invalid", 1), Fault.SENSOR_INVALID, 5, 0.03, 0.03),
    ("load cell at its end", put("force_invalid", 1), Fault.SENSOR_INVALID, 6, 0.03, 0.03),
    ("too hot", put("rtd_cC", 9501, 0), Fault.OVER_TEMPERATURE, 0, 0.03, 0.03),
    ("leak", put("leak", 1), Fault.LEAK, 4, 0.06, 0.06),
    ("supply low", put("vbus_mV", 7499), Fault.BROWN_OUT, 4, 0.02, 0.02),
    ("parameters damaged", put("parameters_ok", 0), Fault.PARAM_CRC, 4, 0.01, 0.01),
    ("FET shorted", put("i_mA", 4601, 0), Fault.OVER_CURRENT, 0, 0.02, 0.02),
    ("current on its own", put("i_mA", 700, 1), Fault.UNCOMMANDED_CURRENT, 1, 0.03, 0.06),
    ("too much current", put("i_mA", 4550, 0), Fault.CURRENT_HIGH, 0, 0.06, 0.2),
    ("too little current", put("i_mA", 3000, 0), Fault.CURRENT_LOW, 0, 0.06, 0.2),
    ("pump on its own", put("pump_rpm", 5000, 1), Fault.PUMP_STUCK_ON, 1, 1.0, 1.02),
    ("below its surroundings", put("rtd_cC", 2179, 1), Fault.SENSOR_IMPLAUSIBLE, 1, 0.03, 0.03),
]


@pytest.mark.parametrize(
    ("spoil", "fault", "channel", "least_s", "most_s"),
    [case[1:] for case in CASES],
    ids=[case[0] for case in CASES],
)
def test_a_broken_part_is_named_in_time(
    spoil: Callable[[Measurements], None], fault: Fault, channel: int, least_s: float, most_s: float
) -> None:
    rig = Rig().heat(seconds=1.5)
    rig.spoil = spoil
    found, where, took = trips(rig, 5.0)
    assert (found, where) == (fault, Channel(channel))
    assert least_s - 1e-6 <= took <= most_s + 1e-6
    assert not rig.memory.gate


AT_A_LIMIT = [
    ("sensor below its rail", put("rtd_cC", 19_999, 2), Fault.SENSOR_OPEN),
    ("sensor above its rail", put("rtd_cC", -3999, 3), Fault.SENSOR_SHORT),
    ("hot", put("rtd_cC", 9500, 0), Fault.OVER_TEMPERATURE),
    ("supply", put("vbus_mV", 7500), Fault.BROWN_OUT),
    ("current", put("i_mA", 4600, 0), Fault.OVER_CURRENT),
    ("as cold as its surroundings allow", put("rtd_cC", 2180, 1), Fault.SENSOR_IMPLAUSIBLE),
]


@pytest.mark.parametrize(
    ("spoil", "fault"), [c[1:] for c in AT_A_LIMIT], ids=[c[0] for c in AT_A_LIMIT]
)
def test_a_reading_at_its_limit_is_not_beyond_it(
    spoil: Callable[[Measurements], None], fault: Fault
) -> None:
    rig = Rig().heat(seconds=1.5)
    # One leap to the limit is no fault; others may find what stays there after a while.
    rig.spoil = spoil
    rig.step(10)
    assert not rig.memory.faults >> (fault - 1) & 1


NEAR = [
    ("two bad conversions", put("rtd_cC", 32767, 0), 2),
    ("two hot readings", put("rtd_cC", 9501, 0), 2),
    ("contact bounce", put("leak", 1), 5),
    ("one dip of the supply", put("vbus_mV", 7000), 1),
    ("one spike of current", put("i_mA", 10_000, 0), 1),
]


@pytest.mark.parametrize(("spoil", "samples"), [c[1:] for c in NEAR], ids=[c[0] for c in NEAR])
def test_what_passes_before_the_debounce_trips_nothing(
    spoil: Callable[[Measurements], None], samples: int
) -> None:
    rig = Rig().heat(2000, seconds=1.5)
    good = Measurements(**{name: getattr(rig.m, name) for name in ("leak", "vbus_mV")})
    rig.spoil = spoil
    rig.step(samples)
    rig.spoil = lambda m: (setattr(m, "leak", good.leak), setattr(m, "vbus_mV", good.vbus_mV))[0]
    stays(rig, 3.0)


def test_a_time_that_a_condition_did_not_hold_is_not_counted() -> None:
    rig = Rig().heat(seconds=1.5)
    for _ in range(5):
        rig.spoil = put("leak", 1)
        rig.step(4)
        rig.spoil = put("leak", 0)
        rig.step()
    assert rig.state is BoardState.ARMED


def test_a_wire_that_breaks_is_told_from_a_driver_that_dies() -> None:
    for voltage_mV, fault in ((11_500, Fault.WIRE_OPEN), (0, Fault.DRIVER_OPEN)):
        rig = Rig().heat(seconds=1.5)

        def spoil(m: Measurements, voltage_mV: int = voltage_mV) -> None:
            m.i_mA[0], m.v_mV[0] = 0, voltage_mV

        rig.spoil = spoil
        found, where, took = trips(rig, 1.0)
        assert (found, where) == (fault, Channel.SPRING_X)
        assert took == pytest.approx(0.06)


def test_a_driver_that_lags_by_a_tenth_of_a_second_trips_nothing() -> None:
    rig = Rig().arm()
    current_mA = [0.0]

    def lag(m: Measurements) -> None:
        current_mA[0] += (m.applied_mA[0] - current_mA[0]) * 0.1
        m.i_mA[0] = round(current_mA[0])
        m.v_mV[0] = m.i_mA[0] * 760 // 1000

    rig.spoil = lag
    for _ in range(10):
        rig.setpoint_mA = (4000, 0)
        stays(rig, 0.5)
        rig.setpoint_mA = (0, 0)
        stays(rig, 0.5)


def test_over_temperature_counts_only_readings_that_can_be_true() -> None:
    rig = Rig().heat()
    rig.spoil = put("rtd_cC", 25_000, 0)
    assert trips(rig, 1.0)[0] is Fault.SENSOR_OPEN


def test_hysteresis_keeps_the_count_inside_the_band_and_loses_it_below() -> None:
    for between, expected in ((9200, BoardState.FAULT), (8900, BoardState.ARMED)):
        rig = Rig().heat(0)
        rig.physical = False
        rig.supervisor.limits.jump_cC = 10_000
        for reading in (9600, between, 9600, between, 9600):
            rig.m.rtd_cC[0] = reading
            rig.m.rtd_cC[1] = 2700
            rig.step()
        first = rig.supervisor.first_fault
        if expected is BoardState.FAULT:
            assert first is not None
            assert first.fault is Fault.OVER_TEMPERATURE
        else:
            assert first is None


# Sensors that lie


def test_one_spike_is_a_warning_and_several_are_a_fault() -> None:
    rig = Rig().heat()
    rig.spoil = put("rtd_cC", 6000, 0)
    rig.step()
    rig.spoil = lambda m: None
    rig.step()
    assert rig.memory.warnings >> 1 & 1
    stays(rig, 5.0)
    assert not rig.memory.warnings >> 1 & 1
    for _ in range(2):
        rig.spoil = put("rtd_cC", 8500, 0)
        rig.step()
        rig.spoil = lambda m: None
        rig.step(5)
    assert rig.supervisor.first_fault is not None
    assert rig.supervisor.first_fault.fault is Fault.SENSOR_IMPLAUSIBLE


def test_a_reading_that_hangs_while_heating_is_stuck() -> None:
    rig = Rig().heat(seconds=1.0)
    rig.spoil = put("rtd_cC", rig.m.rtd_cC[0], 0)
    fault, channel, took = trips(rig, 20.0)
    assert (fault, channel) == (Fault.SENSOR_STUCK, Channel.SPRING_X)
    assert took < 5.1


def test_a_reading_that_hangs_under_weak_heating_is_stuck_once_any_spring_had_warmed() -> None:
    rig = Rig().heat(800, seconds=1.0)
    rig.spoil = put("rtd_cC", rig.m.rtd_cC[0], 0)
    fault, channel, took = trips(rig, 200.0)
    assert (fault, channel) == (Fault.SENSOR_STUCK, Channel.SPRING_X)
    assert took > 5.0
    assert rig.memory.anchor_net_nJ[0] < 20_000_000_000


def test_a_steady_reading_without_any_noise_is_not_stuck() -> None:
    rig = Rig().arm()
    rig.setpoint_mA, rig.duty = (2000, 0), (255, 0)
    stays(rig, 60.0)
    rig.spoil = put("rtd_cC", rig.m.rtd_cC[0], 0)
    stays(rig, 60.0)


def test_a_spring_that_gets_energy_and_does_not_warm_is_found_by_energy_not_by_time() -> None:
    energies = []
    for current_mA in (4000, 2500):
        rig = Rig()
        rig.warms[0] = False
        rig.heat(current_mA, seconds=0.0)
        assert trips(rig, 60.0)[0] is Fault.NOT_HEATING
        energies.append(rig.supervisor.first_fault.measured)  # type: ignore[union-attr]
        assert rig.supervisor.first_fault.limit == 20_000  # type: ignore[union-attr]
    assert energies[0] == pytest.approx(energies[1], rel=0.02)


def _triangle(t_s: float) -> float:
    return 1.0 - 4.0 * abs(t_s / 2.0 % 1.0 - 0.5)


SWINGS: dict[str, Callable[[float], float]] = {
    "sine": lambda t_s: math.sin(2.0 * math.pi * t_s),
    "slow sine": lambda t_s: math.sin(0.2 * math.pi * t_s),
    "triangle": _triangle,
    "square": lambda t_s: 1.0 if t_s % 4.0 < 2.0 else -1.0,
    "saw": lambda t_s: 2.0 * (t_s / 3.0 % 1.0) - 1.0,
    "noise": lambda t_s: random.Random(t_s).uniform(-1.0, 1.0),
}


@pytest.mark.parametrize("swing_cC", [50, 120, 190, 500])
@pytest.mark.parametrize("wave", SWINGS)
def test_a_reading_that_only_swings_has_not_warmed(wave: str, swing_cC: int) -> None:
    rig = Rig().arm()
    rig.setpoint_mA = (4000, 0)
    # The jumps of the steepest ones would be there first.
    rig.supervisor.limits.jumps = 10**6

    def swing(m: Measurements) -> None:
        flicker_cC = rig.now_us // 10_000 % 2
        m.rtd_cC[0] = 3500 + flicker_cC + round(swing_cC * SWINGS[wave](rig.now_us * 1e-6))

    rig.spoil = swing
    fault, channel, took = trips(rig, 10.0)
    assert (fault, channel) == (Fault.NOT_HEATING, Channel.SPRING_X)
    assert took < 8.0


@pytest.mark.parametrize("spike_cC", [390, 3000, -1000])
def test_one_spike_of_a_slow_spring_is_not_taken_for_its_temperature(spike_cC: int) -> None:
    for at_s in (0.5, 2.0, 5.0):
        rig = Rig().heat(4000, seconds=at_s)
        rig.m.rtd_cC[0] += spike_cC
        rig.spoil = put("rtd_cC", rig.m.rtd_cC[0], 0)
        rig.step()
        rig.spoil = lambda m: None
        stays(rig, 8.0)


@pytest.mark.parametrize("duty", [0, 128, 255])
def test_a_spring_in_balance_may_be_held_for_minutes(duty: int) -> None:
    rig = Rig().arm()
    rig.setpoint_mA, rig.duty = (700 if duty == 0 else 3000, 0), (duty, 0)
    stays(rig, 240.0)


def test_a_pump_that_runs_on_its_own_is_not_taken_for_a_spring_that_does_not_warm() -> None:
    rig = Rig().arm()
    rig.setpoint_mA = (4000, 0)
    rig.seconds(3.0)

    def flush(m: Measurements) -> None:
        m.pump_rpm[0] = 6000
        m.rtd_cC[0] = 3900 + rig.now_us // 10_000 % 2

    rig.spoil = flush
    assert trips(rig, 5.0)[0] is Fault.PUMP_STUCK_ON


def test_sensors_that_changed_places_are_named() -> None:
    rig = Rig().arm()

    def swap(m: Measurements) -> None:
        m.rtd_cC[0], m.rtd_cC[1] = m.rtd_cC[1], m.rtd_cC[0]

    rig.spoil = swap
    rig.setpoint_mA = (4000, 0)
    fault, channel, took = trips(rig, 10.0)
    assert (fault, channel) == (Fault.SENSORS_SWAPPED, Channel.SPRING_X)
    assert took < 3.0


def test_a_spring_that_does_not_warm_beside_a_heated_one_has_not_changed_places_with_it() -> None:
    rig = Rig()
    rig.warms[0] = False
    rig.heat(4000, 4000, seconds=0.0)
    assert trips(rig, 60.0)[0] is Fault.NOT_HEATING


def test_a_spring_that_goes_on_warming_after_it_was_switched_off_is_a_fault() -> None:
    rig = Rig().heat(seconds=2.0)
    rig.setpoint_mA = (0, 0)
    rig.step()
    rise = [rig.m.rtd_cC[0]]

    def runaway(m: Measurements) -> None:
        rise[0] += 4
        m.rtd_cC[0] = rise[0]

    rig.spoil = runaway
    fault, channel, took = trips(rig, 10.0)
    assert (fault, channel) == (Fault.HEATING_WHILE_OFF, Channel.SPRING_X)
    assert 3.0 < took < 4.6


@pytest.mark.parametrize("broken_cC", [-32768, 32767, 20000, -4000])
def test_a_sensor_that_is_gone_for_a_while_is_not_taken_for_warming(broken_cC: int) -> None:
    rig = Rig(physical=False)
    rig.event(SelfTest(True))
    rig.m.rtd_cC[0] = 4000
    stays(rig, 10.0, BoardState.SAFE)
    for _ in range(3):
        rig.m.rtd_cC[0] = broken_cC
        stays(rig, 0.5, BoardState.SAFE)
        rig.m.rtd_cC[0] += 4150 - broken_cC
        stays(rig, 0.5, BoardState.SAFE)
        assert rig.memory.off_fcC[0] == pytest.approx(4150 << 16, abs=200 << 16)


def test_a_room_that_warms_in_the_sun_is_not_a_runaway() -> None:
    rig = Rig().arm()
    rig.physical = False

    def sun(m: Measurements) -> None:
        for j in range(4):
            m.rtd_cC[j] = 2700 + rig.now_us // 100_000 * 2

    rig.spoil = sun
    stays(rig, 60.0)


def test_a_reading_that_rises_slower_than_any_good_spring_leaves_the_envelope() -> None:
    rig = Rig().arm()
    rig.setpoint_mA = (4000, 0)
    # NOT_HEATING would be there first.
    rig.supervisor.limits.unheated_energy_mJ = 10**9

    def damp(m: Measurements) -> None:
        m.rtd_cC[0] = 2700 + (m.rtd_cC[0] - 2700) // 10 + rig.now_us // 10_000 % 2

    rig.spoil = damp
    fault, channel, took = trips(rig, 60.0)
    assert (fault, channel) == (Fault.MODEL_RESIDUAL, Channel.SPRING_X)
    assert rig.supervisor.first_fault is not None
    assert rig.supervisor.first_fault.limit == 1500
    assert took > 5.0


def test_a_reading_that_rises_faster_than_any_good_spring_leaves_the_envelope() -> None:
    rig = Rig().arm()
    rig.setpoint_mA = (300, 0)
    rig.seconds(1.0)
    rise = [0]

    def climb(m: Measurements) -> None:
        rise[0] = min(rise[0] + 5, 3500)
        m.rtd_cC[0] += rise[0]

    rig.spoil = climb
    fault, channel, took = trips(rig, 30.0)
    assert (fault, channel) == (Fault.MODEL_RESIDUAL, Channel.SPRING_X)
    assert took > 5.0


# Resistance, current, pumps


@pytest.mark.parametrize("ohm_m", [150, 2000])
def test_a_resistance_that_no_spring_has_is_a_fault(ohm_m: int) -> None:
    rig = Rig().heat(1500)

    def spoil(m: Measurements) -> None:
        m.v_mV[0] = m.i_mA[0] * ohm_m // 1000

    rig.spoil = spoil
    fault, _, took = trips(rig, 2.0)
    assert fault is Fault.RESISTANCE_OUT_OF_BAND
    assert took >= 0.1


def phase_change(rig: Rig, *, follows: bool) -> Callable[[Measurements], None]:
    """Return a spoiler: the resistance falls by a quarter, and the RTD follows or does not."""
    start_cC = rig.m.rtd_cC[0]
    change = [0]

    def spoil(m: Measurements) -> None:
        change[0] = min(change[0] + 1, 250)
        m.v_mV[0] = m.i_mA[0] * (760 - 760 * change[0] // 1000) // 1000
        m.rtd_cC[0] = start_cC + (8 * change[0] if follows else 0) + rig.now_us // 10_000 % 2

    return spoil


def test_resistance_is_a_second_thermometer() -> None:
    for follows in (True, False):
        rig = Rig().arm()
        rig.setpoint_mA = (1200, 0)
        rig.seconds(1.0)
        rig.spoil = phase_change(rig, follows=follows)
        rig.seconds(6.0)
        found = bool(rig.memory.faults & 1 << (Fault.RESISTANCE_RTD_DISAGREE - 1))
        assert found != follows, rig.supervisor.first_fault


def test_i2t_lowers_the_ceiling_and_trips_only_a_driver_that_does_not_obey() -> None:
    rig = Rig().arm()
    rig.setpoint_mA, rig.duty = (4000, 0), (255, 0)
    rig.seconds(310.0)
    assert rig.memory.applied_mA[0] == 3000
    assert rig.supervisor.limiter is Limiter.I2T
    stays(rig, 60.0)

    def disobey(m: Measurements) -> None:
        m.i_mA[0], m.applied_mA[0] = 4000, 4000

    rig.spoil = disobey
    assert trips(rig, 60.0)[0] is Fault.I2T


def test_i2t_does_not_raise_a_ceiling_that_was_tightened_below_the_rated_current() -> None:
    rig = Rig(tighten(compiled_limits(), {"current_limit_mA": 1000})).heat(4000)
    rig.memory.i2t_mA2us[0] = rig.memory.i2t_budget_mA2us + 10**13
    rig.step()
    assert rig.memory.applied_mA[0] == 1000


def test_the_current_folds_back_before_the_temperature_trips() -> None:
    rig = Rig().arm()
    rig.setpoint_mA = (4000, 0)
    stays(rig, 300.0)
    assert 8100 < rig.m.rtd_cC[0] < 8800
    assert rig.supervisor.limiter is Limiter.TEMPERATURE
    assert rig.memory.warnings >> 2 & 1


def test_the_current_folds_back_by_the_energy_where_a_sensor_does_not_follow() -> None:
    rig = Rig().arm()
    rig.setpoint_mA = (4000, 0)
    # These would be there first.
    rig.supervisor.limits.unheated_energy_mJ = rig.supervisor.limits.residual_cC = 10**9

    def stay_cold(m: Measurements) -> None:
        m.rtd_cC[0] = 2700 + rig.now_us // 10_000 % 2

    rig.spoil = stay_cold
    stays(rig, 60.0)
    assert rig.memory.applied_mA[0] < 3500
    assert rig.supervisor.limiter is Limiter.TEMPERATURE


def test_an_end_of_the_fold_back_below_its_start_ends_the_current_there() -> None:
    rig = Rig(tighten(compiled_limits(), {"fold_end_cC": 5000})).arm()
    rig.setpoint_mA = (4000, 0)
    stays(rig, 60.0)
    assert 4900 < rig.m.rtd_cC[0] < 5200


@pytest.mark.parametrize(
    ("rpm", "fault", "least_s"),
    [(0, Fault.PUMP_STALLED, 1.0), (10_800, Fault.PUMP_DRY, 2.0)],
)
def test_a_pump_is_watched_by_its_speed(rpm: int, fault: Fault, least_s: float) -> None:
    rig = Rig().arm()
    rig.duty = (255, 0)
    rig.setpoint_mA = (1000, 0)
    rig.spoil = put("pump_rpm", 5900, 0)
    stays(rig, 5.0)
    rig.spoil = put("pump_rpm", rpm, 0)
    found, channel, took = trips(rig, 5.0)
    assert (found, channel) == (fault, Channel.SPRING_X)
    assert took >= least_s
    assert rig.memory.duty == [0, 0], "the pumps stay off for this fault"


def test_a_pump_without_tachometer_is_not_watched_by_speed() -> None:
    rig = Rig().arm()
    rig.duty = (255, 255)
    rig.setpoint_mA = (1000, 0)
    stays(rig, 10.0)


def test_a_hot_spring_that_is_flushed_and_does_not_cool_is_a_fault() -> None:
    rig = Rig().heat(seconds=6.0)
    rig.setpoint_mA, rig.duty = (0, 0), (255, 0)
    hot = rig.m.rtd_cC[0]

    def stay_hot(m: Measurements) -> None:
        m.rtd_cC[0] = hot - rig.now_us // 100_000 % 5

    rig.spoil = stay_hot
    fault, _, took = trips(rig, 20.0)
    assert fault is Fault.NO_COOLING
    assert 11.9 < took < 14.1


@pytest.mark.parametrize(("gap_us", "trips_it"), [(50_000, False), (50_001, True)])
def test_a_loop_that_takes_too_long_is_a_fault(gap_us: int, trips_it: bool) -> None:
    rig = Rig().heat()
    rig.step(1, gap_us)
    assert (rig.state is BoardState.FAULT) == trips_it
    if trips_it:
        assert rig.supervisor.first_fault is not None
        assert rig.supervisor.first_fault.fault is Fault.LOOP_OVERRUN


def test_armed_for_too_long_is_a_fault() -> None:
    rig = Rig()
    rig.supervisor.limits.on_time_limit_s = 60
    rig.arm()
    stays(rig, 60.9)
    assert trips(rig, 1.0)[0] is Fault.ARMED_TOO_LONG


# The table


@pytest.mark.parametrize("state", [BoardState.SAFE, BoardState.FAULT, BoardState.COOL])
def test_checks_that_matter_with_the_gate_off_are_watched_there(state: BoardState) -> None:
    watched = {check.fault for check in CHECKS if state in check.states}
    assert {Fault.OVER_TEMPERATURE, Fault.UNCOMMANDED_CURRENT, Fault.LEAK} <= watched


def test_every_fault_has_a_check_or_is_raised_by_the_machine() -> None:
    by_machine = {Fault.NONE, Fault.SELF_TEST, Fault.SETPOINT_LOST, Fault.ESTOP_PRESSED}
    assert {check.fault for check in CHECKS} | by_machine == set(Fault)
    assert set(FAULT_TEXTS) == set(Fault)


def test_a_row_has_as_many_lines_as_channels() -> None:
    assert len(LINES) == sum(len(check.channels) for check in CHECKS)


def test_a_check_that_is_always_on_is_on_in_every_state_that_measures() -> None:
    assert set(BoardState) - {BoardState.BOOT, BoardState.ESTOP} == ALWAYS


def test_hold_is_watched_like_armed_and_no_channel_is_left_out() -> None:
    for check in CHECKS:
        assert (BoardState.ARMED in check.states) == (BoardState.HOLD in check.states), check.fault
        alike = {Channel.SPRING_X, Channel.SPRING_Y}, {Channel.INLET, Channel.AMBIENT}
        for group in alike:
            assert group <= set(check.channels) or not group & set(check.channels), check.fault
        if Channel.INLET in check.channels:
            assert Channel.SPRING_X in check.channels


def with_gate_off(state: BoardState) -> Rig:
    """A rig in SAFE, in COOL with a hot spring, or in FAULT, whose cause is gone."""
    if state is BoardState.SAFE:
        rig = Rig()
        rig.event(SelfTest(True))
        rig.seconds(0.5)
        return rig
    rig = Rig().heat(seconds=8.0)
    if state is BoardState.COOL:
        rig.event(Disarmed())
        rig.step()
    else:
        rig.spoil = put("vbus_mV", 7000)
        rig.seconds(0.05)
        rig.spoil = lambda m: None
        rig.m.vbus_mV = 12_000
    assert rig.state is state
    return rig


def jump_about(m: Measurements) -> None:
    m.rtd_cC[3] = 3500 if m.rtd_cC[3] < 3000 else 2680


SAFE, COOL, STOPPED = BoardState.SAFE, BoardState.COOL, BoardState.FAULT
OFF_CASES = [
    # fault, spoiler, seconds, states in which it must be seen
    (Fault.PARAM_CRC, put("parameters_ok", 0), 0.02, (SAFE, COOL, STOPPED)),
    (Fault.LEAK, put("leak", 1), 0.08, (SAFE, COOL, STOPPED)),
    (Fault.OVER_CURRENT, put("i_mA", 10_000, 0), 0.03, (SAFE, COOL, STOPPED)),
    (Fault.UNCOMMANDED_CURRENT, put("i_mA", 700, 1), 0.2, (SAFE, COOL, STOPPED)),
    (Fault.OVER_TEMPERATURE, put("rtd_cC", 9600, 1), 0.04, (SAFE, COOL, STOPPED)),
    (Fault.PUMP_STUCK_ON, put("pump_rpm", 5000, 0), 1.1, (SAFE, STOPPED)),
    (Fault.SENSOR_INVALID, put("rtd_cC", -32768, 0), 0.04, (COOL, STOPPED)),
    (Fault.SENSOR_OPEN, put("rtd_cC", 32767, 1), 0.04, (COOL, STOPPED)),
    (Fault.SENSOR_SHORT, put("rtd_cC", -24200, 2), 0.04, (COOL, STOPPED)),
    (Fault.SENSOR_IMPLAUSIBLE, jump_about, 0.1, (COOL,)),
    (Fault.SENSOR_IMPLAUSIBLE, put("rtd_cC", 2100, 1), 0.05, (COOL,)),
    (Fault.HEATING_WHILE_OFF, None, 5.0, (SAFE, COOL)),
    (Fault.MODEL_RESIDUAL, put("rtd_cC", 9400, 0), 5.2, (COOL,)),
    (Fault.PUMP_STALLED, put("pump_rpm", 0, 1), 1.1, (COOL,)),
    (Fault.PUMP_DRY, put("pump_rpm", 10_800, 0), 2.1, (COOL,)),
    (Fault.NO_COOLING, put("rtd_cC", 5500, 0), 12.2, (COOL,)),
]


@pytest.mark.parametrize(
    ("fault", "spoil", "seconds", "state"),
    [(*case[:3], state) for case in OFF_CASES for state in case[3]],
    ids=lambda value: getattr(value, "name", ""),
)
def test_what_breaks_with_the_gate_off_is_seen_there(
    fault: Fault, spoil: Callable[[Measurements], None] | None, seconds: float, state: BoardState
) -> None:
    rig = with_gate_off(state)
    if spoil is None:
        warm_cC = [rig.m.rtd_cC[0]]

        def spoil(m: Measurements) -> None:
            warm_cC[0] += 4
            m.rtd_cC[0] = warm_cC[0]

    rig.spoil = spoil
    rig.seconds(seconds)
    assert rig.memory.faults >> (fault - 1) & 1, rig.supervisor.first_fault


def test_of_two_checks_in_one_sample_the_upper_row_names_the_cause() -> None:
    rig = Rig().heat(seconds=8.0)

    def both(m: Measurements) -> None:
        m.parameters_ok = 0
        m.leak = 1

    rig.spoil = both
    assert trips(rig, 1.0)[0] is Fault.PARAM_CRC


def test_checks_go_on_while_the_bench_cools() -> None:
    rig = Rig().heat(seconds=8.0)
    rig.event(Disarmed())
    rig.spoil = put("i_mA", 900, 0)
    assert trips(rig, 1.0)[0] is Fault.UNCOMMANDED_CURRENT


def test_an_idle_spring_that_stays_at_room_temperature_beside_cold_water_is_not_stuck() -> None:
    rig = Rig().arm()

    def cold_inlet(m: Measurements) -> None:
        m.rtd_cC[1], m.rtd_cC[2], m.rtd_cC[3] = 2691, 1874, 2691

    rig.spoil = cold_inlet
    rig.setpoint_mA = (700, 0)
    stays(rig, 120.0)


def test_every_fault_of_the_check_table_is_tripped_by_a_test_of_this_file() -> None:
    here = Path(__file__).read_text()
    tripped = {fault for fault in Fault if f"Fault.{fault.name}" in here}
    assert {check.fault for check in CHECKS} - tripped == set()
