"""The check table: which check, on which channels, in which states, for how long.

A check trips when it was BAD in so many samples in a row and for so long; both names are rows of
the limits table. The order is the order of precedence: of two checks that trip in the same sample
the first one names the cause. So the sensors come before what is computed from them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from firmware_protocol.enums import BoardState, Channel, Fault
from firmware_protocol.supervisor import checks
from firmware_protocol.supervisor.limits import Limits
from firmware_protocol.supervisor.memory import Measurements, Memory

CheckFunction = Callable[[Memory, Measurements, Limits, int], int]

DRIVING = frozenset({BoardState.ARMED, BoardState.HOLD})
WARM = DRIVING | {BoardState.COOL}
REMAINING = WARM | {BoardState.FAULT}
ALWAYS = REMAINING | {BoardState.SAFE}

SPRINGS = (Channel.SPRING_X, Channel.SPRING_Y)
RTDS = (*SPRINGS, Channel.INLET, Channel.AMBIENT)


@dataclass(frozen=True, slots=True)
class Check:
    """One row of the check table."""

    fault: Fault
    function: CheckFunction
    channels: tuple[Channel, ...]
    states: frozenset[BoardState]
    samples: str
    """Limit: bad in so many samples in a row, and ..."""
    time: str
    """... limit: for so many us; empty for none."""
    trips_when: str


def _row(
    fault: Fault,
    function: CheckFunction,
    channels: tuple[Channel, ...],
    states: frozenset[BoardState],
    when: str,
    *,
    samples: str = "at_once_samples",
    time: str = "",
) -> Check:
    return Check(fault, function, channels, states, samples, time, when)


_BOARD = (Channel.BOARD,)
_THREE = "debounce_samples"
_TWO = "double_samples"

CHECKS: tuple[Check, ...] = (
    _row(
        Fault.PARAM_CRC, checks.param_crc, _BOARD, ALWAYS,
        "at boot, stored parameters fail their CRC",
    ),
    _row(
        Fault.LOOP_OVERRUN, checks.loop_overrun, _BOARD, DRIVING,
        "time since the last sample > {overrun_us}",
    ),
    _row(
        Fault.BROWN_OUT, checks.brown_out, _BOARD, DRIVING,
        "supply < {brown_out_mV}", samples=_TWO,
    ),
    _row(Fault.LEAK, checks.leak, _BOARD, ALWAYS, "leak input closed", time="leak_us"),
    _row(
        Fault.OVER_CURRENT, checks.over_current, SPRINGS, ALWAYS,
        "measured > {over_current_mA}", samples=_TWO,
    ),
    _row(
        Fault.UNCOMMANDED_CURRENT, checks.uncommanded_current, SPRINGS, ALWAYS,
        "regulated to 0, measured > {off_current_mA}", time="uncommanded_us",
    ),
    _row(
        Fault.WIRE_OPEN, checks.wire_open, SPRINGS, DRIVING,
        "no current at more than {wire_open_mV}", time="current_error_us",
    ),
    _row(
        Fault.DRIVER_OPEN, checks.driver_open, SPRINGS, DRIVING,
        "no current at less than {wire_open_mV}", time="current_error_us",
    ),
    _row(
        Fault.CURRENT_HIGH, checks.current_high, SPRINGS, DRIVING,
        "measured above regulated by {current_error_mA} + {current_error_permille}",
        time="current_error_us",
    ),
    _row(
        Fault.CURRENT_LOW, checks.current_low, SPRINGS, DRIVING,
        "measured below regulated by {current_error_mA} + {current_error_permille}",
        time="current_error_us",
    ),
    _row(
        Fault.RESISTANCE_OUT_OF_BAND, checks.resistance_out_of_band, SPRINGS, DRIVING,
        "V/I outside {resistance_min_mohm} to {resistance_max_mohm}", time="resistance_us",
    ),
    _row(
        Fault.SENSOR_INVALID, checks.sensor_invalid, RTDS, REMAINING,
        "converter gives no value", samples=_THREE,
    ),
    _row(
        Fault.SENSOR_OPEN, checks.sensor_open, RTDS, REMAINING,
        "reading >= {rail_high_cC}", samples=_THREE,
    ),
    _row(
        Fault.SENSOR_SHORT, checks.sensor_short, RTDS, REMAINING,
        "reading <= {rail_low_cC}", samples=_THREE,
    ),
    _row(
        Fault.SENSOR_INVALID, checks.encoder_invalid, (Channel.ENCODER,), DRIVING,
        "encoder without signal", samples=_THREE,
    ),
    _row(
        Fault.SENSOR_INVALID, checks.force_invalid, (Channel.FORCE,), DRIVING,
        "load cell at the end of its range", samples=_THREE,
    ),
    _row(
        Fault.SENSOR_IMPLAUSIBLE, checks.sensor_jumps, RTDS, WARM,
        "{jumps} of more than {jump_cC} from one sample to the next; "
        "one is forgotten every {jump_decay_us}",
    ),
    _row(
        Fault.SENSOR_IMPLAUSIBLE, checks.sensor_below_surroundings, SPRINGS, WARM,
        "spring colder than inlet and ambient by {below_surroundings_cC}", samples=_THREE,
    ),
    _row(
        Fault.OVER_TEMPERATURE, checks.over_temperature, SPRINGS, ALWAYS,
        "reading > {temperature_limit_cC}; good again {temperature_hysteresis_cC} below",
        samples=_THREE,
    ),
    _row(
        Fault.SENSOR_STUCK, checks.sensor_stuck, SPRINGS, DRIVING,
        "no digit changes for {stuck_us} while the heaviest spring would warm {stuck_model_cC}",
    ),
    _row(
        Fault.SENSORS_SWAPPED, checks.sensors_swapped, SPRINGS, DRIVING,
        "half of {unheated_energy_mJ} into one spring, and the other sensor rises "
        "{swapped_rise_cC}",
    ),
    _row(
        Fault.NOT_HEATING, checks.not_heating, SPRINGS, DRIVING,
        "{unheated_energy_mJ} above the losses (which know the pump), and no rise of "
        "{unheated_rise_cC}",
    ),
    _row(
        Fault.HEATING_WHILE_OFF, checks.heating_while_off, SPRINGS, WARM | {BoardState.SAFE},
        "off for {off_lag_us}, then a rise of {off_rise_cC} faster than {off_drift_cC_per_s}",
        samples=_THREE,
    ),
    _row(
        Fault.RESISTANCE_RTD_DISAGREE, checks.resistance_rtd_disagree, SPRINGS, DRIVING,
        "V/I changed by more than {resistance_tolerance_permille} + "
        "{resistance_tempco_ppm_per_K} of what the RTD changed", time="disagree_us",
    ),
    _row(
        Fault.MODEL_RESIDUAL, checks.model_residual, SPRINGS, WARM,
        "{residual_cC} outside the envelope of all good benches", time="residual_us",
    ),
    _row(
        Fault.I2T, checks.i2t, SPRINGS, DRIVING,
        "a tenth above {i2t_budget_A2s} over the rated {i2t_rated_mA}",
    ),
    _row(
        Fault.PUMP_STALLED, checks.pump_stalled, SPRINGS, WARM,
        "driven, speed < {pump_stalled_permille} of nominal", time="pump_stalled_us",
    ),
    _row(
        Fault.PUMP_DRY, checks.pump_dry, SPRINGS, WARM,
        "driven, speed > {pump_dry_permille} of nominal", time="pump_dry_us",
    ),
    _row(
        Fault.PUMP_STUCK_ON, checks.pump_stuck_on, SPRINGS, ALWAYS,
        "not driven, speed > {pump_off_rpm}", time="pump_off_us",
    ),
    _row(
        Fault.NO_COOLING, checks.no_cooling, SPRINGS, WARM,
        "{cooling_us} at full pump without current lower an excess of {cooling_excess_cC} or more "
        "by less than {cooling_drop_permille}",
    ),
    _row(
        Fault.ARMED_TOO_LONG, checks.armed_too_long, _BOARD, DRIVING,
        "armed for > {on_time_limit_s}",
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Line:
    """One row of the check table on one channel: what the machine runs."""

    check: Check
    channel: Channel


LINES: tuple[Line, ...] = tuple(Line(check, ch) for check in CHECKS for ch in check.channels)

CHECK_FUNCTION: tuple[CheckFunction, ...] = tuple(line.check.function for line in LINES)
CHECK_CHANNEL: tuple[int, ...] = tuple(int(line.channel) for line in LINES)
CHECK_FAULT: tuple[int, ...] = tuple(int(line.check.fault) for line in LINES)
LINE_COUNT = len(LINES)


def _active(state: BoardState) -> tuple[int, ...]:
    return tuple(n for n, line in enumerate(LINES) if state in line.check.states)


ACTIVE_LINES: tuple[tuple[int, ...], ...] = tuple(_active(state) for state in BoardState)
"""For each state the lines to run, in order."""
