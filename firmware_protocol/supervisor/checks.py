"""The checks themselves: each looks at one channel of one sample and says how it is.

This module is translated to C (see translate): integers, no allocation, no exceptions.
A check returns BAD, GOOD, or BETWEEN when the reading is inside the hysteresis band: then the
debounce counter stays where it is. A check that is BAD leaves what it measured in `s.value` and
what it compared with in `s.limit`. When and where each applies is in the table (see table).
"""

from __future__ import annotations

from firmware_protocol.supervisor.limits import Limits
from firmware_protocol.supervisor.memory import UNKNOWN, Measurements, Memory, RTD_INVALID_cC
from firmware_protocol.supervisor.observers import (
    FCC_PER_CC,
    MA2US_PER_A2S,
    NJ_PER_MJ,
    of_duty,
    resistance_is_measurable,
    resistance_mohm,
)

GOOD = 0
BETWEEN = 1
BAD = 2


def bad(s: Memory, value: int, limit: int) -> int:
    """Leave value and limit where the latch finds them, and return BAD."""
    s.value = value
    s.limit = limit
    return BAD


def sensor_invalid(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """The converter gave no value."""
    if m.rtd_cC[k] == RTD_INVALID_cC:
        return bad(s, m.rtd_cC[k], lim.rail_low_cC)
    return GOOD


def sensor_open(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """The reading is at the upper rail."""
    if m.rtd_cC[k] >= lim.rail_high_cC:
        return bad(s, m.rtd_cC[k], lim.rail_high_cC)
    return GOOD


def sensor_short(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """The reading is at the lower rail, and is a reading."""
    if m.rtd_cC[k] <= lim.rail_low_cC and m.rtd_cC[k] != RTD_INVALID_cC:
        return bad(s, m.rtd_cC[k], lim.rail_low_cC)
    return GOOD


def encoder_invalid(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """The encoder lost its signal; a board without one never says so."""
    if m.encoder_invalid:
        return bad(s, m.encoder_invalid, 0)
    return GOOD


def force_invalid(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """The load cell is at the end of its range; a board without one never says so."""
    if m.force_invalid:
        return bad(s, m.force_invalid, 0)
    return GOOD


def over_temperature(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """A believable reading above the limit."""
    if not s.sensor_ok[k]:
        return GOOD
    if s.t_cC[k] > lim.temperature_limit_cC:
        return bad(s, s.t_cC[k], lim.temperature_limit_cC)
    if s.t_cC[k] > lim.temperature_limit_cC - lim.temperature_hysteresis_cC:
        return BETWEEN
    return GOOD


def sensor_stuck(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Not one digit of change for seconds of heating in which even the slowest spring warmed.

    Under strong heating the spring is known not to respond before that; a reading without any
    noise then is stuck, rather than taken from a place that does not warm.
    """
    warmed_fcC = s.low_fcC[k] - s.stuck_low_fcC[k]
    if s.stuck_us[k] >= lim.stuck_us and warmed_fcC >= lim.stuck_model_cC * FCC_PER_CC:
        return bad(s, s.stuck_us[k], lim.stuck_us)
    if 4 * s.stuck_us[k] >= lim.stuck_us and s.anchor_net_nJ[k] >= s.heat_limit_nJ:
        return bad(s, s.stuck_us[k], lim.stuck_us)
    return GOOD


def sensor_jumps(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Several jumps within a short time, none of which a spring can make."""
    if s.jumps[k] >= lim.jumps:
        return bad(s, s.jump_cC[k], lim.jump_cC)
    return GOOD


def sensor_below_surroundings(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """A spring colder than the colder of water and room."""
    floor_cC = s.coldest_cC - lim.below_surroundings_cC
    if s.sensor_ok[k] and s.t_cC[k] < floor_cC:
        return bad(s, s.t_cC[k], floor_cC)
    return GOOD


def sensors_swapped(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Spring k got half the energy that must show, and the other sensor shows it."""
    if 2 * s.anchor_net_nJ[k] < s.heat_limit_nJ:
        return GOOD
    rise_cC = s.t_cC[1 - k] - s.anchor_other_cC[k]
    if rise_cC >= lim.swapped_rise_cC and 8 * s.anchor_other_nJ[k] < s.anchor_net_nJ[k]:
        return bad(s, rise_cC, lim.swapped_rise_cC)
    return GOOD


def not_heating(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Energy went in and the temperature did not rise."""
    if s.anchor_net_nJ[k] >= s.heat_limit_nJ:
        return bad(s, s.anchor_net_nJ[k] // NJ_PER_MJ, lim.unheated_energy_mJ)
    return GOOD


def heating_while_off(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Warming faster than a room drifts, long after the current stopped."""
    rise_cC = s.t_cC[k] - s.off_fcC[k] // FCC_PER_CC
    if rise_cC >= lim.off_rise_cC and s.t_cC[k] > s.warmest_cC + 100:
        return bad(s, rise_cC, lim.off_rise_cC)
    return GOOD


def model_residual(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Outside what any good spring would read for this energy."""
    if not s.sensor_ok[k]:
        return GOOD
    below_cC = s.low_seen_fcC[k] // FCC_PER_CC - s.t_cC[k]
    above_cC = s.t_cC[k] - s.high_fcC[k] // FCC_PER_CC
    residual_cC = max(below_cC, above_cC)
    if residual_cC > lim.residual_cC:
        return bad(s, residual_cC, lim.residual_cC)
    return GOOD


def over_current(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """More than any setpoint may ask for."""
    if m.i_mA[k] > lim.over_current_mA:
        return bad(s, m.i_mA[k], lim.over_current_mA)
    return GOOD


def uncommanded_current(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Current although none is regulated to, nor was lately."""
    # Both the filtered and the raw current: one is slow to forget a spike, the other is noisy.
    extra_uA = min(s.i_uA[k], m.i_mA[k] * 1000) - s.band_high_uA[k]
    if m.applied_mA[k] == 0 and extra_uA > lim.off_current_mA * 1000:
        return bad(s, s.i_uA[k] // 1000, lim.off_current_mA)
    return GOOD


def current_high(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """More current than was regulated to lately."""
    # Most are told by this alone, and the chip is spared a division.
    if m.applied_mA[k] == 0:
        return GOOD
    if m.i_mA[k] * 1000 <= s.band_high_uA[k] + lim.current_error_mA * 1000:
        return GOOD
    most_uA = s.band_high_uA[k]
    most_uA += lim.current_error_mA * 1000 + lim.current_error_permille * most_uA // 1000
    if min(s.i_uA[k], m.i_mA[k] * 1000) > most_uA:
        return bad(s, s.i_uA[k] // 1000, most_uA // 1000)
    return GOOD


def current_low(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Less current than was regulated to lately, but some."""
    if m.i_mA[k] <= lim.off_current_mA:
        return GOOD
    if m.i_mA[k] * 1000 >= s.band_low_uA[k] - lim.current_error_mA * 1000:
        return GOOD
    least_uA = s.band_low_uA[k]
    least_uA -= lim.current_error_mA * 1000 + lim.current_error_permille * least_uA // 1000
    if max(s.i_uA[k], m.i_mA[k] * 1000) < least_uA:
        return bad(s, s.i_uA[k] // 1000, least_uA // 1000)
    return GOOD


def no_current(s: Memory, m: Measurements, lim: Limits, k: int) -> bool:
    """Return whether current is regulated to and none flows."""
    return m.applied_mA[k] > 3 * lim.off_current_mA and m.i_mA[k] <= lim.off_current_mA


def wire_open(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """No current at full voltage."""
    if no_current(s, m, lim, k) and m.v_mV[k] >= lim.wire_open_mV:
        return bad(s, m.v_mV[k], lim.wire_open_mV)
    return GOOD


def driver_open(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """No current and no voltage to drive it."""
    if no_current(s, m, lim, k) and m.v_mV[k] < lim.wire_open_mV:
        return bad(s, m.i_mA[k], m.applied_mA[k])
    return GOOD


def resistance_out_of_band(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """V/I is not that of a spring."""
    if not resistance_is_measurable(s, m, lim, k):
        return GOOD
    # V against R times I, which takes no division.
    v_milli = (s.v_uV[k] >> 6) * 1000
    i_uA = s.i_uA[k] >> 6
    if v_milli >= (lim.resistance_max_mohm + 1) * i_uA:
        return bad(s, resistance_mohm(s, k), lim.resistance_max_mohm)
    if v_milli < lim.resistance_min_mohm * i_uA:
        return bad(s, resistance_mohm(s, k), lim.resistance_min_mohm)
    return GOOD


def resistance_rtd_disagree(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """V/I changed by more than the RTD's change of temperature explains."""
    reference_mohm = s.reference_mohm[k]
    if reference_mohm == 0:
        return GOOD
    if not resistance_is_measurable(s, m, lim, k):
        return BETWEEN
    r_mohm = resistance_mohm(s, k)
    change_mohm = abs(r_mohm - reference_mohm)
    allowed = lim.resistance_tolerance_permille
    if change_mohm * 1000 < (allowed + 1) * reference_mohm:
        return GOOD
    change_cC = abs(s.t_cC[k] - s.reference_cC[k])
    allowed += lim.resistance_tempco_ppm_per_K * change_cC // 100_000
    change_permille = change_mohm * 1000 // max(reference_mohm, 1)
    if change_permille > allowed:
        return bad(s, change_permille, allowed)
    return GOOD


def i2t(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """A tenth more than the budget, although the ceiling is at the rated current by then."""
    if s.i2t_mA2us[k] >= s.i2t_trip_mA2us:
        return bad(s, s.i2t_mA2us[k] // MA2US_PER_A2S, lim.i2t_budget_A2s)
    return GOOD


def pump_stalled(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Driven, and turning too slowly."""
    if m.pump_rpm[k] == UNKNOWN or m.duty[k] < lim.pump_duty_least:
        return GOOD
    wet_rpm = of_duty(lim.pump_rpm, m.duty[k])
    if m.pump_rpm[k] * 1000 < wet_rpm * lim.pump_stalled_permille:
        return bad(s, m.pump_rpm[k], wet_rpm * lim.pump_stalled_permille // 1000)
    return GOOD


def pump_dry(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Driven, and turning faster than water allows."""
    if m.pump_rpm[k] == UNKNOWN or m.duty[k] < lim.pump_duty_least:
        return GOOD
    wet_rpm = of_duty(lim.pump_rpm, m.duty[k])
    if m.pump_rpm[k] * 1000 > wet_rpm * lim.pump_dry_permille:
        return bad(s, m.pump_rpm[k], wet_rpm * lim.pump_dry_permille // 1000)
    return GOOD


def pump_stuck_on(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Turning without being driven."""
    if m.duty[k] == 0 and m.pump_rpm[k] > lim.pump_off_rpm:
        return bad(s, m.pump_rpm[k], lim.pump_off_rpm)
    return GOOD


def no_cooling(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """At the end of a long flush, hardly any of the excess over the inlet is gone."""
    if s.cool_us[k] < lim.cooling_us:
        return GOOD
    excess_cC = s.cool_from_cC[k] - s.warmest_cC
    least_cC = excess_cC * lim.cooling_drop_permille // 1000
    drop_cC = s.cool_from_cC[k] - s.t_cC[k]
    if excess_cC >= lim.cooling_excess_cC and drop_cC < least_cC:
        return bad(s, drop_cC, least_cC)
    return GOOD


def leak(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """The leak input is closed."""
    if m.leak:
        return bad(s, m.leak, 0)
    return GOOD


def brown_out(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """The supply is too low for the driver to regulate."""
    if m.vbus_mV < lim.brown_out_mV:
        return bad(s, m.vbus_mV, lim.brown_out_mV)
    return GOOD


def loop_overrun(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Too long since the last sample."""
    if s.dt_us > lim.overrun_us:
        return bad(s, s.dt_us, lim.overrun_us)
    return GOOD


def param_crc(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """The parameters in memory do not match their checksum."""
    if not m.parameters_ok:
        return bad(s, 0, 0)
    return GOOD


def armed_too_long(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """Armed for longer than an experiment can last."""
    armed_us = s.now_us - s.armed_at_us
    if armed_us >= (lim.on_time_limit_s + 1) * 1_000_000:
        return bad(s, armed_us // 1_000_000, lim.on_time_limit_s)
    return GOOD
